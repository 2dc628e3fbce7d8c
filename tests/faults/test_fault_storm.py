"""Many faults at once, at random: after a reset every drive is back, and nothing of them is left."""

from __future__ import annotations

from random import Random

import pytest
from storm import add, back, every_kind, kept, left_behind, line_of, random_fault, storm

from pnfarm.faults.kind import InjectionKind


@pytest.mark.parametrize(
    ("model", "drives", "seed", "gap"),
    [
        ("akd-profinet", 16, 1, 0.02),
        ("hiwin-e1", 16, 2, 0.05),
        ("moog-msd", 16, 3, 0.05),
        ("akd-ethernetip", 8, 4, 0.05),
    ],
)
def test_two_hundred_random_faults_and_a_reset_leave_every_drive_back_in_time(
    model: str, drives: int, seed: int, gap: float
) -> None:
    line = line_of(model, drives)
    storm(line, seed, 200, gap)
    back(line)
    assert left_behind(line) == {}


def test_storm_after_storm_keeps_no_more_than_the_first_one() -> None:
    line = line_of("akd-profinet", 2)
    sizes = []
    for seed in range(3):
        storm(line, seed, 300, 0.01)
        back(line)
        assert left_behind(line) == {}
        line.run(60.0)  # what is due some time is over
        sizes.append(kept(line))
    assert sizes[1] == sizes[0]
    assert sizes[2] == sizes[0]


@pytest.mark.parametrize(("kind", "model"), every_kind())
def test_every_kind_of_injection_is_taken_back_whole(kind: InjectionKind, model: str) -> None:
    line = line_of(model, 1)
    faults = sorted(fault.number for fault in line.farm.axes[0].model.faults.values())
    rng = Random(kind.name)
    taken = 0
    # random parameters of a kind often exclude each other
    for _ in range(200):
        if taken == 6:
            break
        if not add(line, random_fault(rng, kind, "axis-01", faults)):
            continue
        taken += 1
        line.run(rng.uniform(0.1, 0.9))
        if taken % 3 == 0:
            back(line)
            assert left_behind(line) == {}
    assert taken == 6
    back(line)
    assert left_behind(line) == {}
