"""``pnfarm record``: read and write one record of a device on the wire, virtual or real."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from pnfarm.buses.profinet.commands.device import IpOption, OwnOption, access_device, device_of
from pnfarm.terminal.numbers import LONG, WORD, number_of
from pnfarm.terminal.settings import Format, FormatOption, help_without_command

if TYPE_CHECKING:
    from pnfarm.buses.profinet.controller.record_client import RecordClient

__all__ = ["app"]

#: Octets that one call carries, less the record's header.
WRITE_OCTETS = 65_536 - 64

app = typer.Typer(help="Read and write a record of a device on the wire.")
app.callback(invoke_without_command=True)(help_without_command)


InterfaceOption = Annotated[
    str, typer.Option("--interface", "-i", metavar="IF", help="Network interface, such as eth1.", show_default=False)
]
NameOption = Annotated[str | None, typer.Option("--name", "-n", help="The device's station name.")]
SlotOption = Annotated[int, typer.Option(parser=number_of("slot", WORD), metavar="N", show_default=False, help="Slot.")]
SubslotOption = Annotated[
    int, typer.Option(parser=number_of("subslot", WORD), metavar="N", show_default=False, help="Subslot.")
]
IndexOption = Annotated[
    int, typer.Option(parser=number_of("index", WORD), metavar="N", show_default=False, help="Index: 0xAFF0.")
]
ApiOption = Annotated[int, typer.Option(parser=number_of("API", LONG), metavar="N", help="API: 0x3A00 for PROFIdrive.")]


@app.command("read")
def read(
    interface: InterfaceOption,
    slot: SlotOption,
    subslot: SubslotOption,
    index: IndexOption,
    api: ApiOption = 0,
    name: NameOption = None,
    ip: IpOption = None,
    own_ip: OwnOption = None,
    implicit: Annotated[bool, typer.Option("--implicit", help="Without a connection (ReadImplicit).")] = False,
    length: Annotated[int, typer.Option(min=1, max=65536, help="Octets to take at most.")] = 4096,
    output: FormatOption = Format.TABLE,
) -> None:
    """Read a record: decoded where its blocks are known, hexadecimal otherwise."""
    from pnfarm.buses.profinet.controller.record_client import RecordTask
    from pnfarm.protocols.profinet.wire.block_texts import blocks_in_words
    from pnfarm.terminal.output import print_json

    task = RecordTask(device_of(name, ip), (api, slot, subslot, index), length=length, implicit=implicit)
    client = access_device(interface, own_ip, task)
    data = client.data or b""
    if output is Format.JSON:
        print_json({**_place(client), "length": len(data), "data": data.hex(), "blocks": blocks_in_words(data)})
        return
    _print(data)


@app.command("write")
def write(
    interface: InterfaceOption,
    slot: SlotOption,
    subslot: SubslotOption,
    index: IndexOption,
    data: Annotated[str, typer.Argument(metavar="HEX", help="What to write, hexadecimal.", show_default=False)],
    api: ApiOption = 0,
    name: NameOption = None,
    ip: IpOption = None,
    own_ip: OwnOption = None,
    output: FormatOption = Format.TABLE,
) -> None:
    """Write a record through a connection for device access, in addition to a controller's connection."""
    from pnfarm.buses.profinet.controller.record_client import RecordTask
    from pnfarm.terminal.output import print_json, print_line

    try:
        octets = bytes.fromhex(data)
    except ValueError:
        raise typer.BadParameter(f"{data!r} is not hexadecimal", param_hint="HEX") from None
    if len(octets) > WRITE_OCTETS:
        raise typer.BadParameter(f"{len(octets)} octets are too long; one write takes {WRITE_OCTETS}", param_hint="HEX")
    client = access_device(interface, own_ip, RecordTask(device_of(name, ip), (api, slot, subslot, index), data=octets))
    if output is Format.JSON:
        print_json({**_place(client), "length": len(octets), "ok": True})
    else:
        print_line(f"{len(octets)} octets written")


def _place(client: RecordClient) -> dict[str, Any]:
    api, slot, subslot, index = client.task.place
    info = None if client.station is None else client.station.info
    return {
        "name": None if info is None else info.name,
        "ip": None if info is None else str(info.ip),
        "api": api,
        "slot": slot,
        "subslot": subslot,
        "index": index,
    }


def _print(data: bytes) -> None:
    from pnfarm.protocols.profinet.wire.block_texts import blocks_in_words
    from pnfarm.terminal.output import print_line

    blocks = blocks_in_words(data)
    if not blocks:
        print_line(data.hex(" ") if data else "empty")
    for block in blocks:
        print_line(str(block.pop("block")))
        for line in _lines(block, 1):
            print_line(line)


def _lines(value: Any, depth: int) -> list[str]:
    """Fields one below the other, nested ones indented."""
    from pnfarm.protocols.profinet.wire.block_texts import number_text

    lines = []
    indent = "  " * depth
    for key, part in value.items() if isinstance(value, dict) else ((f"{i}", part) for i, part in enumerate(value)):
        if isinstance(part, (dict, list)) and part:
            lines += [f"{indent}{key}:", *_lines(part, depth + 1)]
        else:
            is_number = isinstance(part, int) and not isinstance(part, bool)
            lines.append(f"{indent}{key}: {number_text(part) if is_number else part}")
    return lines
