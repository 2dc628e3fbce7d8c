"""``pnfarm record``: what it prints, and what it says of a wrong command line."""

from __future__ import annotations

import asyncio

import anyio
import pytest

from pnfarm.buses.profinet.commands.record import WRITE_OCTETS, _lines
from pnfarm.cli.main import main
from pnfarm.links.base import Port
from pnfarm.links.callbacks import raise_of_callbacks
from pnfarm.protocols.profinet.wire.block import RawBlock
from pnfarm.protocols.profinet.wire.block_texts import blocks_in_line, blocks_in_words
from pnfarm.protocols.profinet.wire.records.pdev import MultipleBlock

IM0 = bytes.fromhex("00200038 0100 0105") + b"AKD".ljust(20) + b"S-1".ljust(16) + bytes.fromhex(
    "0003 56 011100 0000 3a00 0000 0101 000e"
)  # fmt: skip


def test_known_blocks_are_shown_by_their_fields() -> None:
    (block,) = blocks_in_words(IM0)
    assert block["block"] == "Im0"
    assert (block["order_id"], block["serial_number"], block["im_supported"]) == ("AKD", "S-1", 14)
    assert "  im_supported: 14 (0xE)" in _lines(block, 1)


@pytest.mark.parametrize("data", [b"", b"\x01", bytes(3), bytes.fromhex("7fff 0002 0100"), IM0[:-1]])
def test_what_is_no_block_stays_hexadecimal(data: bytes) -> None:
    assert blocks_in_words(data) == []


def test_blocks_inside_of_a_block_are_shown_by_their_fields() -> None:
    inner = RawBlock(0x0251, bytes.fromhex("003f") + bytes(24), 0x0101)
    data = MultipleBlock(0, 0, 0x8001, (inner, RawBlock(0x7FFF, b"\x01"))).emit()
    (block,) = blocks_in_words(data)
    assert [one["block"] for one in block["blocks"]] == ["PortStatistic", "RawBlock"]
    assert block["blocks"][0]["status"] == 0x3F
    assert blocks_in_line(data).startswith(
        "MultipleBlock api 0, slot 0, subslot 32769 (0x8001), blocks ((PortStatistic "
    )


def test_a_line_of_blocks_is_bounded() -> None:
    assert blocks_in_line(IM0).startswith("Im0 vendor_id 261 (0x105), order_id AKD, serial_number S-1, ")
    assert blocks_in_line(b"\x01") == ""
    long = blocks_in_line(IM0 * 20)
    assert long.endswith(" ...")
    assert len(long) < 250


READ = ["record", "read", "-i", "nowhere0", "--slot", "0", "--subslot", "1", "--index", "0xAFF0"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (READ, "give one of them"),
        ([*READ, "--name", "a", "--ip", "10.0.0.1"], "give one of them"),
        ([*READ, "--ip", "10.0.0"], "is not an IPv4 address"),
        ([*READ, "--name", "a", "--own-ip", "x"], "is not like 10.0.0.1/24"),
        ([*READ, "--name", "a"], "there is no interface nowhere0"),
        ([*READ[:-1], "abc", "--name", "a"], "'abc' is not a valid index"),
        ([*READ, "--name", ""], "a station name has 1 to 240"),
        ([*READ, "--name", "a" * 241], "a station name has 1 to 240"),
        ([*READ, "--name", "axis-€"], "a station name has 1 to 240"),
        (["record", "write", *READ[2:], "--name", "a", "00" * (WRITE_OCTETS + 1)], "65473 octets are too long"),
        (["record", "write", *READ[2:], "--name", "a", "zz"], "is not hexadecimal"),
    ],
)
def test_a_wrong_command_line_is_one_sentence_and_code_2(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    (sentence,) = capsys.readouterr().err.splitlines()
    assert words in sentence


@pytest.mark.parametrize("service", ["read", "write"])
@pytest.mark.parametrize("number", ["-1", "over", "0x1_0000_0000_0000", "99999999999", "9" * 5000])
@pytest.mark.parametrize(
    ("option", "what", "most"),
    [
        ("--slot", "slot", 0xFFFF),
        ("--subslot", "subslot", 0xFFFF),
        ("--index", "index", 0xFFFF),
        ("--api", "API", 2**32 - 1),
    ],
)
def test_a_number_beyond_its_field_is_one_sentence_and_code_2(
    service: str, option: str, what: str, most: int, number: str, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = str(most + 1) if number == "over" else number
    more = ["00"] if service == "write" else []
    assert main(["record", service, *READ[2:], option, wrong, "--name", "a", *more]) == 2
    (sentence,) = capsys.readouterr().err.splitlines()
    assert f"is not a valid {what}; give a number such as 1 or 0x8000, at most 0x{most:X}" in sentence
    assert len(sentence) < 150


class EchoLink:
    """An interface on which every frame that is sent comes back."""

    def __init__(self, _interface: str) -> None:
        self.receiver = None

    async def open(self, _wanted: object) -> list[Port]:
        return [Port("echo", 1, bytes.fromhex("0200000000aa"))]

    async def close(self) -> None:
        self.receiver = None

    def set_receiver(self, receiver) -> None:
        self.receiver = receiver

    def send(self, index: int, frame: bytes) -> None:
        asyncio.get_running_loop().call_soon(self.receiver, index, frame, 0)


@pytest.mark.parametrize(
    ("machine", "arguments"),
    [
        (
            "pnfarm.buses.profinet.controller.record_client.RecordClient.receive",
            [*READ, "--name", "a", "--own-ip", "10.0.0.1/24"],
        ),
        ("pnfarm.protocols.profinet.dcp.client.DcpClient.receive", ["scan", "-i", "nowhere0", "--seconds", "50"]),
    ],
)
def test_an_error_in_a_callback_ends_the_command_as_an_internal_error(
    machine: str, arguments: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: object) -> None:
        raise ValueError("65536 does not fit in 2 octets")

    monkeypatch.setattr("pnfarm.buses.profinet.commands.asking.InterfaceLink", EchoLink)
    monkeypatch.setattr("pnfarm.buses.profinet.commands.asking.hold_ports", lambda *_: [])
    monkeypatch.setattr(machine, fail)
    assert main(arguments) == 5
    (sentence,) = capsys.readouterr().err.splitlines()
    assert sentence.startswith("pnfarm: internal error: ValueError: 65536 does not fit in 2 octets")


def test_what_waits_for_a_callback_ends_with_its_error() -> None:
    async def wait() -> None:
        async with raise_of_callbacks():
            asyncio.get_running_loop().call_soon(lambda: 1 // 0)
            await anyio.sleep_forever()

    with pytest.raises(ZeroDivisionError):
        anyio.run(wait)
