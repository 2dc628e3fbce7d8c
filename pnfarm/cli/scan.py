"""``pnfarm scan``: who is on this wire, asked by DCP."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from pnfarm.cli.settings import Format, FormatOption

if TYPE_CHECKING:
    from ipaddress import IPv4Address

    from pnfarm.protocols.profinet.dcp_client import IdentifyAnswered

__all__ = ["scan"]

#: IEC 61158-6-10, coding of DeviceRoleDetails.
_ROLES = ("device", "controller", "multidevice", "supervisor")


def scan(
    interface: Annotated[
        str,
        typer.Option("--interface", "-i", metavar="IF", help="Network interface, such as eth1.", show_default=False),
    ],
    seconds: Annotated[float, typer.Option(min=0.1, max=60, help="How long to wait for answers.")] = 2.0,
    output: FormatOption = Format.TABLE,
) -> None:
    """Ask by DCP who is on the wire: name, type, addresses, ids, role."""
    import anyio

    from pnfarm.cli.output import print_json, print_table

    found = [_answer(event) for event in anyio.run(_identify, interface, seconds)]
    found.sort(key=lambda device: (device["name"] or "", device["mac"]))
    if output is Format.JSON:
        print_json(found)
        return
    columns = ("NAME", "TYPE", "MAC", "IP", "VENDOR", "DEVICE", "~ROLE")
    rows = [
        (
            device["name"] or "-",
            device["type"] or "-",
            device["mac"],
            device["ip"] or "-",
            _hex(device["vendor_id"]),
            _hex(device["device_id"]),
            " ".join(device["roles"]) or "-",
        )
        for device in found
    ]
    print_table(columns, rows)


async def _identify(interface: str, seconds: float) -> list[IdentifyAnswered]:
    import time

    import anyio

    from pnfarm.errors import DecodeError
    from pnfarm.links.base import PortSpec
    from pnfarm.links.interface import InterfaceLink
    from pnfarm.protocols.profinet.dcp_client import DcpClient, IdentifyAnswered, IdentifyFinished
    from pnfarm.wire.ethernet import parse_ethernet

    link = InterfaceLink(interface)
    answers: list[IdentifyAnswered] = []
    finished = anyio.Event()
    try:
        (port,) = await link.open([PortSpec("scan", bytes(6))])
        # two scans at once must not take each other's answers
        client = DcpClient(port.mac, first_xid=time.monotonic_ns() & 0x7FFF_FFFF | 1)

        def take() -> None:
            for event in client.events():
                match event:
                    case IdentifyAnswered():
                        answers.append(event)
                    case IdentifyFinished():
                        finished.set()
                    case _:
                        pass  # greetings of devices that start just now: they answer as well

        def receive(_: int, frame: bytes, now: int) -> None:
            try:
                client.receive(parse_ethernet(frame), now)
            except DecodeError:
                return  # somebody else's broken frame
            take()

        link.set_receiver(receive)
        client.identify(now=time.monotonic_ns(), window_ns=round(seconds * 1e9))
        for frame in client.to_send(time.monotonic_ns()):
            link.send(port.index, frame)
        while not finished.is_set():
            due = client.next_deadline()
            now = time.monotonic_ns()
            if due is not None and due > now:
                with anyio.move_on_after((due - now) / 1e9):
                    await finished.wait()
            client.handle_timeout(time.monotonic_ns())
            take()
    finally:
        with anyio.CancelScope(shield=True):
            await link.close()
    return answers


def _answer(event: IdentifyAnswered) -> dict[str, Any]:
    info = event.info
    role = info.role or 0
    return {
        "name": info.name,
        "type": info.station_type,
        "mac": event.mac.hex(":"),
        "ip": _address(info.ip),
        "mask": _address(info.mask),
        "gateway": _address(info.gateway),
        "vendor_id": info.vendor_id,
        "device_id": info.device_id,
        "role": info.role,
        "roles": [word for bit, word in enumerate(_ROLES) if role >> bit & 1],
    }


def _address(value: IPv4Address | None) -> str | None:
    """0.0.0.0 is how DCP says that there is none."""
    return str(value) if value is not None and int(value) else None


def _hex(value: int | None) -> str:
    return "-" if value is None else f"0x{value:04X}"
