"""The part of a capture around each case that did not pass, out of a pcapng file of :mod:`pnfarm.links.pcap`."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any, BinaryIO

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

__all__ = ["failure_windows", "slice_capture"]

_ENHANCED_PACKET = 0x00000006
#: Time before the step and behind its end that belongs to the slice, seconds.
BEFORE = 1.0
BEHIND = 0.5
#: Largest block; the writers make far smaller ones.
MAX_BLOCK = 1 << 24


def failure_windows(record: Mapping[str, Any]) -> list[tuple[float, float]]:
    """Begin and end in seconds of the run, for each case that failed or is inconclusive."""
    return [
        (case["began_seconds"] - BEFORE, case["ended_seconds"] + BEHIND)
        for case in record["cases"]
        if case["verdict"] in {"failed", "inconclusive", "error"}
    ]


def slice_capture(source: Path, target: Path, windows: Sequence[tuple[int, int]]) -> int:
    """Copy the packets inside of ``windows`` (stamps, ns), and all blocks that are no packets; how many packets."""
    count = 0
    with source.open("rb") as inside, target.open("wb") as out:
        for kind, block in _blocks(inside):
            if kind == _ENHANCED_PACKET:
                high, low = struct.unpack_from("<II", block, 12)
                stamp = high << 32 | low
                if not any(begin <= stamp <= end for begin, end in windows):
                    continue
                count += 1
            out.write(block)
    return count


def _blocks(file: BinaryIO) -> Iterator[tuple[int, bytes]]:
    while len(head := file.read(8)) == 8:
        kind, length = struct.unpack("<II", head)
        if not 12 <= length <= MAX_BLOCK:
            return
        rest = file.read(length - 8)
        if len(rest) < length - 8:
            return
        yield kind, head + rest
