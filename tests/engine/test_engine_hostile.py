"""Whatever arrives, the engine counts it and goes on."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from virtual_pair import ROWS, Pair

from pnfarm.engine.columns import RX_BATCH
from pnfarm.engine.tick import receive
from pnfarm.table.channel import FRAME_SLOT
from pnfarm.table.compiling.compiled import IS_COMPILED

ROOT = Path(__file__).resolve().parents[2]
#: What an inner run takes: all but the tests that start one, those in real time, which need the machine to themselves,
#: and one that reads sources, which is the same there.
PYTEST = (
    "-m",
    "pytest",
    "-q",
    "-x",
    "-p",
    "no:cacheprovider",
    "-m",
    "not slow and not exclusive",
    "-k",
    "not defined_once_in_the_project",
)


def test_random_and_mutated_frames_never_disturb_anything_but_counters():
    pair = Pair(drives=4, hold=64)
    pair.run(0.05)
    random = np.random.default_rng(8892)
    good = pair.controller.frames[0].copy()
    rounds = 100 if IS_COMPILED else 4
    for _ in range(rounds):
        frames = random.integers(0, 256, (RX_BATCH, FRAME_SLOT), dtype=np.uint8)
        frames[::2] = good
        for i in range(0, RX_BATCH, 2):
            for _ in range(random.integers(0, 4)):
                frames[i, random.integers(0, 64)] = random.integers(0, 256)
        pair.farm.rx_frames[:] = frames
        pair.farm.rx_length[:] = random.integers(-5, FRAME_SLOT + 50, RX_BATCH)
        pair.farm.rx_length[::4] = 64
        pair.farm.rx_port[:] = random.integers(-3, 8, RX_BATCH)
        pair.farm.rx_ns[:] = pair.now
        receive(pair.farm, RX_BATCH)
    engine = pair.farm.engine[0]
    assert engine.malformed > 0
    assert engine.unknown > 0
    pair.run(0.3)
    assert (pair.farm.axis.drive.state[:4] == 4).all()


if not IS_COMPILED:

    def test_interpreted_on_records_and_on_objects_in_their_place_a_run_comes_to_the_same_octets():
        pairs = [Pair(drives=2, hold=3, records=records) for records in (True, False)]
        for pair in pairs:
            pair.run(0.13)
            pair.controller.ppm[0].active = 0
            pair.run(0.02)
        on_records, on_objects = pairs
        assert on_objects.events == on_records.events
        assert on_records.seen("expired")
        for side in ("farm", "controller"):
            one, other = getattr(on_records, side), getattr(on_objects, side)
            for name in ROWS:
                assert getattr(other, name).tobytes() == getattr(one, name).tobytes(), f"{side} {name}"
            assert (other.frames == one.frames).all()


def inner(*arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """One more Python under other settings of the compiler."""
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=ROOT,
        env={**os.environ, "PNFARM_STEPS": "", **variables},
        capture_output=True,
        text=True,
        timeout=900,
        check=False,
    )


@pytest.mark.slow
def test_engine_and_firmware_behave_alike_with_bounds_checked():
    run = inner(*PYTEST, "tests/engine", "tests/firmware", NUMBA_BOUNDSCHECK="1")
    assert run.returncode == 0, run.stdout[-3000:]


@pytest.mark.slow
def test_engine_behaves_alike_interpreted():
    # the storm is three seconds of a whole farm and thousands of frames: nine minutes interpreted
    run = inner(*PYTEST, "tests/engine", "--ignore=tests/engine/test_engine_storm.py", NUMBA_DISABLE_JIT="1")
    assert run.returncode == 0, run.stdout[-3000:]
