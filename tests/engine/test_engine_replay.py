"""The firmware's steps end alike, compiled and interpreted; and the replay that says so tells a difference."""

import os
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from plain_record import octets, plain
from stepping import STEP, pass_time

from pnfarm.firmware.axis import AXIS
from pnfarm.table.image import IMAGE

ROOT = Path(__file__).resolve().parents[2]
#: The tests of the firmware step drives often.
ENOUGH = 5000


def inner(*arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """One more Python under other settings."""
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=ROOT,
        env={**os.environ, **variables},
        capture_output=True,
        text=True,
        timeout=900,
        check=False,
    )


def replay(folder: Path) -> subprocess.CompletedProcess[str]:
    return inner("tests/support/replay.py", str(folder), NUMBA_DISABLE_JIT="1")


@pytest.fixture
def kept(tmp_path) -> Path:
    """Steps that the run of the whole suite kept; where there is no such run, those of one of its own."""
    outer = Path(os.environ.get("PNFARM_STEPS") or tmp_path)
    if sum(file.stat().st_size for file in outer.iterdir()) > ENOUGH * STEP.itemsize:
        return outer
    folder = tmp_path / "steps"
    folder.mkdir()
    run = inner(
        "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-m", "not slow", "tests/firmware",
        PNFARM_STEPS=str(folder),
    )  # fmt: skip
    assert run.returncode == 0, run.stdout[-3000:]
    return folder


@pytest.mark.slow
def test_each_kept_step_of_the_firmwares_tests_ends_alike_interpreted_to_the_last_octet(kept):
    run = replay(kept)
    assert run.returncode == 0, run.stdout[-3000:] + run.stderr[-1000:]
    assert int(run.stdout.split()[0]) > ENOUGH


def some_steps(count: int) -> np.ndarray:
    """Steps of a drive that turns, as :mod:`stepping` keeps them."""
    from bench_axis import BenchAxis

    bench = BenchAxis()
    bench.enable(600.0)
    steps = np.zeros(count, STEP)
    for step in steps:
        step["axis"], step["image"] = bench.axes[0], bench.images[0]
        bench.now = pass_time(bench.axes, bench.images, bench.now, 1_000_000, 1, 0, 0)
        step["now"], step["axis_after"], step["image_after"] = bench.now, bench.axes[0], bench.images[0]
    return steps


def test_a_field_that_came_out_otherwise_is_told_whatever_it_is(tmp_path):
    steps = some_steps(9)
    steps[0]["axis_after"]["motor"]["velocity"] += 1e-6
    steps[1]["axis_after"]["drive"]["state"] += 1
    steps[2]["axis_after"]["faults"]["code"][7] = 702
    steps[3]["axis_after"]["last_ns"] -= 1
    steps[4]["image_after"]["sent"][1] ^= 1
    steps[5]["image"]["received"][0] ^= 0x0001
    steps.tofile(tmp_path / "one.steps")
    run = replay(tmp_path)
    assert run.returncode == 1, run.stdout + run.stderr
    told = run.stdout.splitlines()
    assert told[0].startswith("9 steps")
    for number, field in enumerate(
        (
            "axis.motor.velocity:",
            "axis.drive.state:",
            "axis.faults.code:",
            "axis.last_ns:",
            "image.sent:",
            "axis.profidrive.stw1:",
        )
    ):
        assert any(f"step {number}: {field}" in line for line in told), field
    assert not any(f"step {number}:" in line for line in told for number in (6, 7, 8))


@pytest.mark.parametrize("layout", [AXIS, IMAGE], ids=lambda layout: layout.name)
def test_a_record_read_and_made_again_has_the_octets_that_it_had(layout):
    random = np.random.default_rng(5)
    rows = layout.allocate(1)
    for name in rows.dtype.names:
        wild = random.integers(0, 256, rows[name].nbytes, dtype=np.uint8)
        rows[name] = wild.view(rows[name].dtype).reshape(rows[name].shape)
    assert octets(plain(rows[0]), rows.dtype) == rows.tobytes()


NESTED = np.dtype(
    [
        ("flag", "u1"), ("count", "i4"), ("inner", np.dtype([("speed", "f8"), ("few", "u2", (3,))], align=True)),
        ("rows", np.dtype([("on", "u1"), ("place", "i8")], align=True), (2,)),
    ],
    align=True,
)  # fmt: skip


def test_records_within_records_are_objects_with_attributes_all_the_way():
    rows = np.zeros(1, NESTED)
    stand_in = plain(rows[0])
    stand_in.inner.speed = 2.5
    stand_in.inner.few[:] = 7
    stand_in.rows[1].place = -3
    rows["inner"]["speed"], rows["inner"]["few"] = 2.5, 7
    rows["rows"]["place"][0, 1] = -3
    assert octets(stand_in, NESTED) == rows.tobytes()


@pytest.mark.parametrize(
    ("field", "value"), [("flag", 256), ("flag", -1), ("count", 2**31), ("count", 1.5), ("strange", 0)]
)
def test_what_the_record_does_not_hold_is_an_error_and_never_cut_to_fit(field, value):
    stand_in = plain(np.zeros(1, NESTED)[0])
    setattr(stand_in, field, value)
    with pytest.raises((AttributeError, struct.error)):
        octets(stand_in, NESTED)
