"""IPv4 addresses of the kernel's on a farm's interfaces: many in one subnet of one namespace, each only on its own.

Linux treats an address as the host's, whatever interface has it: it answers ARP for it on all of them, and what goes
to an address of the host itself never leaves it.  So a drive's address is taken out of the table ``local`` and put
into a table of the drive's own, which is asked only for what comes in at its interface or leaves from its address:

=====================================  =====================================================================
``rule iif IF lookup T``               what comes in at the interface: the address is local there alone
``rule from ADDRESS lookup T``         what leaves from the address, by the interface
``local ADDRESS dev IF table T``       instead of the same in the table ``local``
``SUBNET dev IF table T``, broadcast,  the wire behind the interface
default
=====================================  =====================================================================

A further interface of the namespace that hears the drives' ARP (a bridge, a controller's) should answer for its own
addresses alone (``arp_ignore`` 1), as a farm's bridge does.

With this, ARP for an address is answered by its own interface alone, a controller in the same namespace reaches the
drive through the wire like any other, and the routes of the host stay as they are.  A socket binds to such an address
with ``IP_FREEBIND``.

The requests are built here (as in :mod:`pnfarm.links.kernel.silence`) so that they take effect at once, without a
thread: when a drive's supply goes, its address goes in the same callback.  Sources: linux/rtnetlink.h,
linux/fib_rules.h, linux/if_addr.h.
"""

from __future__ import annotations

import errno
import os
import socket
import struct
from ipaddress import IPv4Address, IPv4Interface
from typing import TYPE_CHECKING, Self

from pnfarm.errors import EnvironmentError_
from pnfarm.links.kernel.netlink import (
    DONE,
    ERROR,
    REQUEST_ACK,
    REQUEST_DUMP,
    attribute,
    attributes,
    error_of,
    messages,
    request,
)

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

__all__ = ["attach", "detach", "remove_rules", "renew"]

_ADDRESS = struct.Struct("=BBBBI")  # ifaddrmsg
_ROUTE = struct.Struct("=BBBBBBBBI")  # rtmsg, fib_rule_hdr

_NEW_ADDRESS, _DEL_ADDRESS = 20, 21
_NEW_ROUTE, _DEL_ROUTE = 24, 25
_NEW_RULE, _DEL_RULE, _GET_RULE = 32, 33, 34
_CREATE, _EXCLUSIVE, _REPLACE = 0x0400, 0x0200, 0x0100

# if_addr.h
_IFA_ADDRESS, _IFA_LOCAL, _IFA_CACHEINFO, _IFA_FLAGS = 1, 2, 6, 8
_IFA_F_NOPREFIXROUTE = 0x200
# rtnetlink.h
_RTA_DST, _RTA_OIF, _RTA_GATEWAY, _RTA_PREFSRC, _RTA_TABLE = 1, 4, 5, 7, 15
_RTN_UNICAST, _RTN_LOCAL, _RTN_BROADCAST = 1, 2, 3
_SCOPE_UNIVERSE, _SCOPE_LINK, _SCOPE_HOST = 0, 253, 254
_TABLE_LOCAL = 255
_PROTOCOL = 4  # RTPROT_STATIC
# fib_rules.h
_FRA_SRC, _FRA_IIFNAME, _FRA_PRIORITY, _FRA_TABLE = 2, 3, 6, 15
_ACTION_TO_TABLE = 1

#: Priorities of the rules: after ``local`` (0), before ``main`` (32766).  All rules of interfaces come before all of
#: addresses: what one drive sends to another comes in from an address that has a rule, too.
OF_INTERFACES, OF_ADDRESSES = 11_500, 11_501
#: Routing tables of interfaces: this plus the interface's index.
FIRST_TABLE = 0x50_00_00_00
#: Nothing is there to be removed.
_GONE = frozenset({errno.ENOENT, errno.ESRCH, errno.EADDRNOTAVAIL, errno.ENODEV})


class _Netlink:
    """An open socket of the kernel's; each request is answered before the next."""

    def __enter__(self) -> Self:
        self._socket = socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, socket.NETLINK_ROUTE)
        self._socket.settimeout(10.0)
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def ask(self, kind: int, flags: int, body: bytes, *, gone: bool = False, down: bool = False) -> None:
        """One request; raises :class:`OSError`, but with ``gone`` not for what is not there.

        With ``down`` an interface that is down needs no such route.
        """
        self._socket.send(request(kind, REQUEST_ACK | flags, body))
        code = next(error_of(content) for _, content in messages(self._socket.recv(8192)))
        if code and not (gone and code in _GONE) and not (down and code == errno.ENETDOWN):
            raise OSError(code, os.strerror(code))

    def rules(self) -> list[dict[int, bytes]]:
        """The attributes of every IPv4 rule."""
        body = _ROUTE.pack(socket.AF_INET, 0, 0, 0, 0, 0, 0, 0, 0)
        self._socket.send(request(_GET_RULE, REQUEST_DUMP, body))
        found: list[dict[int, bytes]] = []
        while True:
            for kind, rule in messages(self._socket.recv(1 << 20)):
                if kind in {DONE, ERROR}:
                    return found
                found.append(attributes(rule[_ROUTE.size :]) | {0: bytes(rule[1:3])})


def _number(kind: int, value: int) -> bytes:
    return attribute(kind, struct.pack("=I", value))


def _address(index: int, interface: IPv4Interface, seconds: int = 0) -> bytes:
    """``seconds``: after which the kernel takes it away by itself; 0: it stays."""
    octets = interface.ip.packed
    body = _ADDRESS.pack(socket.AF_INET, interface.network.prefixlen, 0, _SCOPE_UNIVERSE, index)
    body += attribute(_IFA_LOCAL, octets) + attribute(_IFA_ADDRESS, octets)
    body += _number(_IFA_FLAGS, _IFA_F_NOPREFIXROUTE)
    # preferred and valid
    return body + (attribute(_IFA_CACHEINFO, struct.pack("=4I", seconds, seconds, 0, 0)) if seconds else b"")


def _route(
    index: int,
    kind: int,
    scope: int,
    to: IPv4Address,
    prefix: int,
    table: int,
    source: IPv4Address | None = None,
    gateway: IPv4Address | None = None,
) -> bytes:
    short = table if table < 256 else 0
    body = _ROUTE.pack(socket.AF_INET, prefix, 0, 0, short, _PROTOCOL if table != _TABLE_LOCAL else 0, scope, kind, 0)
    body += _number(_RTA_TABLE, table) + _number(_RTA_OIF, index)
    if prefix:
        body += attribute(_RTA_DST, to.packed)
    if source is not None:
        body += attribute(_RTA_PREFSRC, source.packed)
    return body + (attribute(_RTA_GATEWAY, gateway.packed) if gateway is not None else b"")


def _rules(name: str, interface: IPv4Interface, table: int) -> tuple[bytes, bytes]:
    def rule(bits: int, which: bytes, priority: int) -> bytes:
        head = _ROUTE.pack(socket.AF_INET, 0, bits, 0, 0, 0, 0, _ACTION_TO_TABLE, 0)
        return head + which + _number(_FRA_PRIORITY, priority) + _number(_FRA_TABLE, table)

    of_interface = rule(0, attribute(_FRA_IIFNAME, name.encode() + b"\0"), OF_INTERFACES)
    return of_interface, rule(32, attribute(_FRA_SRC, interface.ip.packed), OF_ADDRESSES)


def renew(addresses: Sequence[tuple[int, IPv4Interface]], seconds: int) -> int:
    """Let the kernel keep addresses (interface's index, address) for so long from now on; how many it refused.

    It takes them away by itself then, up to a second later, and with them the routes from them: nothing is answered any
    more, not even for open streams, whether this process runs or not.
    """
    refused = 0
    with _Netlink() as kernel:
        for index, interface in addresses:
            try:
                kernel.ask(_NEW_ADDRESS, _REPLACE, _address(index, interface, seconds))
            except OSError:
                refused += 1
    return refused


def attach(
    index: int, name: str, interface: IPv4Interface, gateway: IPv4Address | None = None, seconds: int = 0
) -> None:
    """Give an interface its address; doing it again restores what the kernel forgot, or refused, while it was down.

    ``seconds``: after which the kernel takes it away by itself unless it is renewed; 0: never.
    Raises :class:`~pnfarm.errors.EnvironmentError_` when the kernel refuses.
    """
    table, own, network = FIRST_TABLE + index, interface.ip, interface.network
    try:
        with _Netlink() as kernel:
            kernel.ask(_NEW_ADDRESS, _CREATE | _REPLACE, _address(index, interface, seconds))
            routes: list[tuple[int, int, IPv4Address, int, IPv4Address, IPv4Address | None]]
            routes = [(_RTN_LOCAL, _SCOPE_HOST, own, 32, own, None)]
            routes.append((_RTN_UNICAST, _SCOPE_LINK, network.network_address, network.prefixlen, own, None))
            if network.prefixlen < 31:
                routes.append((_RTN_BROADCAST, _SCOPE_LINK, network.broadcast_address, 32, own, None))
            if gateway is not None:
                routes.append((_RTN_UNICAST, _SCOPE_UNIVERSE, IPv4Address(0), 0, own, gateway))
            for kind, scope, to, prefix, source, by in routes:
                body = _route(index, kind, scope, to, prefix, table, source, by)
                kernel.ask(_NEW_ROUTE, _CREATE | _REPLACE, body, down=True)
            for rule in _rules(name, interface, table):
                kernel.ask(_DEL_RULE, 0, rule, gone=True)
                kernel.ask(_NEW_RULE, _CREATE | _EXCLUSIVE, rule)
            # what the kernel made of the address by itself
            kernel.ask(_DEL_ROUTE, 0, _route(index, _RTN_LOCAL, _SCOPE_HOST, own, 32, _TABLE_LOCAL), gone=True)
            to = network.broadcast_address
            kernel.ask(_DEL_ROUTE, 0, _route(index, _RTN_BROADCAST, _SCOPE_LINK, to, 32, _TABLE_LOCAL), gone=True)
    except OSError as exc:
        raise EnvironmentError_(f"interface {name} cannot have the address {interface}: {exc.strerror}") from exc


def detach(index: int, name: str, interface: IPv4Interface) -> None:
    """Take the address away: first as a local one, so that nothing is answered any more, then everything else."""
    table, own = FIRST_TABLE + index, interface.ip
    try:
        with _Netlink() as kernel:
            for where in (table, _TABLE_LOCAL):
                kernel.ask(_DEL_ROUTE, 0, _route(index, _RTN_LOCAL, _SCOPE_HOST, own, 32, where), gone=True)
            kernel.ask(_DEL_ADDRESS, 0, _address(index, interface), gone=True)
            for rule in _rules(name, interface, table):
                kernel.ask(_DEL_RULE, 0, rule, gone=True)
    except OSError as exc:
        raise EnvironmentError_(f"interface {name} cannot lose the address {interface}: {exc.strerror}") from exc


def remove_rules(names: Collection[str]) -> int:
    """Remove the rules of interfaces of these names, whether these still exist or not; how many.

    Addresses and routes go with the interface.
    """
    if not names:
        return 0
    with _Netlink() as kernel:
        priorities = {struct.pack("=I", priority) for priority in (OF_INTERFACES, OF_ADDRESSES)}
        every = [rule for rule in kernel.rules() if rule.get(_FRA_PRIORITY) in priorities]
        wanted = {name.encode() + b"\0" for name in names}
        tables = {rule[_FRA_TABLE] for rule in every if rule.get(_FRA_IIFNAME) in wanted and _FRA_TABLE in rule}
        doomed = [rule for rule in every if rule.get(_FRA_TABLE) in tables]
        for rule in doomed:
            head = _ROUTE.pack(socket.AF_INET, *rule[0], 0, 0, 0, 0, _ACTION_TO_TABLE, 0)
            kinds = (_FRA_SRC, _FRA_IIFNAME, _FRA_PRIORITY, _FRA_TABLE)
            kernel.ask(_DEL_RULE, 0, head + b"".join(attribute(k, rule[k]) for k in kinds if k in rule), gone=True)
        return len(doomed)
