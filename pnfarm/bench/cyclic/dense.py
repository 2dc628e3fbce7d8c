"""The benchmark ``dense``: how many drives at 1 ms one core carries."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.bench.line import cores, expirations, farm_and_plc, lateness, measure, settled_floor
from pnfarm.bench.result import Result, Windows

if TYPE_CHECKING:
    from pnfarm.bench.load import Load

__all__ = ["dense"]

#: The fewest and the most drives that are tried, and how many more each time.  At 1 Gbit/s a port carries 1,488 frames
#: of the least length in a millisecond.
FEWEST, MOST, STEP = 256, 576, 64
#: Lateness of the drives over that of the minimal loop with as many.
LATEST = 1.5
#: Drives that are asked for, and the length of a trial, seconds.
GOAL, TRIAL_SECONDS = 384, 10.0


@dataclass(frozen=True, slots=True)
class _Trial:
    drives: int
    lost: int
    lateness: Windows
    floor: Windows
    used: Windows

    @property
    def holds(self) -> bool:
        return self.lost == 0 and self.lateness.over(self.floor) <= LATEST


def _tried(drives: int, seconds: float, load: Load) -> _Trial:
    low = settled_floor(drives, 1, 1_000_000, min(TRIAL_SECONDS, seconds), load)
    with farm_and_plc(drives, "1ms", 64) as (farm, plc):
        before = expirations(farm, plc)
        ours, _ = measure(farm, plc, seconds, load)
        lost = expirations(farm, plc) - before
    return _Trial(drives, lost, lateness(ours, 0.99), lateness(low, 0.99), cores(ours))


def dense(seconds: float, load: Load) -> list[Result]:
    """The most drives at 1 ms on one core that lose no connection and are no later than 1.5 of the minimal loop.

    Short trials find the number, then it is measured for the whole time.
    """
    trials = [_tried(FEWEST, min(TRIAL_SECONDS, seconds), load)]
    while trials[-1].holds and trials[-1].drives < MOST:
        trials.append(_tried(trials[-1].drives + STEP, min(TRIAL_SECONDS, seconds), load))
    drives = trials[-1].drives
    while not (found := _tried(drives, seconds, load)).holds and drives > STEP:
        drives -= STEP
    most = found.drives if found.holds else 0
    ratio = found.lateness.over(found.floor)
    return [
        Result("dense-drives", most, "drives at 1 ms on one core", None, f">= {GOAL}", most >= GOAL),
        found.lateness.row("dense-lateness-p99", "us", ratio),
        found.used.row("dense-cpu", "cores"),
        Result("dense-next-expirations", trials[-1].lost, f"of {trials[-1].drives} drives", None, "none", ok=True),
    ]
