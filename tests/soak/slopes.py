"""How fast something grows: a slope per hour with its 95 % interval, over the processes of all pieces of a soak.

Each process has a level of its own and one slope is common to all: least squares over the means of blocks of time, with
an intercept for each process, whose first minutes (what it fills at its start) are left out.  The interval allows for
what samples have in common with their neighbours, and, from five processes on, for slopes that differ from process to
process (cluster-robust variance, Liang and Zeger 1986).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import sqrt
from statistics import NormalDist, fmean
from typing import Any

from tests.soak.judge import Check

__all__ = ["BOUNDS", "MIB", "TOO_SHORT", "WARM_SECONDS", "Slope", "processes", "series", "slope", "slope_check"]

#: Left out of each process: 1,024 ended faults and a hub's 16,384 entries, which are kept, have come by then, and the
#: 1.7 MiB that a farm takes once, at one moment, behind 48 to 53 minutes; the time of which one mean is made.
WARM_SECONDS, BLOCK_SECONDS = 3600.0, 120.0
#: A process with fewer blocks says nothing of a slope; with fewer degrees of freedom there is no interval.
FEWEST_BLOCKS, FEWEST_FREE = 3, 4
#: From so many processes on, the differences between them say how far a slope can be trusted.
FEWEST_CLUSTERS = 5
MOST_CORRELATION = 0.9
TOO_SHORT = "too short to judge"
MIB = 1 << 20
#: Most growth an hour that is not a leak, its unit, and what one unit is.  1 MiB an hour fills 1 GiB in six weeks; one
#: more thread, file or task in half an hour, or five rows, is fewer than one in a hundred of a soak's actions.  16,000
#: blocks of the interpreter are that MiB: the list of the last 1,024 ended faults takes a shard hours to fill, with 42
#: blocks for each fault and its entries of the event log, some 12,000 blocks an hour.
BOUNDS: Mapping[str, tuple[float, str, float]] = {
    "rss": (1.0, "MiB", MIB),
    "own": (1.0, "MiB", MIB),
    "heap": (1.0, "MiB", MIB),
    "blocks": (16_000.0, "blocks", 1.0),
    "objects": (1_000.0, "objects", 1.0),
    "files": (2.0, "files", 1.0),
    "threads": (2.0, "threads", 1.0),
    "tasks": (2.0, "tasks", 1.0),
    "rows": (5.0, "rows", 1.0),
}


@dataclass(frozen=True, slots=True)
class Slope:
    """Per hour; ``half`` is half of the 95 % interval."""

    per_hour: float
    half: float
    processes: int
    blocks: int
    hours: float

    @property
    def low(self) -> float:
        return self.per_hour - self.half

    @property
    def high(self) -> float:
        return self.per_hour + self.half


def _means(points: Sequence[tuple[float, float]], warm: float, block: float) -> list[tuple[float, float]]:
    """The means of (seconds, value) in each whole block behind the warm-up."""
    if not points:
        return []
    begin, end = points[0][0] + warm, points[-1][0]
    found: defaultdict[int, list[tuple[float, float]]] = defaultdict(list)
    for at, value in points:
        if at >= begin:
            found[int((at - begin) // block)].append((at, value))
    return [
        (fmean(at for at, _ in part), fmean(value for _, value in part))
        for place, part in sorted(found.items())
        if begin + (place + 1) * block <= end
    ]


def _student(free: int) -> float:
    """The 97.5 % quantile of Student's t (Abramowitz and Stegun 26.7.5; within 1 % from 4 degrees of freedom on)."""
    z = NormalDist().inv_cdf(0.975)
    return (
        z
        + (z**3 + z) / (4 * free)
        + (5 * z**5 + 16 * z**3 + 3 * z) / (96 * free**2)
        + (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / (384 * free**3)
    )


def slope(
    runs: Iterable[Sequence[tuple[float, float]]], *, warm: float = WARM_SECONDS, block: float = BLOCK_SECONDS
) -> Slope | None:
    """Of a series of (seconds, value) for each process; None if there is too little to say anything."""
    found = [means for run in runs if len(means := _means(run, warm, block)) >= FEWEST_BLOCKS]
    blocks = sum(map(len, found))
    free = blocks - len(found) - 1
    if free < FEWEST_FREE:
        return None
    centred = []
    for means in found:
        middle, level = fmean(at for at, _ in means), fmean(value for _, value in means)
        centred.append([((at - middle) / 3600, value - level) for at, value in means])
    spread = sum(at * at for part in centred for at, _ in part)
    steep = sum(at * value for part in centred for at, value in part) / spread
    left = [[(at, value - steep * at) for at, value in part] for part in centred]
    squares = sum(value * value for part in left for _, value in part)
    # neighbours that lie on the same side: as if there were fewer of them
    together = sum(one * other for part in left for (_, one), (_, other) in pairwise(part))
    correlation = min(MOST_CORRELATION, max(0.0, together / squares)) if squares else 0.0
    half = _student(free) * sqrt(squares / free / spread * (1 + correlation) / (1 - correlation))
    count = len(found)
    if count >= FEWEST_CLUSTERS:
        scores = sum(sum(at * value for at, value in part) ** 2 for part in left)
        half = max(half, _student(count - 1) * sqrt(scores * count / (count - 1)) / spread)
    return Slope(steep, half, count, blocks, blocks * block / 3600)


def series(samples: Sequence[Mapping[str, Any]], name: str, what: str) -> list[list[tuple[float, float]]]:
    """Of one program of a piece: (seconds, value) for each process that it was, by its number."""
    found: defaultdict[int, list[tuple[float, float]]] = defaultdict(list)
    for sample in samples:
        if (value := sample.get(f"{name} {what}")) is not None:
            found[sample[f"{name} pid"]].append((sample["seconds"], float(value)))
    return list(found.values())


def processes(samples: Iterable[Mapping[str, Any]]) -> list[str]:
    """The names of the programs in samples."""
    return list(dict.fromkeys(key.removesuffix(" pid") for sample in samples for key in sample if key.endswith(" pid")))


def slope_check(name: str, what: str, found: Slope | None) -> Check:
    """Whether, with 95 % confidence, it grows no faster than its bound; not judged where the interval has both."""
    most, unit, one = BOUNDS[what]
    title = f"{name}: {what}"
    if found is None:
        return Check(title, ok=None, told=TOO_SHORT)
    told = (
        f"{found.per_hour / one:+.3g} {unit}/h, 95 % between {found.low / one:+.3g} and {found.high / one:+.3g},"
        f" {most:g} allowed; {found.processes} processes, {found.hours:.1f} h"
    )
    ok = True if found.high <= most * one else False if found.low > most * one else None
    return Check(title, ok=ok, told=told if ok is not None else f"{told}: {TOO_SHORT}")
