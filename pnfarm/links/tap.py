"""One TAP per drive: the drive is a file descriptor, the kernel's interface is the other end of its cable.

Nothing of the kernel's stack is on the drive's side, so a TAP works where macvlan and veth are missing, and a
virtual machine's bridge can be joined. The price: there is no packet socket to share, so every frame, the
cyclic ones too, is one system call in the event loop. Cyclic frames (0x8892, frame id < 0xFC00) go to their
own receiver; answers go out by :meth:`TapLink.send` as well. Slower than the other links: for tens of drives,
not hundreds.

A TAP vanishes with its descriptor, also when the process is killed.
"""

from __future__ import annotations

import asyncio
import errno
import fcntl
import os
import struct
import time
from typing import TYPE_CHECKING

from pnfarm.errors import EnvironmentError_, InternalError
from pnfarm.links.base import MULTICAST_LLDP, LinkCounters, Port, PortSpec, Receiver
from pnfarm.links.kernel.interfaces import Interfaces, run_to_completion
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET, ETHERTYPE_VLAN
from pnfarm.wire.rtc import ALARM_FRAME_IDS, FIRST_ACYCLIC_FRAME_ID

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

__all__ = ["TapLink", "is_cyclic", "without_priority_tag"]

# linux/if_tun.h
_TUN_DEVICE = "/dev/net/tun"
_TUNSETIFF = 0x400454CA
_TUNSETCARRIER = 0x400454E2
_IFF_TAP = 0x0002
_IFF_NO_PI = 0x1000

_MAY_USE = "run as a user who may read and write it"
_BATCH = 32
_FRAME = 2048


def without_priority_tag(frame: bytes) -> bytes | None:
    """The frame as a packet socket would give it: a tag of VLAN 0 (priority only) is taken off.

    So is any tag of an alarm or a cyclic frame: their VLAN id is the controller's to choose.  None for another frame of
    another VLAN, which is not for a station outside of it.
    """
    if int.from_bytes(frame[12:14], "big") != ETHERTYPE_VLAN:
        return frame
    bare = frame[:12] + frame[16:]
    if int.from_bytes(frame[14:16], "big") & 0x0FFF and not (is_cyclic(bare) or _is_alarm(bare)):
        return None
    return bare


def is_cyclic(frame: bytes) -> bool:
    """Whether an untagged frame is for the engine: ethertype 0x8892 with a frame id below 0xFC00."""
    return (
        len(frame) >= 16
        and int.from_bytes(frame[12:14], "big") == ETHERTYPE_PROFINET
        and int.from_bytes(frame[14:16], "big") < FIRST_ACYCLIC_FRAME_ID
    )


def _is_alarm(frame: bytes) -> bool:
    return (
        int.from_bytes(frame[12:14], "big") == ETHERTYPE_PROFINET
        and int.from_bytes(frame[14:16], "big") in ALARM_FRAME_IDS
    )


class TapLink:
    """``link: {kind: tap, bridge: br0}``.

    ``bridge`` names an existing bridge for the kernel's ends; without it they stay free.  The drive's address is
    the spec's; the kernel's end has another address.
    """

    kind = "tap"

    def __init__(self, farm: str, *, bridge: str | None = None) -> None:
        self._farm = farm
        self._bridge = bridge
        self._counters = LinkCounters()
        self._receiver: Receiver | None = None
        self._cyclic_receiver: Receiver | None = None
        self._fds: dict[int, int] = {}
        self._macs: dict[int, bytes] = {}
        self._pulled: set[int] = set()
        self._loop: asyncio.AbstractEventLoop | None = None

    @property
    def bridge(self) -> str | None:
        """Name of the bridge that the kernel's ends are ports of."""
        return self._bridge

    @property
    def counters(self) -> LinkCounters:
        return self._counters

    def set_receiver(self, receiver: Receiver) -> None:
        self._receiver = receiver

    def set_cyclic_receiver(self, receiver: Receiver) -> None:
        """Set the receiver of cyclic frames; until then they are counted as received and dropped."""
        self._cyclic_receiver = receiver

    async def open(self, wanted: Sequence[PortSpec]) -> list[Port]:
        if self._fds:
            raise InternalError("this tap link is already open")
        try:
            ports = await run_to_completion(self._create, list(wanted))
            self._loop = asyncio.get_running_loop()
            for index, fd in self._fds.items():
                self._loop.add_reader(fd, self._reader_of(index, fd))
        except BaseException:
            await self.close()
            raise
        return ports

    def _create(self, wanted: Sequence[PortSpec]) -> list[Port]:
        ports: list[Port] = []
        with Interfaces() as interfaces:
            names = interfaces.free_names(self._farm)
            for spec in wanted:
                name = next(names)
                fd = _open_tap(name, spec.station)
                try:
                    index = interfaces.find(name, "tap").index
                    interfaces.mark(self._farm, index, name, spec.station)
                    if self._bridge is not None:
                        interfaces.enslave(index, self._bridge)
                except BaseException:
                    os.close(fd)
                    raise
                self._fds[index] = fd
                self._macs[index] = spec.mac
                ports.append(Port(name, index, spec.mac))
        return ports

    async def close(self) -> None:
        for fd in self._fds.values():
            if self._loop is not None and not self._loop.is_closed():
                self._loop.remove_reader(fd)
        if self._fds:
            await run_to_completion(self._remove)

    def _remove(self) -> None:
        with Interfaces() as interfaces:  # all at once; closing them one by one waits a grace period for each
            interfaces.remove(self._farm, set(self._fds))
        for fd in self._fds.values():
            os.close(fd)
        self._fds.clear()
        self._macs.clear()
        self._pulled.clear()

    def _reader_of(self, index: int, fd: int) -> Callable[[], None]:
        def receive_batch() -> None:
            now = time.monotonic_ns()
            for _ in range(_BATCH):
                try:
                    frame = os.read(fd, _FRAME)
                except BlockingIOError:
                    return
                except OSError:
                    # the interface was removed: no more frames will come
                    self._counters.dropped["interface-down"] += 1
                    if self._loop is not None:
                        self._loop.remove_reader(fd)
                    return
                self._take(index, frame, now)

        return receive_batch

    def _take(self, index: int, raw: bytes, now: int) -> None:
        counters = self._counters
        frame = without_priority_tag(raw)
        if index in self._pulled:
            counters.dropped["cable-pulled"] += 1
        elif frame is None:
            counters.dropped["other-vlan"] += 1
        elif frame[:6] == MULTICAST_LLDP and frame[6:12] in self._macs.values():
            # a bridge that forwards LLDP: behind a real switch drives do not receive each other's LLDP
            counters.dropped["own-lldp"] += 1
        elif not frame[0] & 1 and frame[:6] != self._macs[index]:
            counters.dropped["other-address"] += 1
        else:
            counters.received += 1
            receiver = self._cyclic_receiver if is_cyclic(frame) else self._receiver
            if receiver is not None:
                receiver(index, frame, now)

    def send(self, port_index: int, frame: bytes) -> None:
        """Send an acyclic or a cyclic frame; what cannot go is counted."""
        dropped = self._counters.dropped
        fd = self._fds.get(port_index)
        if fd is None:
            dropped["unknown-port"] += 1
            return
        if port_index in self._pulled:
            dropped["cable-pulled"] += 1
            return
        try:
            os.write(fd, frame)
        except OSError as exc:
            reasons = {errno.EIO: "interface-down", errno.EBADFD: "interface-down", errno.EAGAIN: "queue-full"}
            dropped[reasons.get(exc.errno or 0, "refused")] += 1
        else:
            self._counters.sent += 1

    async def set_carrier(self, port_index: int, up: bool) -> None:
        fd = self._fds.get(port_index)
        if fd is None:
            raise InternalError(f"this tap link has no port {port_index}")
        fcntl.ioctl(fd, _TUNSETCARRIER, struct.pack("i", int(up)))
        if up:
            self._pulled.discard(port_index)
        else:
            self._pulled.add(port_index)

    async def set_mac(self, port_index: int, mac: bytes) -> None:
        if port_index not in self._fds:
            raise InternalError(f"this tap link has no port {port_index}")
        self._macs[port_index] = mac


def _open_tap(name: str, station: str) -> int:
    try:
        fd = os.open(_TUN_DEVICE, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
    except FileNotFoundError as exc:
        raise EnvironmentError_(
            f"tap for {station}: {_TUN_DEVICE} does not exist, load the module with `modprobe tun` "
            "(in a container: pass the device with `--device /dev/net/tun`)"
        ) from exc
    except OSError as exc:
        few = exc.errno in {errno.EMFILE, errno.ENFILE}
        what = "every TAP is an open file, raise their limit (`ulimit -n`)" if few else _MAY_USE
        raise EnvironmentError_(f"tap for {station}: {_TUN_DEVICE} cannot be opened ({exc.strerror}): {what}") from exc
    try:
        fcntl.ioctl(fd, _TUNSETIFF, struct.pack("16sH22x", name.encode(), _IFF_TAP | _IFF_NO_PI))
    except OSError as exc:
        os.close(fd)
        if exc.errno == errno.EPERM:
            raise EnvironmentError_(
                f"tap for {station}: making a TAP needs CAP_NET_ADMIN in this network namespace: run as root"
            ) from exc
        raise EnvironmentError_(f"tap for {station} was refused by the kernel: {exc.strerror}") from exc
    return fd
