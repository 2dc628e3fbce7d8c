"""The part of a capture around each case that did not pass, out of a pcapng file of :mod:`pnfarm.links.pcap`.

All windows go into one file, so that one reader shows a connection that was lost in one and found again in the next.
The first frame of each has a comment that names the failure (``pkt_comment`` in Wireshark).
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, BinaryIO

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

__all__ = ["Window", "failure_windows", "slice_capture"]

# pcapng: types of blocks, codes of options
_INTERFACE_DESCRIPTION = 0x00000001
_INTERFACE_STATISTICS = 0x00000005
_ENHANCED_PACKET = 0x00000006
_OPTION_END, _COMMENT, _IF_NAME = 0, 1, 2
#: Time before the step and behind its end that belongs to the slice, seconds.
BEFORE = 1.0
BEHIND = 0.5
#: Largest block; the writers make far smaller ones.
MAX_BLOCK = 1 << 24
#: Octets of a block in front of a packet's data.
_PACKET_HEAD = 28


@dataclass(frozen=True, slots=True)
class Window:
    """Stamps in ns; ``drives`` None means all."""

    begin_ns: int
    end_ns: int
    drives: frozenset[str] | None
    text: str


def failure_windows(record: Mapping[str, Any], epoch_ns: int) -> list[Window]:
    """For each case that failed, is inconclusive or an error; ``epoch_ns``: the stamp at which the run began."""
    return [
        Window(
            epoch_ns + round((case["began_seconds"] - BEFORE) * 1e9),
            epoch_ns + round((case["ended_seconds"] + BEHIND) * 1e9),
            frozenset(case["drives"]) or None,
            f"{case['verdict']}: {case['name']} (line {case['line']}): {case['message']}",
        )
        for case in record["cases"]
        if case["verdict"] in {"failed", "inconclusive", "error"}
    ]


def slice_capture(source: Path, target: Path, windows: Sequence[Window]) -> int:
    """Copy the packets inside of ``windows``, and the blocks that describe them; how many packets."""
    count = 0
    waiting = sorted(windows, key=lambda window: window.begin_ns)
    open_: list[Window] = []
    untold: list[Window] = []
    drives: list[str] = []
    with source.open("rb") as inside, target.open("wb") as out:
        for kind, block in _blocks(inside):
            if kind == _INTERFACE_STATISTICS:
                # they count the whole capture
                continue
            if kind == _INTERFACE_DESCRIPTION:
                drives.append(_interface_name(block))
            if kind != _ENHANCED_PACKET:
                out.write(block)
                continue
            interface, high, low = struct.unpack_from("<III", block, 8)
            stamp = high << 32 | low
            while waiting and waiting[0].begin_ns <= stamp:
                open_.append(waiting[0])
                untold.append(waiting.pop(0))
            open_ = [window for window in open_ if stamp <= window.end_ns]
            drive = drives[interface] if interface < len(drives) else ""
            here = [window for window in open_ if window.drives is None or drive in window.drives]
            if here:
                out.write(_with_comments(block, [window.text for window in here if window in untold]))
                untold = [window for window in untold if window not in here]
                count += 1
    return count


def _interface_name(block: bytes) -> str:
    return next((value.decode("utf-8", "replace") for code, value in _options(block, 16) if code == _IF_NAME), "")


def _options(block: bytes, start: int) -> Iterator[tuple[int, bytes]]:
    end = len(block) - 4
    while start + 4 <= end:
        code, length = struct.unpack_from("<HH", block, start)
        if code == _OPTION_END:
            return
        yield code, block[start + 4 : start + 4 + length]
        start += 4 + length + -length % 4


def _with_comments(block: bytes, comments: Sequence[str]) -> bytes:
    """A packet with comments in front of its other options."""
    if not comments:
        return block
    captured = struct.unpack_from("<I", block, 20)[0]
    at = _PACKET_HEAD + captured + -captured % 4
    new = b"".join(_option(_COMMENT, text.encode()[:1000]) for text in comments)
    rest = block[at:-4] or _option(_OPTION_END, b"")
    length = at + len(new) + len(rest) + 4
    return block[:4] + struct.pack("<I", length) + block[8:at] + new + rest + struct.pack("<I", length)


def _option(code: int, value: bytes) -> bytes:
    return struct.pack("<HH", code, len(value)) + value + bytes(-len(value) % 4)


def _blocks(file: BinaryIO) -> Iterator[tuple[int, bytes]]:
    while len(head := file.read(8)) == 8:
        kind, length = struct.unpack("<II", head)
        if not 12 <= length <= MAX_BLOCK:
            return
        rest = file.read(length - 8)
        if len(rest) < length - 8:
            return
        yield kind, head + rest
