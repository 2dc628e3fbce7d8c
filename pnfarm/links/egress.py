"""Where cyclic frames and LLDP of a macvlan leave: through its own interface, or through the parent's for less cost.

The parent sends a frame with a macvlan's address as source exactly as the macvlan does, but for one case: another
macvlan on the same parent does not receive it.  Those are known: the kernel lists the addresses that an interface takes
for others, in whatever network namespace these are.  A macvlan that is down sends nothing, so its frames may not leave
through the parent either: the kernel reports changes.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
import struct
import time
from typing import TYPE_CHECKING, Literal

from pnfarm.errors import EnvironmentError_
from pnfarm.links.base import unwrap
from pnfarm.links.kernel.netlink import DONE, ERROR, REQUEST_DUMP, attributes, error_of, messages, request

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from pnfarm.links.base import Link

__all__ = ["Egress", "EgressChoice", "addresses_taken", "egress_of"]

#: The farm file's `link: {send: ...}`.
EgressChoice = Literal["auto", "parent", "own", "xdp"]

# linux/rtnetlink.h, linux/neighbour.h, linux/if_link.h
_NEIGHBOUR = struct.Struct("=BxxxiHBB")  # family, interface, state, flags, type
_INTERFACE = struct.Struct("=BxHiII")  # family, type, index, flags, change
_NEW_LINK, _DELETED_LINK, _GET_LINK, _GET_NEIGHBOUR = 16, 17, 18, 30
_LINK_LAYER_ADDRESS = 2
_RTMGRP_LINK = 1
_IFF_UP = 1
_RECEIVE = 256 * 1024
#: Room for what the kernel reports when the parent's carrier changes: some messages of 2 kB for each of 1,024 macvlans.
_REPORTS = 8 * 1024 * 1024
_SO_RCVBUFFORCE = 33

#: How long a list of addresses is trusted, seconds: in a storm of connections it is asked for once.
TRUSTED_SECONDS = 1.0
#: How long one that has no other is trusted where a little is lost: LLDP comes again every few seconds.
TRUSTED_ALONE_SECONDS = 10.0


def _dump(kind: int, body: bytes) -> Iterator[tuple[int, memoryview]]:
    """What the kernel lists.  Raises OSError where it does not answer."""
    with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, socket.NETLINK_ROUTE) as asking:
        asking.settimeout(1.0)
        asking.send(request(kind, REQUEST_DUMP, body))
        while True:
            for answer, content in messages(asking.recv(_RECEIVE)):
                if answer == DONE:
                    return
                if answer == ERROR:
                    raise OSError(error_of(content), os.strerror(error_of(content)))
                yield answer, content


def addresses_taken(index: int) -> frozenset[bytes]:
    """Addresses that the interface ``index`` takes beside its own: those of its macvlans that are up, and groups.

    Raises :class:`EnvironmentError_` where the kernel does not answer.
    """
    found: set[bytes] = set()
    try:
        for _, content in _dump(_GET_NEIGHBOUR, _NEIGHBOUR.pack(socket.AF_BRIDGE, index, 0, 0, 0)):
            if len(content) >= _NEIGHBOUR.size and _NEIGHBOUR.unpack_from(content)[1] == index:
                address = attributes(content[_NEIGHBOUR.size :]).get(_LINK_LAYER_ADDRESS)
                if address is not None:
                    found.add(address)
    except OSError as exc:
        raise EnvironmentError_(f"the kernel does not report the addresses of interface {index}: {exc}") from exc
    return frozenset(found)


def _interfaces_up() -> set[int]:
    """Raises OSError where the kernel does not answer."""
    return {
        index
        for kind, content in _dump(_GET_LINK, _INTERFACE.pack(socket.AF_UNSPEC, 0, 0, 0, 0))
        if kind == _NEW_LINK and len(content) >= _INTERFACE.size
        for _family, _type, index, flags, _change in (_INTERFACE.unpack_from(content),)
        if flags & _IFF_UP
    }


class Egress:
    """The egress of the macvlans on one parent; interfaces are their indexes."""

    def __init__(self, choice: EgressChoice) -> None:
        self._choice = choice
        self._parent = 0
        self._ports: frozenset[int] = frozenset()
        #: The ports' own addresses.
        self._macs: dict[int, bytes] = {}
        self._down: set[int] = set()
        self._taken: frozenset[bytes] = frozenset()
        #: Whether stations that are none of the ports are among them.
        self._others = False
        self._asked: float | None = None
        self._changes: socket.socket | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._changed: Callable[[int], None] | None = None

    def open(self, parent: int, ports: Mapping[int, bytes]) -> None:
        """Begin to follow the interfaces, with their addresses, in the running event loop.  All of them are up."""
        if self._choice == "own":
            return
        self._parent, self._ports, self._macs = parent, frozenset(ports), dict(ports)
        self._changes = socket.socket(socket.AF_NETLINK, socket.SOCK_RAW | socket.SOCK_NONBLOCK, socket.NETLINK_ROUTE)
        with contextlib.suppress(PermissionError):  # a smaller one only loses reports earlier
            self._changes.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, _REPORTS)
        self._changes.bind((0, _RTMGRP_LINK))
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(self._changes.fileno(), self._read_changes)

    def close(self) -> None:
        """From here on every port has its own exit.  Closing twice does nothing."""
        if self._changes is not None:
            if self._loop is not None and not self._loop.is_closed():
                self._loop.remove_reader(self._changes.fileno())
            self._changes.close()
            self._changes = None
        self._ports = frozenset()

    @property
    def xdp_interface(self) -> int:
        """The interface that is sent through past its queue and its captures, 0 for none."""
        return self._parent if self._choice == "xdp" else 0

    def set_listener(self, changed: Callable[[int], None]) -> None:
        """``changed(port)`` is called when a port's frames may leave elsewhere from now on."""
        self._changed = changed

    def egress_for(self, port: int, destination: bytes) -> int:
        """The interface through which the frames of ``port`` to ``destination`` leave; 0: its own."""
        if port not in self._ports or port in self._down or destination[0] & 1:
            return 0
        return 0 if self._choice in {"auto", "xdp"} and self._is_sibling(destination) else self._parent

    def leaves_unheard(self, port: int) -> bool:
        """Whether what ``port`` sends to its cable's other end may leave through the parent.

        From a macvlan the kernel offers a group's frame to each of its siblings, a tenth of a millisecond for a
        thousand of them.  Only a macvlan of another program would want it.
        """
        if port not in self._ports or port in self._down:
            return False
        return self._choice == "parent" or (self._ask(TRUSTED_ALONE_SECONDS) and not self._others)

    def set_mac(self, port: int, mac: bytes) -> None:
        """The port has another address."""
        if port in self._macs:
            self._macs[port] = mac
            self._asked = None

    def set_pulled(self, port: int, pulled: bool) -> None:
        """The port's cable, before the kernel reports it."""
        if port in self._ports and pulled != (port in self._down):
            (self._down.add if pulled else self._down.discard)(port)
            self._report(port)

    def _is_sibling(self, destination: bytes) -> bool:
        """Whether another macvlan has this address; where the kernel does not answer, it is taken for one."""
        return not self._ask(TRUSTED_SECONDS) or destination in self._taken

    def _ask(self, trusted: float) -> bool:
        """Ask the kernel for the addresses, unless its last answer is not older than ``trusted`` seconds.

        False where it does not answer.
        """
        now = time.monotonic()
        if self._asked is None or now - self._asked > trusted:
            try:
                self._taken = addresses_taken(self._parent)
            except EnvironmentError_:
                self._asked = None
                return False
            self._asked = now
            self._others = any(not mac[0] & 1 for mac in self._taken.difference(self._macs.values()))
        return True

    def _report(self, port: int) -> None:
        if self._changed is not None:
            self._changed(port)

    def _read_changes(self) -> None:
        """What the kernel reports of interfaces."""
        if self._changes is None:
            return
        try:
            data = self._changes.recv(_RECEIVE)
        except BlockingIOError:
            return
        except OSError:
            # the kernel had no room for its reports (ENOBUFS)
            self._ask_again(self._changes)
            return
        for kind, content in messages(data):
            if kind not in {_NEW_LINK, _DELETED_LINK} or len(content) < _INTERFACE.size:
                continue
            _family, _type, index, flags, _change = _INTERFACE.unpack_from(content)
            if index in self._ports:
                self.set_pulled(index, kind == _DELETED_LINK or not flags & _IFF_UP)

    def _ask_again(self, changes: socket.socket) -> None:
        """Ask which interfaces are up: reports were lost."""
        # what is still in the queue is older than the answer
        for _ in range(_REPORTS // 256):
            try:
                changes.recv(_RECEIVE)
            except BlockingIOError:
                break
            except OSError:  # more was lost
                continue
        try:
            up = _interfaces_up()
        except OSError:
            # each port's own way is always right
            ports, self._ports = self._ports, frozenset()
            for port in ports:
                self._report(port)
            return
        for port in self._ports:
            self.set_pulled(port, port not in up)


def egress_of(link: Link) -> Egress | None:
    """The egress of a link; None for a kind of link that has no choice."""
    egress: Egress | None = getattr(unwrap(link), "egress", None)
    return egress
