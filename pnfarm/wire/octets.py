"""Bounded reading and writing of octets.

The two classes under every codec.  A :class:`Reader` never reads beyond its window and raises
:class:`~pnfarm.errors.DecodeError` (reason ``short``) instead; it only moves forward, so that no
parser built on it can loop over the same byte.  Numbers are big-endian (network order) unless it is ``little``.
"""

from __future__ import annotations

import builtins
import struct
from functools import lru_cache
from typing import Any, Literal
from uuid import UUID

from pnfarm.errors import DecodeError

__all__ = ["Reader", "Writer", "pack", "uuid_of"]


def pack(layout: struct.Struct, *fields: int | builtins.bytes) -> builtins.bytes:
    """A header of fixed layout, at once; :class:`ValueError` when a field does not fit, as of :class:`Writer`."""
    try:
        return layout.pack(*fields)
    except struct.error as exc:
        raise ValueError(f"a field does not fit into its place in a header: {exc}") from exc


@lru_cache(1024)
def uuid_of(octets: builtins.bytes, *, little: bool) -> UUID:
    """Of 16 octets.  Those of interfaces, objects and activities come in each PDU of a call."""
    return UUID(bytes_le=octets) if little else UUID(bytes=octets)


class Reader:
    """A forward-only cursor over ``data[start:end]``."""

    __slots__ = ("_data", "_end", "_order", "_pos", "little")

    def __init__(self, data: builtins.bytes | bytearray | memoryview, little: bool = False) -> None:
        self._data = memoryview(data).cast("B") if not isinstance(data, memoryview) else data
        self.little = little
        self._order: Literal["little", "big"] = "little" if little else "big"
        self._pos = 0
        self._end = len(self._data)

    @property
    def remaining(self) -> int:
        """Number of octets not read yet."""
        return self._end - self._pos

    @property
    def position(self) -> int:
        """Octets read so far, for alignment relative to the start of this reader."""
        return self._pos

    def _take(self, count: int) -> int:
        start = self._pos
        if count < 0 or start + count > self._end:
            raise DecodeError("short", f"{count} octets needed, {self._end - start} left")
        self._pos = start + count
        return start

    def u8(self) -> int:
        return self._data[self._take(1)]

    def u16(self) -> int:
        return int.from_bytes(self._data[(p := self._take(2)) : p + 2], self._order)

    def u32(self) -> int:
        return int.from_bytes(self._data[(p := self._take(4)) : p + 4], self._order)

    def f32(self) -> float:
        (value,) = struct.unpack(">f", self._data[(p := self._take(4)) : p + 4])
        return float(value)

    def uuid(self) -> UUID:
        return uuid_of(self.bytes(16), little=self.little)

    def unpack(self, layout: struct.Struct) -> tuple[Any, ...]:
        """The next octets, of a fixed layout that has a byte order of its own."""
        return layout.unpack_from(self._data, self._take(layout.size))

    def bytes(self, count: int) -> builtins.bytes:
        """The next ``count`` octets."""
        start = self._take(count)
        return builtins.bytes(self._data[start : start + count])

    def rest(self) -> builtins.bytes:
        """All octets that are left."""
        return self.bytes(self.remaining)

    def skip(self, count: int) -> None:
        self._take(count)

    def align(self, width: int) -> None:
        """Skip padding up to the next multiple of ``width`` from this reader's start; a frame may end early."""
        self._take(min(-self._pos % width, self.remaining))

    def sub(self, count: int) -> Reader:
        """A reader over the next ``count`` octets alone; this one moves past them."""
        start = self._take(count)
        return Reader(self._data[start : start + count], self.little)

    def expect_end(self) -> None:
        """Raise ``trailing`` unless everything was read."""
        if self.remaining:
            raise DecodeError("trailing", f"{self.remaining} octets after the end")


class Writer:
    """Appends octets; values out of range raise :class:`ValueError`: a defect here, never of a peer's data."""

    __slots__ = ("_buf", "little")

    def __init__(self, little: bool = False) -> None:
        self._buf = bytearray()
        self.little = little

    def __len__(self) -> int:
        return len(self._buf)

    def _put(self, value: int, width: int) -> Writer:
        try:
            self._buf += value.to_bytes(width, "little" if self.little else "big")
        except OverflowError as exc:
            raise ValueError(f"{value} does not fit in {width} octets") from exc
        return self

    def u8(self, value: int) -> Writer:
        return self._put(value, 1)

    def u16(self, value: int) -> Writer:
        return self._put(value, 2)

    def u32(self, value: int) -> Writer:
        return self._put(value, 4)

    def f32(self, value: float) -> Writer:
        self._buf += struct.pack(">f", value)
        return self

    def bytes(self, data: builtins.bytes | bytearray | memoryview) -> Writer:
        self._buf += data
        return self

    def uuid(self, value: UUID) -> Writer:
        return self.bytes(value.bytes_le if self.little else value.bytes)

    def zeros(self, count: int) -> Writer:
        self._buf += builtins.bytes(count)
        return self

    def align(self, width: int) -> Writer:
        """Pad with zeros to the next multiple of ``width`` from this writer's start."""
        return self.zeros(-len(self._buf) % width)

    def getvalue(self) -> builtins.bytes:
        return builtins.bytes(self._buf)
