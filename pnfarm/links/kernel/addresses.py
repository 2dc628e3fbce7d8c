"""IPv4 addresses that the kernel has as well: finding an interface's address, and keeping its UDP ports reserved."""

from __future__ import annotations

import errno
import fcntl
import socket
import struct
from ipaddress import IPv4Address, IPv4Interface
from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError, EnvironmentError_

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["hold_ports", "kernel_address"]

# netdevice(7)
_SIOCGIFADDR, _SIOCGIFNETMASK = 0x8915, 0x891B


def kernel_address(interface: str) -> IPv4Interface:
    """The kernel's first address on the interface.  Raises :class:`ConfigError` where it has none."""
    asked = struct.pack("256s", interface.encode()[:15])
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        try:
            address, mask = (
                IPv4Address(fcntl.ioctl(sock, code, asked)[20:24]) for code in (_SIOCGIFADDR, _SIOCGIFNETMASK)
            )
        except OSError as exc:
            if exc.errno == errno.ENODEV:
                raise ConfigError(f"there is no interface {interface}") from exc
            raise ConfigError(f"interface {interface} has no IPv4 address: give one by --own-ip") from exc
    return IPv4Interface(f"{address}/{mask}")


def hold_ports(address: IPv4Interface, ports: Sequence[int]) -> list[socket.socket]:
    """Where the kernel has the same address, reserve the UDP ports; the sockets are to be closed at the end.

    It would answer every datagram of a drive with "port unreachable" otherwise.  Nothing is ever read here.
    """
    held: list[socket.socket] = []
    for port in ports:
        sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)
        try:
            sock.bind((str(address.ip), port))
        except OSError as exc:
            sock.close()
            if exc.errno == errno.EADDRNOTAVAIL:
                break  # the kernel does not have the address, so it does not answer
            for other in held:
                other.close()
            raise EnvironmentError_(
                f"UDP port {port} of {address.ip} is another program's: stop it, or take another ip"
            ) from exc
        held.append(sock)
    return held
