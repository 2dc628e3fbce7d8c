"""The part of a capture around each case that did not pass, out of a pcapng file of :mod:`pnfarm.links.capture.pcap`.

All windows go into one file, so that one reader shows a connection that was lost in one and found again in the next.
The first frame of each has a comment that names the failure (``pkt_comment`` in Wireshark).
"""

from __future__ import annotations

import bisect
import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, BinaryIO

from pnfarm.links.capture import pcap

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence
    from pathlib import Path

    from pnfarm.scenario.definition.steps import Step
    from pnfarm.scenario.report.frame_ring import FrameRing
    from pnfarm.scenario.report.record import Case
    from pnfarm.scenario.run import Tell

__all__ = ["LONGEST", "Window", "failure_windows", "keep_failures", "slice_capture"]

#: Time before the step and after its end that belongs to the slice, seconds.
BEFORE = 1.0
BEHIND = 0.5
#: Most time of a step that belongs to it: its last part, where it failed.
LONGEST = 30.0
#: Verdicts whose frames are kept.
_BAD = frozenset({"failed", "inconclusive", "error"})
#: The clocks of the run and of the stamps may drift by this much in a run.
SLACK_NS = 100_000_000
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
            epoch_ns + round((max(case["began_seconds"], case["ended_seconds"] - LONGEST) - BEFORE) * 1e9),
            epoch_ns + round((case["ended_seconds"] + BEHIND) * 1e9),
            frozenset(case["drives"]) or None,
            f"{case['verdict']}: {case['name']} (line {case['line']}): {case['message']}",
        )
        for case in record["cases"]
        if case["verdict"] in _BAD
    ]


def keep_failures(tell: Tell, ring: FrameRing, wall: Callable[[], int] | None) -> Tell:
    """``tell``, which also keeps the frames around each case that did not pass.

    ``wall``: the time of the frames' stamps, where it is not the run's own.
    """

    def told(step: Step, case: Case | None) -> None:
        if case is not None and case.verdict.value in _BAD:
            end = case.ended_ns if wall is None else wall()
            took = min(case.ended_ns - case.began_ns, round(LONGEST * 1e9))
            ring.want(end - took - round(BEFORE * 1e9) - SLACK_NS, end + round(BEHIND * 1e9) + SLACK_NS)
        tell(step, case)

    return told


def slice_capture(source: Path, target: Path, windows: Sequence[Window]) -> int:
    """Copy the packets inside of ``windows``, and the blocks that describe them; how many packets.

    They are one more section of ``target``.  Packets need not be in the order of their stamps.
    """
    count = 0
    # between two of these stamps the open windows are the same
    bounds = sorted({stamp for window in windows for stamp in (window.begin_ns, window.end_ns + 1)})
    open_: dict[int, list[Window]] = {}
    untold = list(windows)
    drives: list[str] = []
    with source.open("rb") as inside, target.open("ab") as out:
        for kind, block in _blocks(inside):
            if kind == pcap.INTERFACE_STATISTICS:
                # they count the whole capture
                continue
            if kind == pcap.INTERFACE_DESCRIPTION:
                drives.append(_interface_name(block))
            if kind != pcap.ENHANCED_PACKET:
                out.write(block)
                continue
            interface, high, low = struct.unpack_from("<III", block, 8)
            stamp = high << 32 | low
            place = bisect.bisect_right(bounds, stamp)
            if place not in open_:
                open_[place] = [window for window in windows if window.begin_ns <= stamp <= window.end_ns]
            drive = drives[interface] if interface < len(drives) else ""
            here = [window for window in open_[place] if window.drives is None or drive in window.drives]
            if here:
                out.write(_with_comments(block, [window.text for window in here if window in untold]))
                untold = [window for window in untold if window not in here]
                count += 1
    return count


def _interface_name(block: bytes) -> str:
    return next((value.decode("utf-8", "replace") for code, value in _options(block, 16) if code == pcap.IF_NAME), "")


def _options(block: bytes, start: int) -> Iterator[tuple[int, bytes]]:
    end = len(block) - 4
    while start + 4 <= end:
        code, length = struct.unpack_from("<HH", block, start)
        if code == pcap.OPTION_END:
            return
        yield code, block[start + 4 : start + 4 + length]
        start += 4 + length + -length % 4


def _with_comments(block: bytes, comments: Sequence[str]) -> bytes:
    """A packet with comments in front of its other options."""
    if not comments:
        return block
    captured = struct.unpack_from("<I", block, 20)[0]
    at = _PACKET_HEAD + captured + -captured % 4
    new = b"".join(pcap.option(pcap.COMMENT, text.encode()[:1000]) for text in comments)
    rest = block[at:-4] or pcap.option(pcap.OPTION_END, b"")
    length = at + len(new) + len(rest) + 4
    return block[:4] + struct.pack("<I", length) + block[8:at] + new + rest + struct.pack("<I", length)


def _blocks(file: BinaryIO) -> Iterator[tuple[int, bytes]]:
    while len(head := file.read(8)) == 8:
        kind, length = struct.unpack("<II", head)
        if not 12 <= length <= MAX_BLOCK:
            return
        rest = file.read(length - 8)
        if len(rest) < length - 8:
            return
        yield kind, head + rest
