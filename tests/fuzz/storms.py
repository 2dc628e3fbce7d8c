"""``python -m tests.fuzz --storms``: storms of random faults on farms in virtual time, each with a reset at its end.

An *episode* is a fresh farm of one model with its controller; a seed and an episode's number make the same one again.
After each reset every drive must be back and run in time, and nothing of the faults may be left.
"""

# ruff: noqa: T201 - what it prints is its answer

from __future__ import annotations

import argparse
import sys
import time
import traceback
from random import Random

from storm import LINES, back, left_behind, line_of, storm

from tests.fuzz.watch import FailureFoundError

__all__ = ["main"]

#: Drives of a farm, faults of a storm, and the most seconds from one to the next.
DRIVES, FAULTS, GAPS = (1, 2, 4, 8, 16, 32), (20, 60, 200), (0.002, 0.02, 0.05, 0.2, 1.0)


def episode(rng: Random) -> str:
    """One farm, some storms; what it was."""
    model, drives, gap, storms = rng.choice(list(LINES)), rng.choice(DRIVES), rng.choice(GAPS), rng.randrange(1, 4)
    line = line_of(model, drives)
    for _ in range(storms):
        storm(line, rng.randrange(1 << 30), rng.choice(FAULTS), gap)
        back(line)
        left = left_behind(line)
        if left:
            raise FailureFoundError(f"{model}, {drives} drives: {left}")
    return f"{model}, {drives} drives, {storms} storms of faults at most {gap:g} s apart"


def main(options: argparse.Namespace) -> int:
    began, number = time.monotonic(), options.episode or 0
    while True:
        try:
            told = episode(Random(f"{options.seed}/storm/{number}"))
        except (AssertionError, FailureFoundError):
            traceback.print_exc()
            again = f"python -m tests.fuzz --storms --seed {options.seed} --episode {number}"
            print(f"episode {number} failed; again: {again}", file=sys.stderr)
            return 1
        print(f"episode {number}: {told}; every drive is back", flush=True)
        number += 1
        if options.episode is not None or time.monotonic() - began > options.minutes * 60:
            return 0
