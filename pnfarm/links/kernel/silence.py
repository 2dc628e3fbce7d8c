"""Keeps the kernel's own IP stack off a drive's interface, or in bounds where the drive has sockets of the kernel's.

A drive answers ARP, ICMP and UDP itself (:mod:`pnfarm.protocols.ip`).  The kernel must not answer with
its address beside it, so on each interface: no ARP (``IFF_NOARP``; else Linux answers for every address
of the host), no IPv6 address and no neighbour discovery, no forwarding (a host that routes, as every container
host does, would send a drive's datagrams on), no gratuitous ARP.

All of it fits in one RTM_SETLINK per interface; they go out in batches.  The messages are built here because
pyroute2 knows ``IFLA_INET_CONF`` only as the kernel reports it, not as it takes it.
Sources: linux/rtnetlink.h, linux/if_link.h, linux/ip.h (IPV4_DEVCONF_*).
"""

from __future__ import annotations

import contextlib
import errno
import os
import socket
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pnfarm.errors import EnvironmentError_
from pnfarm.links.kernel.netlink import ERROR, REQUEST_ACK, attribute, error_of, messages, request

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["Marked", "bring_up", "silence"]

_LINK = struct.Struct("=BxHiII")  # ifinfomsg
_RTM_SETLINK = 19
_NLA_F_NESTED = 0x8000

_IFLA_IFALIAS = 20
_IFLA_AF_SPEC = 26
_IFLA_INET_CONF = 1
_IFLA_INET6_ADDR_GEN_MODE = 8
_ADDR_GEN_MODE_NONE = 1

_DEVCONF_FORWARDING = 1
_DEVCONF_ARP_IGNORE = 19
_DEVCONF_ARP_NOTIFY = 22
_DEVCONF_RP_FILTER = 8
_DEVCONF_ARP_ANNOUNCE = 18
_DEVCONF_ACCEPT_LOCAL = 23
#: For an interface with an address of its own: ARP for that address alone and from it alone, and a peer may be an
#: address of this host, whose route leads elsewhere.
_WITH_ADDRESS = ((_DEVCONF_ARP_IGNORE, 1), (_DEVCONF_ARP_ANNOUNCE, 2), (_DEVCONF_ACCEPT_LOCAL, 1))
_RP_FILTER_OF_ALL = Path("/proc/sys/net/ipv4/conf/all/rp_filter")
_ARP_IGNORE_OTHERS = 1  # "reply only if the target IP address is local address configured on the incoming interface"
_ARP_IGNORE_ALL = 8  # "do not reply for all local addresses"

_IFF_UP = 0x01
_IFF_NOARP = 0x80

#: Requests per datagram: their acknowledgements must fit in one receive buffer.
_PER_BATCH = 64


@dataclass(frozen=True, slots=True)
class Marked:
    """An interface to silence and its ownership tag.

    ``arp`` is left on at the far end of a cable (a veth's peer, a TAP), where a controller may live with an address
    of the kernel's.  ``kernel``: the station itself has one (:mod:`pnfarm.links.kernel.network`).
    """

    index: int
    name: str
    alias: str
    arp: bool = False
    kernel: bool = False


def silence(interfaces: Sequence[Marked]) -> None:
    """Tag and silence interfaces that are still down.

    Raises :class:`~pnfarm.errors.EnvironmentError_` when the kernel refuses.
    """
    try:
        _silence(interfaces)
    except OSError as exc:
        raise EnvironmentError_(f"the kernel refused to silence the farm's interfaces: {exc.strerror}") from exc
    for interface in interfaces:
        # With no address generated IPv6 sends nothing already; where /proc/sys can be written it is off altogether.
        with contextlib.suppress(OSError):
            Path(f"/proc/sys/net/ipv6/conf/{interface.name}/disable_ipv6").write_text("1", encoding="utf-8")


def _silence(interfaces: Sequence[Marked]) -> None:
    with_ipv6 = Path("/proc/sys/net/ipv6/conf").is_dir()
    try:
        _transact([_set_silent(interface, with_ipv6) for interface in interfaces])
    except OSError as exc:
        if not (with_ipv6 and exc.errno == errno.EAFNOSUPPORT):
            raise
        # IPv6 is compiled in but switched off for this namespace: there is nothing of it to silence
        _transact([_set_silent(interface, False) for interface in interfaces])


def bring_up(indexes: Sequence[int], up: bool = True) -> None:
    """Set many interfaces up (or down).

    Raises :class:`OSError`: ``EBUSY`` when a MAC address is in use on the parent.
    """
    flags = _IFF_UP if up else 0
    _transact([_link_message(index, flags, _IFF_UP, b"") for index in indexes])


def _source_check() -> int:
    """How strictly the sources of packets to an address are checked: not at all, if the host lets us.

    The higher value of the interface's and that of all interfaces holds, and 2 is milder than 1.  With 2, too, the
    kernel drops a broadcast if the main table has no route to its sender: for one it asks none of the drive's rules.
    """
    try:
        of_all = _RP_FILTER_OF_ALL.read_text(encoding="ascii").strip()
    except OSError:
        return 2
    return 0 if of_all == "0" else 2


def _nested(kind: int, payload: bytes) -> bytes:
    return attribute(kind | _NLA_F_NESTED, payload)


def _link_message(index: int, flags: int, change: int, attributes: bytes) -> bytes:
    return _LINK.pack(socket.AF_UNSPEC, 0, index, flags, change) + attributes


def _set_silent(interface: Marked, with_ipv6: bool) -> bytes:
    conf = attribute(_DEVCONF_FORWARDING, struct.pack("=I", 0))
    if interface.kernel:
        for setting, value in (*_WITH_ADDRESS, (_DEVCONF_RP_FILTER, _source_check())):
            conf += attribute(setting, struct.pack("=I", value))
    else:
        # a bridge that answered for a controller's address elsewhere in this namespace would take its frames away
        ignored = _ARP_IGNORE_OTHERS if interface.arp else _ARP_IGNORE_ALL
        conf += attribute(_DEVCONF_ARP_IGNORE, struct.pack("=I", ignored))
    conf += attribute(_DEVCONF_ARP_NOTIFY, struct.pack("=I", 0))
    families = _nested(socket.AF_INET, _nested(_IFLA_INET_CONF, conf))
    if with_ipv6:
        mode = attribute(_IFLA_INET6_ADDR_GEN_MODE, bytes([_ADDR_GEN_MODE_NONE]))
        families += _nested(socket.AF_INET6, mode)
    attributes = attribute(_IFLA_IFALIAS, interface.alias.encode()) + _nested(_IFLA_AF_SPEC, families)
    return _link_message(
        interface.index, 0 if interface.arp or interface.kernel else _IFF_NOARP, _IFF_NOARP, attributes
    )


def _transact(bodies: Sequence[bytes]) -> None:
    """Send RTM_SETLINK requests and wait for every acknowledgement; the first refusal is raised as OSError."""
    with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, socket.NETLINK_ROUTE) as sock:
        sock.bind((0, 0))
        sock.settimeout(10.0)
        first_error = 0
        for start in range(0, len(bodies), _PER_BATCH):
            batch = bodies[start : start + _PER_BATCH]
            sock.send(b"".join(request(_RTM_SETLINK, REQUEST_ACK, one, number) for number, one in enumerate(batch, 1)))
            waiting = len(batch)
            while waiting:
                for kind, content in messages(sock.recv(65536)):
                    if kind == ERROR:
                        first_error = first_error or error_of(content)
                        waiting -= 1
            if first_error:
                raise OSError(first_error, os.strerror(first_error))
