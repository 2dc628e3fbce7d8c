"""``pnfarm record``: read and write one record of a device on the wire, virtual or real."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from pnfarm.cli.numbers import LONG, WORD, number_of
from pnfarm.cli.settings import Format, FormatOption, help_without_command

if TYPE_CHECKING:
    from ipaddress import IPv4Interface

    from pnfarm.controller.record_client import RecordClient, RecordTask

__all__ = ["app"]

#: What one call carries, less the head of the record.
WRITE_OCTETS = 65_536 - 64

app = typer.Typer(help="Read and write a record of a device on the wire.")
app.callback(invoke_without_command=True)(help_without_command)


InterfaceOption = Annotated[
    str, typer.Option("--interface", "-i", metavar="IF", help="Network interface, such as eth1.", show_default=False)
]
NameOption = Annotated[str | None, typer.Option("--name", "-n", help="The device's station name.")]
IpOption = Annotated[str | None, typer.Option("--ip", metavar="IP", help="The device's address.")]
OwnOption = Annotated[
    str | None, typer.Option("--own-ip", metavar="CIDR", help="Address to ask from; left out, the interface's own.")
]
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
    from pnfarm.cli.output import print_json
    from pnfarm.controller.record_client import RecordTask
    from pnfarm.protocols.profinet.wire.block_words import blocks_in_words

    task = RecordTask(_target(name, ip), (api, slot, subslot, index), length=length, implicit=implicit)
    client = _run(interface, own_ip, task)
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
    """Write a record through a connection for device access, beside whatever controller there is."""
    from pnfarm.cli.output import print_json, print_line
    from pnfarm.controller.record_client import RecordTask

    try:
        octets = bytes.fromhex(data)
    except ValueError:
        raise typer.BadParameter(f"{data!r} is not hexadecimal", param_hint="HEX") from None
    if len(octets) > WRITE_OCTETS:
        raise typer.BadParameter(f"{len(octets)} octets are too long; one write takes {WRITE_OCTETS}", param_hint="HEX")
    client = _run(interface, own_ip, RecordTask(_target(name, ip), (api, slot, subslot, index), data=octets))
    if output is Format.JSON:
        print_json({**_place(client), "length": len(octets), "ok": True})
    else:
        print_line(f"{len(octets)} octets written")


def _target(name: str | None, ip: str | None) -> Any:
    from ipaddress import IPv4Address

    if (name is None) == (ip is None):
        raise typer.BadParameter("give one of them", param_hint="--name, --ip")
    if name is not None:
        # a real device may have a name that the standard forbids; it still has octets, and no more than 240
        if not 1 <= len(name) <= 240 or any(ord(letter) > 0xFF for letter in name):
            raise typer.BadParameter("a station name has 1 to 240 letters, digits, '-' and '.'", param_hint="--name")
        return name
    try:
        return IPv4Address(ip or "")
    except ValueError:
        raise typer.BadParameter(f"{ip!r} is no IPv4 address", param_hint="--ip") from None


def _own_address(interface: str, wanted: str | None) -> IPv4Interface:
    """``--own-ip``, or the first address that the kernel has on the interface."""
    import errno
    import fcntl
    import socket
    import struct
    from ipaddress import IPv4Address, IPv4Interface

    from pnfarm.errors import ConfigError

    if wanted is not None:
        try:
            return IPv4Interface(wanted)
        except ValueError:
            raise typer.BadParameter(f"{wanted!r} is not like 10.0.0.1/24", param_hint="--own-ip") from None
    asked = struct.pack("256s", interface.encode()[:15])
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        try:
            # SIOCGIFADDR, SIOCGIFNETMASK: netdevice(7)
            address, mask = (IPv4Address(fcntl.ioctl(sock, code, asked)[20:24]) for code in (0x8915, 0x891B))
        except OSError as exc:
            if exc.errno == errno.ENODEV:
                raise ConfigError(f"there is no interface {interface}") from exc
            raise ConfigError(f"interface {interface} has no IPv4 address: give one by --own-ip") from exc
    return IPv4Interface(f"{address}/{mask}")


def _run(interface: str, own_ip: str | None, task: RecordTask) -> RecordClient:
    import anyio

    return anyio.run(_access, interface, _own_address(interface, own_ip), task)


async def _access(interface: str, own: IPv4Interface, task: RecordTask) -> RecordClient:
    """The client at its end.  Raises RemoteError when the device refused or kept silent."""
    import os
    import time

    import anyio

    from pnfarm.cli.running import raise_of_callbacks
    from pnfarm.controller.record_client import TOOL_PORT, RecordClient
    from pnfarm.controller.runtime import hold_ports
    from pnfarm.links.base import PortSpec
    from pnfarm.links.interface import InterfaceLink

    link = InterfaceLink(interface)
    held = hold_ports(own, (TOOL_PORT,))
    woken = anyio.Event()
    try:
        (port,) = await link.open([PortSpec("record", bytes(6))])
        client = RecordClient(task, port.mac, own, os.urandom(16))

        def send() -> None:
            for frame in client.to_send(time.monotonic_ns()):
                link.send(port.index, frame)

        def receive(_: int, frame: bytes, now: int) -> None:
            client.receive(frame, now)
            send()
            woken.set()

        link.set_receiver(receive)
        async with raise_of_callbacks():
            client.start(time.monotonic_ns())
            send()
            while not client.done:
                woken = anyio.Event()
                due = client.next_deadline()
                wait = None if due is None else max(0.0, (due - time.monotonic_ns()) / 1e9)
                with anyio.move_on_after(wait):
                    await woken.wait()
                client.handle_timeout(time.monotonic_ns())
                send()
    finally:
        for sock in held:
            sock.close()
        with anyio.CancelScope(shield=True):
            await link.close()
    client.check()
    return client


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
    from pnfarm.cli.output import print_line
    from pnfarm.protocols.profinet.wire.block_words import blocks_in_words

    blocks = blocks_in_words(data)
    if not blocks:
        print_line(data.hex(" ") if data else "empty")
    for block in blocks:
        print_line(str(block.pop("block")))
        for line in _lines(block, 1):
            print_line(line)


def _lines(value: Any, depth: int) -> list[str]:
    """Fields below each other, what is inside of them indented."""
    from pnfarm.protocols.profinet.wire.block_words import number_words

    lines = []
    indent = "  " * depth
    for key, part in value.items() if isinstance(value, dict) else ((f"{i}", part) for i, part in enumerate(value)):
        if isinstance(part, (dict, list)) and part:
            lines += [f"{indent}{key}:", *_lines(part, depth + 1)]
        else:
            is_number = isinstance(part, int) and not isinstance(part, bool)
            lines.append(f"{indent}{key}: {number_words(part) if is_number else part}")
    return lines
