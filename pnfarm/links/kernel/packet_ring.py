"""A packet socket that sees every frame of some interfaces, both ways, and puts them into shared memory.

TPACKET_V3 (Documentation/networking/packet_mmap.rst): the kernel copies each frame that the filter lets through, with
its stamp, interface, direction and VLAN tag, into blocks of a ring; a block is handed over when it is full or
after :data:`RETIRE_MS`.  No system call and no wake-up per frame; frames without room are counted and cost the
sender nothing.  Offsets of the block's and the frame's header are those of linux/if_packet.h.
"""

from __future__ import annotations

import mmap
import select
import socket
import struct
from typing import TYPE_CHECKING

from pnfarm.errors import EnvironmentError_
from pnfarm.links.kernel import bpf
from pnfarm.links.kernel.packet import bind_socket

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["BLOCK", "RETIRE_MS", "PacketRing"]

# linux/if_packet.h, linux/if_ether.h
_SOL_PACKET = 263
_PACKET_RX_RING = 5
_PACKET_STATISTICS = 6
_PACKET_VERSION = 10
_TPACKET_V3 = 2
_ETH_P_ALL = 0x0003
#: Offset of block_status in a block's header.
_STATUS = 8
_STATUS_USER = 1

#: Octets of a block: the longest frame, 64 KiB of a segmented TCP stream, fits.
BLOCK = 256 * 1024
#: Octets of the ring: three seconds of 64 drives at 4 ms.
RING = 16 * 1024 * 1024
#: A block that is not full is handed over after this time.
RETIRE_MS = 50
_FRAME_SIZE = 2048


class PacketRing:
    """A socket with its ring.  ``memory`` is the whole ring, block after block.

    Raises :class:`~pnfarm.errors.EnvironmentError_` without CAP_NET_RAW, or without memory for the ring.
    """

    def __init__(self, filter_code: bytes, *, size: int = RING) -> None:
        self.blocks = size // BLOCK
        try:
            self._socket = socket.socket(socket.AF_PACKET, socket.SOCK_RAW | socket.SOCK_CLOEXEC, 0)
        except PermissionError as exc:
            raise EnvironmentError_(
                "a capture needs CAP_NET_RAW in this network namespace: run as root, or leave --pcap out"
            ) from exc
        try:
            bpf.attach(self._socket, filter_code)
            self._socket.setsockopt(_SOL_PACKET, _PACKET_VERSION, _TPACKET_V3)
            request = struct.pack("7I", BLOCK, self.blocks, _FRAME_SIZE, size // _FRAME_SIZE, RETIRE_MS, 0, 0)
            self._socket.setsockopt(_SOL_PACKET, _PACKET_RX_RING, request)
            self.memory = mmap.mmap(self._socket.fileno(), size)
            # bound last, to no interface: one that goes down or comes back stays captured
            bind_socket(self._socket, _ETH_P_ALL)
        except OSError as exc:
            self._socket.close()
            raise EnvironmentError_(f"the capture's socket failed: {exc.strerror}") from exc
        self._next = 0
        self._poll = select.poll()
        self._poll.register(self._socket.fileno(), select.POLLIN | select.POLLERR)

    def wait(self, milliseconds: int) -> None:
        """Wait until a block is ready, at most the timeout."""
        self._poll.poll(milliseconds)

    def take(self) -> Iterator[int]:
        """Offset of each ready block in the memory; it returns to the kernel when the next one is requested.

        At most one round of the ring, so that a slow consumer still gets to other work.
        """
        for _ in range(self.blocks):
            start = self._next * BLOCK
            (status,) = struct.unpack_from("=I", self.memory, start + _STATUS)
            if not status & _STATUS_USER:
                return
            try:
                yield start
            finally:
                struct.pack_into("=I", self.memory, start + _STATUS, 0)
                self._next = (self._next + 1) % self.blocks

    def lost(self) -> int:
        """Frames dropped for lack of room since the last call."""
        _seen, lost, _frozen = struct.unpack("3I", self._socket.getsockopt(_SOL_PACKET, _PACKET_STATISTICS, 12))
        return int(lost)

    def close(self) -> None:
        """Harmless when closed.  Views of the memory must be gone."""
        self._socket.close()
        self.memory.close()
