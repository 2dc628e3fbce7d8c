"""EtherNet/IP's part of ``pnfarm scan``: the devices that answer ListIdentity, by broadcast and at single addresses."""

from __future__ import annotations

import errno
import fcntl
import socket
import struct
import time
from functools import partial
from ipaddress import IPv4Address
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pnfarm.buses.search import Question, SearchAnswer
    from pnfarm.protocols.enip.encapsulation import Peer
    from pnfarm.protocols.enip.identity_search import Found, IdentitySearch

__all__ = ["ask_everyone", "search", "twice"]

_SIOCGIFADDR: Final = 0x8915
_EVERYONE: Final = IPv4Address("255.255.255.255")
_LONGEST_NAME: Final = 15
_LARGEST: Final = 65_535
#: The shortest time over which devices spread their answers, and what the last one takes on its way, ms.
_SHORTEST_MS, _WAY_MS = 500, 500
#: Datagrams that are read at once before others get their turn.
_AT_ONCE: Final = 256
#: Devices that are kept.
MOST_DEVICES: Final = 4096


async def search(question: Question) -> SearchAnswer:
    """Devices by ListIdentity.  An interface without an address cannot ask: an error if this bus was named."""
    from pnfarm.buses.search import SearchAnswer
    from pnfarm.errors import EnvironmentError_

    found = await ask_everyone(question)
    if isinstance(found, str):
        if question.chosen or question.addresses:
            raise EnvironmentError_(found)
        return SearchAnswer((), lambda: None, (found,), searched=False)
    devices = [_device(one) for one in sorted(found.found.values(), key=lambda one: one.peer)]
    return SearchAnswer(devices, partial(_print, devices, question.interface), tuple(twice(found)))


async def ask_everyone(question: Question, most: int = MOST_DEVICES) -> IdentitySearch | str:
    """Ask at an interface, and collect answers; a sentence where it has no address and so cannot ask.

    Raises :class:`~pnfarm.errors.EnvironmentError_`.
    """
    import anyio

    # what looks for interfaces has an event loop of its own
    await anyio.to_thread.run_sync(_find, question.interface)
    own = _own_address(question.interface)
    if own is None:
        return (
            f"interface {question.interface} has no IPv4 address, so EtherNet/IP devices cannot be asked: "
            f"`ip address add ADDRESS/LENGTH dev {question.interface}`"
        )
    return await _listen(question, own, most)


def _find(interface: str) -> None:
    """Raises :class:`~pnfarm.errors.EnvironmentError_` for an interface that is not there or not up."""
    from pnfarm.links.kernel.interfaces import Interfaces

    with Interfaces() as interfaces:
        interfaces.find_usable(interface, "interface")


def _own_address(interface: str) -> IPv4Address | None:
    """The interface's first address."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ask:
        request = struct.pack("16s24x", interface.encode()[:_LONGEST_NAME])
        try:
            answer = fcntl.ioctl(ask.fileno(), _SIOCGIFADDR, request)
        except OSError as exc:
            if exc.errno == errno.EADDRNOTAVAIL:
                return None
            raise
    return IPv4Address(answer[20:24])


async def _listen(question: Question, own: IPv4Address, most: int) -> IdentitySearch:
    """Ask everyone and the single addresses, and collect answers for at least a second."""
    import anyio

    from pnfarm.errors import EnvironmentError_
    from pnfarm.protocols.enip.identity_search import IdentitySearch
    from pnfarm.protocols.enip.wire.encapsulation import ENIP_PORT

    found = IdentitySearch(max(_SHORTEST_MS, round(question.seconds * 1000) - _WAY_MS), most)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
        wire.setblocking(False)
        wire.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        try:
            wire.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, question.interface.encode() + b"\0")
            wire.bind((str(own), 0))
            for address in (_EVERYONE, *question.addresses):
                wire.sendto(found.question(), (str(address), ENIP_PORT))
        except OSError as exc:
            raise EnvironmentError_(
                f"EtherNet/IP devices cannot be asked at {question.interface}: {(exc.strerror or str(exc)).lower()}"
            ) from exc
        end = time.monotonic() + found.duration_ns / 1e9
        while (left := end - time.monotonic()) > 0:
            with anyio.move_on_after(left):
                await anyio.wait_readable(wire)
                _take(wire, found)
    return found


def _take(wire: socket.socket, found: IdentitySearch) -> None:
    """All datagrams that wait."""
    for _ in range(_AT_ONCE):
        try:
            data, (address, port) = wire.recvfrom(_LARGEST)
        except BlockingIOError:
            return
        except ConnectionRefusedError:
            continue  # no one listens at one of the single addresses
        found.datagram(data, (IPv4Address(address), port))


def twice(found: IdentitySearch) -> Iterable[str]:
    """Sentences about addresses and serial numbers that are there more than once."""
    for address, _ in sorted(found.conflicts):
        yield f"two devices answer at {address}: one address, two serial numbers"
    by_serial: dict[tuple[int, int], list[Peer]] = {}
    for one in found.found.values():
        by_serial.setdefault((one.identity.vendor_id, one.identity.serial), []).append(one.peer)
    for (vendor, serial), peers in sorted(by_serial.items()):
        if len(peers) > 1:
            places = ", ".join(str(address) for address, _ in sorted(peers))
            yield f"vendor {vendor} serial number 0x{serial:08X} appears {len(peers)} times: {places}"


def _device(one: Found) -> dict[str, Any]:
    """``announced_ip`` is the address in the answer: another one behind a router that translates addresses."""
    identity = one.identity
    return {
        "name": identity.name.decode("latin-1"),
        "type": None,
        "mac": None,
        "ip": str(one.peer[0]),
        "vendor_id": identity.vendor_id,
        "device_type": identity.device_type,
        "product_code": identity.product_code,
        "revision": "{}.{}".format(*identity.revision),
        "serial": identity.serial,
        "status": identity.status,
        "state": identity.state,
        "announced_ip": str(identity.address),
        "port": identity.port,
    }


def _print(devices: list[dict[str, Any]], interface: str) -> None:
    from pnfarm.terminal.output import print_line, print_table
    from pnfarm.vocabulary.quoting import printable

    if not devices:
        print_line(f"{interface}: no device answers to ListIdentity")
        return
    columns = ("PRODUCT", "IP", "VENDOR", "DEVICE TYPE", "PRODUCT CODE", "REVISION", "SERIAL", "STATUS")
    rows = [
        (
            printable(device["name"]) or "-",
            device["ip"],
            str(device["vendor_id"]),
            str(device["device_type"]),
            str(device["product_code"]),
            device["revision"],
            f"0x{device['serial']:08X}",
            f"0x{device['status']:04X}",
        )
        for device in devices
    ]
    print_table(columns, rows)
