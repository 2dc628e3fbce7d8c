"""``pnfarm record``: what it prints, and what it says of a wrong command line."""

from __future__ import annotations

import pytest

from pnfarm.cli.main import main
from pnfarm.cli.record import _blocks, _lines

IM0 = bytes.fromhex("00200038 0100 0105") + b"AKD".ljust(20) + b"S-1".ljust(16) + bytes.fromhex(
    "0003 56 011100 0000 3a00 0000 0101 000e"
)  # fmt: skip


def test_known_blocks_are_shown_by_their_fields() -> None:
    (block,) = _blocks(IM0)
    assert block["block"] == "Im0"
    assert (block["order_id"], block["serial_number"], block["im_supported"]) == ("AKD", "S-1", 14)
    assert "  im_supported: 14 (0xE)" in _lines(block, 1)


@pytest.mark.parametrize("data", [b"", b"\x01", bytes(3), bytes.fromhex("7fff 0002 0100"), IM0[:-1]])
def test_what_is_no_block_stays_hexadecimal(data: bytes) -> None:
    assert _blocks(data) == []


READ = ["record", "read", "-i", "nowhere0", "--slot", "0", "--subslot", "1", "--index", "0xAFF0"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (READ, "give one of them"),
        ([*READ, "--name", "a", "--ip", "10.0.0.1"], "give one of them"),
        ([*READ, "--ip", "10.0.0"], "is no IPv4 address"),
        ([*READ, "--name", "a", "--own-ip", "x"], "is not like 10.0.0.1/24"),
        ([*READ, "--name", "a"], "there is no interface nowhere0"),
        ([*READ[:-1], "abc", "--name", "a"], "is no number"),
        (["record", "write", *READ[2:], "--name", "a", "zz"], "is not hexadecimal"),
    ],
)
def test_a_wrong_command_line_is_one_sentence_and_code_2(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    (sentence,) = capsys.readouterr().err.splitlines()
    assert words in sentence
