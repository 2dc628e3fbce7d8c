"""The frames of a capture file, one after the other: pcap and pcapng, plain or gzip, read by scapy."""

from __future__ import annotations

import contextlib
import gzip
import logging
import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, BinaryIO, cast

from pnfarm.errors import ConfigError
from pnfarm.links.base import ETHERNET

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator
    from pathlib import Path

__all__ = ["CapturedFrame", "FrameReader"]

_MAGICS = {
    bytes.fromhex("a1b2c3d4"), bytes.fromhex("d4c3b2a1"), bytes.fromhex("a1b23c4d"), bytes.fromhex("4d3cb2a1"),
    bytes.fromhex("0a0d0d0a"),
}  # fmt: skip
_GZIP = b"\x1f\x8b"


@dataclass(frozen=True, slots=True)
class CapturedFrame:
    """``time_ns`` since 1970; ``direction`` 1 inbound, 2 outbound, None unknown; ``cut`` octets are missing.

    ``link_type``: another one than that of Ethernet for telegrams of a line.
    """

    number: int
    time_ns: int
    data: bytes
    interface: str | None = None
    direction: int | None = None
    cut: int = 0
    link_type: int = ETHERNET


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Silence scapy's warnings about what it cannot read; the reader reports it itself."""
    logger = logging.getLogger("scapy.runtime")
    kept, logger.disabled = logger.disabled, True
    try:
        yield
    finally:
        logger.disabled = kept


def _number_anew(reader: Any) -> None:
    """Interfaces are numbered anew in each section of a file; scapy goes on with those before."""
    header = reader._read_block_shb  # noqa: SLF001 - scapy has no public one

    def section() -> None:
        reader.interfaces.clear()
        header()

    reader._read_block_shb = section  # noqa: SLF001 - nor one to be called at a section's begin


class _Unpacked(gzip.GzipFile):
    """A gzip file that also closes the file it reads from."""

    def __init__(self, packed: BinaryIO) -> None:
        super().__init__(fileobj=packed, mode="rb")
        self._packed = packed

    def close(self) -> None:
        super().close()
        self._packed.close()


class FrameReader:
    """Iterate over it; holds one frame at a time.

    ``link_types`` are those besides Ethernet's whose telegrams are read, too.
    Raises :class:`~pnfarm.errors.ConfigError` for a file that does not exist or is not a capture of Ethernet frames.
    """

    def __init__(self, path: Path, link_types: Collection[int] = ()) -> None:
        self._path = path
        self._link_types = {ETHERNET, *link_types}
        #: What is wrong with the file's end; set when it is reached.
        self.complaint: str | None = None
        #: Packets that are not Ethernet frames.
        self.foreign = 0
        self.frames = 0
        self._open().close()

    def _open(self) -> BinaryIO:
        """The file at its beginning, unpacked; raises :class:`~pnfarm.errors.ConfigError` where it is not a capture."""
        try:
            file: BinaryIO = self._path.open("rb")
            try:
                if file.read(2) == _GZIP:
                    file.seek(0)
                    file = cast("BinaryIO", _Unpacked(file))
                file.seek(0)
                magic = file.read(4)
                file.seek(0)
            except BaseException:
                file.close()
                raise
        except (OSError, EOFError, zlib.error) as exc:
            why = getattr(exc, "strerror", None) or str(exc)
            raise ConfigError(f"{self._path} cannot be read: {why}") from exc
        if magic not in _MAGICS:
            file.close()
            raise ConfigError(f"{self._path} is not a capture: give a pcap or pcapng file")
        return file

    def __iter__(self) -> Iterator[CapturedFrame]:
        from scapy.error import Scapy_Exception  # noqa: PLC0415 - half a second, for reading a capture alone
        from scapy.utils import RawPcapReader  # noqa: PLC0415 - the same

        with self._open() as file, _quiet():
            try:
                reader: Any = RawPcapReader(file)
            except (Scapy_Exception, OSError, EOFError, zlib.error) as exc:
                raise ConfigError(f"{self._path} is not a capture: {str(exc).strip(' !')}") from exc
            yield from self._packets(reader, file)
        if self.foreign and not self.frames:
            raise ConfigError(f"{self._path} holds no Ethernet frames: capture at an interface, not at `any`")

    def _packets(self, reader: Any, file: BinaryIO) -> Iterator[CapturedFrame]:
        classic = not hasattr(reader, "interfaces")
        # reads a packet's octets and meta data without dissection; one block at a time, to know where it ends
        read = reader._read_packet if classic else reader._read_block  # noqa: SLF001 - scapy has no public ones
        if classic and reader.linktype not in self._link_types:
            raise ConfigError(
                f"{self._path} holds frames of link type {reader.linktype}, not of Ethernet ({ETHERNET}): "
                "capture at an interface, not at `any`"
            )
        if not classic:
            _number_anew(reader)
        unit = 1 if classic and reader.nano else 1000
        while True:
            place = file.tell()
            try:
                found = read()
                if found is None:
                    continue  # a block that is not a packet
                data, meta = found
                if classic:
                    if meta.caplen > len(data):
                        self.complaint = f"{meta.caplen - len(data)} octets of its last packet are missing"
                    time_ns, name, direction = meta.sec * 1_000_000_000 + meta.usec * unit, None, None
                    link_type = int(reader.linktype)
                else:
                    if meta.linktype not in self._link_types:
                        self.foreign += 1
                        continue
                    ticks = (meta.tshigh or 0) << 32 | (meta.tslow or 0)
                    time_ns = ticks * 1_000_000_000 // int(meta.tsresol)
                    name, direction = meta.ifname, meta.direction
                    link_type = int(meta.linktype)
                    if isinstance(name, bytes):
                        name = name.decode("utf-8", "replace")
            except EOFError:
                if file.tell() != place:
                    self.complaint = f"the packet or block at octet {place} is incomplete"
                return
            except Exception as exc:  # noqa: BLE001 - scapy raises whatever its parsing of any octets meets
                self.complaint = f"{type(exc).__name__}: {exc}"
                return
            self.frames += 1
            cut = max(0, int(meta.wirelen) - len(data))
            # as Wireshark counts them
            number = self.frames + self.foreign
            yield CapturedFrame(number, time_ns, bytes(data), name, direction, cut, link_type)
