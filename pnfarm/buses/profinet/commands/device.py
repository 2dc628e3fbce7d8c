"""One device on the wire, by its name or address: the options that name it, and the client that reads its records."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from collections.abc import Callable
    from ipaddress import IPv4Interface

    from pnfarm.buses.profinet.controller.record_client import RecordClient, RecordTask
    from pnfarm.buses.profinet.controller.records import RecordPlace

__all__ = ["IpOption", "OwnOption", "access_device", "device_of"]

IpOption = Annotated[str | None, typer.Option("--ip", metavar="IP", help="The device's address.")]
OwnOption = Annotated[
    str | None, typer.Option("--own-ip", metavar="CIDR", help="Address to ask from; left out, the interface's own.")
]


def device_of(name: str | None, ip: str | None, hint: str = "--name, --ip") -> Any:
    """The station name or the address that a :class:`RecordTask` takes; one of them is to be given."""
    from ipaddress import IPv4Address

    if (name is None) == (ip is None):
        raise typer.BadParameter("give one of them", param_hint=hint)
    if name is not None:
        # a real device may have a name that the standard forbids; it still consists of at most 240 octets
        if not 1 <= len(name) <= 240 or any(ord(letter) > 0xFF for letter in name):
            raise typer.BadParameter(
                "a station name has 1 to 240 letters, digits, '-' and '.'", param_hint=hint.partition(",")[0]
            )
        return name
    try:
        return IPv4Address(ip or "")
    except ValueError:
        raise typer.BadParameter(f"{ip!r} is not an IPv4 address", param_hint="--ip") from None


def _own_address(interface: str, wanted: str | None) -> IPv4Interface:
    """``--own-ip``, or the first address that the kernel has on the interface."""
    from ipaddress import IPv4Interface

    from pnfarm.links.kernel.addresses import kernel_address

    if wanted is None:
        return kernel_address(interface)
    try:
        return IPv4Interface(wanted)
    except ValueError:
        raise typer.BadParameter(f"{wanted!r} is not like 10.0.0.1/24", param_hint="--own-ip") from None


def access_device(
    interface: str,
    own_ip: str | None,
    task: RecordTask,
    more: Callable[[RecordClient], RecordPlace | None] | None = None,
) -> RecordClient:
    """The client after its last record.  ``more`` gives the next record to read after each one, None for none.

    Raises RemoteError when the device is not found and, without ``more``, when it refused or did not answer.
    """
    import anyio

    return anyio.run(_access, interface, _own_address(interface, own_ip), task, more)


async def _access(
    interface: str,
    own: IPv4Interface,
    task: RecordTask,
    more: Callable[[RecordClient], RecordPlace | None] | None,
) -> RecordClient:
    import os
    import time

    from pnfarm.buses.profinet.commands.asking import ask_stations
    from pnfarm.buses.profinet.controller.record_client import RecordClient

    def goes_on(client: RecordClient) -> bool:
        place = None if more is None or client.station is None else more(client)
        if place is not None:
            client.read_next(place, time.monotonic_ns())
        return place is not None

    client = await ask_stations(interface, own, lambda mac: RecordClient(task, mac, own, os.urandom(16)), goes_on)
    if more is None or client.station is None:
        client.check()
    return client
