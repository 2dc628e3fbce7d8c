"""The frames of a capture file, one after the other: pcap and pcapng, plain or gzip, read by scapy."""

from __future__ import annotations

import gzip
import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

__all__ = ["CapturedFrame", "FrameReader"]

_LINKTYPE_ETHERNET = 1
_MAGICS = {
    bytes.fromhex("a1b2c3d4"), bytes.fromhex("d4c3b2a1"), bytes.fromhex("a1b23c4d"), bytes.fromhex("4d3cb2a1"),
    bytes.fromhex("0a0d0d0a"),
}  # fmt: skip
_GZIP = b"\x1f\x8b"


@dataclass(frozen=True, slots=True)
class CapturedFrame:
    """``time_ns`` since 1970; ``direction`` 1 inbound, 2 outbound, None unknown; ``cut`` octets are missing."""

    number: int
    time_ns: int
    data: bytes
    interface: str | None = None
    direction: int | None = None
    cut: int = 0


class _Complaints(logging.Handler):
    """What scapy says of a file; it stops at what it cannot read and tells it by a warning only."""

    def __init__(self) -> None:
        super().__init__()
        self.last: str | None = None

    def emit(self, record: logging.LogRecord) -> None:
        self.last = record.getMessage()


class FrameReader:
    """Iterate over it; holds one frame at a time.

    Raises :class:`~pnfarm.errors.ConfigError` for a file that is not there or is no capture of Ethernet frames.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        #: What was wrong with the file's end, once it is reached.
        self.complaint: str | None = None
        #: Packets that are no Ethernet frames.
        self.foreign = 0
        self.frames = 0
        self._check()

    def _check(self) -> None:
        try:
            with self._path.open("rb") as file:
                magic = file.read(4)
            if magic[:2] == _GZIP:
                with gzip.open(self._path) as file:
                    magic = file.read(4)
        except (OSError, EOFError) as exc:
            why = getattr(exc, "strerror", None) or str(exc)
            raise ConfigError(f"{self._path} cannot be read: {why}") from exc
        if magic not in _MAGICS:
            raise ConfigError(f"{self._path} is no capture: give a pcap or pcapng file")

    def __iter__(self) -> Iterator[CapturedFrame]:
        from scapy.error import Scapy_Exception  # noqa: PLC0415 - half a second, for whoever reads a capture
        from scapy.utils import RawPcapReader  # noqa: PLC0415 - the same

        logger = logging.getLogger("scapy.runtime")
        complaints = _Complaints()
        kept = logger.propagate, list(logger.handlers)
        logger.propagate, logger.handlers = False, [complaints]
        try:
            try:
                reader: Any = RawPcapReader(str(self._path))
            except (Scapy_Exception, OSError, EOFError) as exc:
                raise ConfigError(f"{self._path} is no capture: {str(exc).strip(' !')}") from exc
            with reader:
                yield from self._packets(reader)
        finally:
            logger.propagate, logger.handlers = kept
        if complaints.last is not None and self.complaint is None:
            self.complaint = complaints.last
        if self.foreign and not self.frames:
            raise ConfigError(f"{self._path} holds no Ethernet frames: capture at an interface, not at `any`")

    def _packets(self, reader: Any) -> Iterator[CapturedFrame]:
        read = reader._read_packet  # noqa: SLF001 - the way to a packet's octets and meta data without dissection
        classic = not hasattr(reader, "interfaces")
        if classic and reader.linktype != _LINKTYPE_ETHERNET:
            raise ConfigError(
                f"{self._path} holds frames of link type {reader.linktype}, not of Ethernet ({_LINKTYPE_ETHERNET}): "
                "capture at an interface, not at `any`"
            )
        unit = 1 if classic and reader.nano else 1000
        while True:
            try:
                data, meta = read()
                if classic:
                    time_ns, name, direction = meta.sec * 1_000_000_000 + meta.usec * unit, None, None
                else:
                    if meta.linktype != _LINKTYPE_ETHERNET:
                        self.foreign += 1
                        continue
                    ticks = (meta.tshigh or 0) << 32 | (meta.tslow or 0)
                    time_ns = ticks * 1_000_000_000 // int(meta.tsresol)
                    name, direction = meta.ifname, meta.direction
                    if isinstance(name, bytes):
                        name = name.decode("utf-8", "replace")
            except EOFError as exc:
                self.complaint = str(exc) or None
                return
            except Exception as exc:  # noqa: BLE001 - scapy raises whatever its parsing of any octets meets
                self.complaint = f"{type(exc).__name__}: {exc}"
                return
            self.frames += 1
            yield CapturedFrame(
                self.frames, time_ns, bytes(data), name, direction, max(0, int(meta.wirelen) - len(data))
            )
