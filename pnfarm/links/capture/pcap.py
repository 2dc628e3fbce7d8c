"""Captures in the format pcapng, and a wrapper of a link that writes every frame that passes.

Format: pcapng, draft-ietf-opsawg-pcapng: a section header, one interface description per port, enhanced packet blocks
with nanosecond stamps, interface statistics at the end.  Wireshark shows the ports as interfaces.  Directions in
the file are the drive's: inbound is what it received.

:class:`PcapLink` records acyclic frames as they pass, others (virtual time's cyclic ones) are handed in by
:meth:`PcapLink.record`.  On interfaces of the kernel nothing is wrapped: see :mod:`pnfarm.links.kernel.packet_ring`.
"""

from __future__ import annotations

import struct
import time
from typing import TYPE_CHECKING, Any

from pnfarm.errors import EnvironmentError_, InternalError
from pnfarm.links.base import ETHERNET
from pnfarm.links.wrapper import LinkWrapper

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from pnfarm.links.base import Clock, Link, Port, PortSpec, Receiver
    from pnfarm.links.capture.files import BlockSink
    from pnfarm.wire.direction import Direction

__all__ = [
    "COMMENT", "ENHANCED_PACKET", "IF_NAME", "INTERFACE_DESCRIPTION", "INTERFACE_STATISTICS", "OPTION_END", "PcapLink",
    "PcapngWriter", "interface_description", "interface_statistics", "option", "packet_block", "section_header",
]  # fmt: skip

_SECTION_HEADER = 0x0A0D0D0A
INTERFACE_DESCRIPTION = 0x00000001
INTERFACE_STATISTICS = 0x00000005
ENHANCED_PACKET = 0x00000006
_BYTE_ORDER_MAGIC = 0x1A2B3C4D

OPTION_END = 0
COMMENT = 1
_SHB_USERAPPL = 4
IF_NAME = 2
_IF_DESCRIPTION = 3
_IF_MAC = 6
_IF_TSRESOL = 9
_EPB_FLAGS = 2
_ISB_IFRECV = 4
_ISB_OSDROP = 7
_ISB_USRDELIV = 8

_DIRECTION_BITS = {"in": 1, "out": 2}
_FLUSH_NS = 1_000_000_000


def option(code: int, value: bytes) -> bytes:
    """One option of a block, filled up to whole words."""
    return struct.pack("<HH", code, len(value)) + value + bytes(-len(value) % 4)


def _text(code: int, text: str) -> bytes:
    """A text option, empty for no text; an option's length has 16 bits."""
    return option(code, text.encode()[:0xFFFC]) if text else b""


def _block(kind: int, body: bytes) -> bytes:
    length = len(body) + 12
    return struct.pack("<II", kind, length) + body + struct.pack("<I", length)


def section_header(comment: str = "") -> bytes:
    """The block that begins a file; ``comment`` is shown by Wireshark and capinfos."""
    options = _text(COMMENT, comment) + option(_SHB_USERAPPL, b"pnfarm") + option(OPTION_END, b"")
    return _block(_SECTION_HEADER, struct.pack("<IHHq", _BYTE_ORDER_MAGIC, 1, 0, -1) + options)


def interface_description(name: str, description: str = "", mac: bytes = b"", *, link_type: int = ETHERNET) -> bytes:
    """An interface with nanosecond stamps; they are numbered in the order of their blocks."""
    options = _text(IF_NAME, name) + _text(_IF_DESCRIPTION, description)
    if mac:
        options += option(_IF_MAC, mac)
    options += option(_IF_TSRESOL, b"\x09") + option(OPTION_END, b"")
    return _block(INTERFACE_DESCRIPTION, struct.pack("<HHI", link_type, 0, 0) + options)


def packet_block(interface: int, frame: bytes, wall_ns: int, direction: Direction) -> bytes:
    """One frame; ``wall_ns`` since 1970."""
    head = struct.pack("<IIIII", interface, wall_ns >> 32, wall_ns & 0xFFFFFFFF, len(frame), len(frame))
    options = option(_EPB_FLAGS, struct.pack("<I", _DIRECTION_BITS[direction])) + option(OPTION_END, b"")
    return _block(ENHANCED_PACKET, head + frame + bytes(-len(frame) % 4) + options)


def interface_statistics(interface: int, wall_ns: int, *, written: int, lost: int | None = None) -> bytes:
    """Frame counts of an interface: ``written`` to the file, ``lost`` by the kernel (None: not known here)."""
    body = struct.pack("<III", interface, wall_ns >> 32, wall_ns & 0xFFFFFFFF)
    body += option(_ISB_IFRECV, struct.pack("<Q", written + (lost or 0)))
    if lost is not None:
        body += option(_ISB_OSDROP, struct.pack("<Q", lost))
    return _block(
        INTERFACE_STATISTICS,
        body + option(_ISB_USRDELIV, struct.pack("<Q", written)) + option(OPTION_END, b""),
    )


class PcapngWriter:
    """Writes one section, to ``path`` or ``sink``.  Stamps are nanoseconds since 1970.

    The file is flushed at most once a second of recorded time, so a killed run loses the last second.
    Raises :class:`~pnfarm.errors.EnvironmentError_` when the file cannot be written.
    """

    def __init__(self, path: Path | None, comment: str = "", *, sink: BlockSink | None = None) -> None:
        if path is None and sink is None:
            raise InternalError("a capture needs a file or a sink")
        self._path = path
        try:
            self._file: Any = sink if path is None else path.open("wb")
        except OSError as exc:
            raise EnvironmentError_(f"capture {path} cannot be written: {exc.strerror}") from exc
        self._interfaces = 0
        self._flushed_ns = 0
        self._write(section_header(comment))

    def add_interface(self, name: str, description: str = "", mac: bytes = b"", *, link_type: int = ETHERNET) -> int:
        """Describe an interface; the number to write its frames with."""
        self._write(interface_description(name, description, mac, link_type=link_type))
        self._interfaces += 1
        return self._interfaces - 1

    def write(self, interface: int, frame: bytes, wall_ns: int, direction: Direction) -> None:
        """Append one frame."""
        due = wall_ns - self._flushed_ns > _FLUSH_NS
        if due:
            self._flushed_ns = wall_ns
        self._write(packet_block(interface, frame, wall_ns, direction), flush=due)

    def _write(self, block: bytes, *, flush: bool = False) -> None:
        try:
            self._file.write(block)
            if flush:
                self._file.flush()
        except OSError as exc:
            raise EnvironmentError_(f"capture {self._path} cannot be written: {exc.strerror}") from exc

    def close(self) -> None:
        self._file.close()


class PcapLink(LinkWrapper):
    """Wraps ``inner`` and records to ``path``, or to ``sink``.

    ``clock`` is the farm's; ``epoch_ns`` is the date of its zero (default: such that the clock's now is the present
    time). When the disk is full, recording ends, ``failed`` says why, and the frames still pass.
    """

    def __init__(
        self,
        inner: Link,
        path: Path | None,
        *,
        clock: Clock,
        epoch_ns: int | None = None,
        comment: str = "",
        sink: BlockSink | None = None,
    ) -> None:
        super().__init__(inner)
        self._clock = clock
        self._epoch_ns = time.time_ns() - clock() if epoch_ns is None else epoch_ns
        self._writer: PcapngWriter | None = PcapngWriter(path, comment, sink=sink)
        self._interfaces: dict[int, int] = {}
        self._receiver: Receiver | None = None
        self.failed: EnvironmentError_ | None = None
        inner.set_receiver(self._receive)

    def record(self, port_index: int, frame: bytes, now: int, direction: Direction) -> None:
        """Record a frame that did not pass here (the engine's).  Frames of unknown ports are left out."""
        interface = self._interfaces.get(port_index)
        if self._writer is None or interface is None:
            return
        try:
            self._writer.write(interface, frame, now + self._epoch_ns, direction)
        except EnvironmentError_ as exc:
            self.failed = exc
            self._end()

    def _end(self) -> None:
        writer, self._writer = self._writer, None
        if writer is not None:
            try:
                writer.close()
            except EnvironmentError_ as exc:
                self.failed = exc
            except OSError as exc:
                self.failed = EnvironmentError_(f"the end of the capture could not be written: {exc.strerror}")

    # -- the link

    async def open(self, wanted: Sequence[PortSpec]) -> list[Port]:
        ports = await self.inner.open(wanted)
        if self._writer is not None:
            for spec, port in zip(wanted, ports, strict=True):
                self._interfaces[port.index] = self._writer.add_interface(
                    spec.station, port.name, port.mac, link_type=spec.link_type
                )
        return ports

    async def close(self) -> None:
        try:
            await self.inner.close()
        finally:
            self._end()

    def send(self, port_index: int, frame: bytes) -> None:
        self.record(port_index, frame, self._clock(), "out")
        self.inner.send(port_index, frame)

    def _receive(self, port_index: int, frame: bytes, now: int) -> None:
        self.record(port_index, frame, now, "in")
        if self._receiver is not None:
            self._receiver(port_index, frame, now)

    def set_receiver(self, receiver: Receiver) -> None:
        self._receiver = receiver
