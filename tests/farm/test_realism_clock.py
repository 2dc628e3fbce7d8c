"""A drive whose clock drifts against the controller's: its frames slide, its times and its sign of life go with it."""

from __future__ import annotations

from itertools import pairwise

import pytest
from virtual_line import VirtualLine

from pnfarm.table.signals import ZSW2

#: Model, its telegram of speed, a cycle in ms.
MODELS = [
    ("akd-profinet", 1, 16),
    ("akd-profinet-2012", 1, 8),
    ("hiwin-e1", 3, 1),
    ("moog-msd", 2, 1),
]


def line_of(drift: str, model: str = "akd-profinet", telegram: int = 1, cycle: int = 16, **options) -> VirtualLine:
    realism = f"{{clock_drift: {drift}}}"
    return VirtualLine(model=model, telegram=telegram, cycle=f"{cycle}ms", realism=realism, **options)


def sent(line: VirtualLine, seconds: float) -> list[tuple[int, bytes]]:
    """The drive's cyclic frames with their times, ns."""
    found: list[tuple[int, bytes]] = []

    def seen(port: int, frame: bytes, now: int, direction: str) -> None:
        del port
        if direction == "out":
            found.append((now, frame))

    line.world.watch(seen)
    line.run(seconds)
    return found


@pytest.mark.parametrize("ppm", [-1000, 0, 37])
@pytest.mark.parametrize(("model", "telegram", "cycle"), MODELS)
def test_the_drives_frames_slide_at_its_own_rate(model, telegram, cycle, ppm):
    line = line_of(str(ppm), model, telegram, cycle)
    line.connect()
    frames = sent(line, 100 * cycle / 1000.0)
    times = [now for now, _ in frames]
    spent = times[-1] - times[0]
    cycles = len(times) - 1
    assert cycles >= 98
    # to the nanosecond, over all of them
    assert spent == pytest.approx(cycles * cycle * 1e6 / (1.0 + ppm * 1e-6), abs=2.0)
    # its cycle counter counts on by the cycle, whatever the time
    counters = [int.from_bytes(frame[-4:-2], "big") for _, frame in frames]
    steps = {(after - before) & 0xFFFF for before, after in pairwise(counters)}
    assert steps == {cycle * 32}
    grid = {(now - times[0]) % (cycle * 1_000_000) for now in times}
    assert (len(grid) == 1) == (ppm == 0)


@pytest.mark.parametrize("ppm", [-1000, 1000])
@pytest.mark.parametrize(("model", "telegram", "cycle"), MODELS)
def test_a_connection_survives_many_slips_of_the_clock(model, telegram, cycle, ppm):
    line = line_of(str(ppm), model, telegram, cycle)
    line.enable()
    # ten cycles' worth of sliding, at least
    line.run(max(20.0, 10 * cycle))
    assert line.plc.all_running, line.reasons()
    assert line.events("axis-01").count("ar established") == 1
    assert int(line.plc.columns.cpm[0].discarded.sum()) == 0
    assert int(line.farm.columns.cpm[0].discarded.sum()) == 0
    assert int(line.farm.columns.axis[0].faults.code[0]) == 0


def test_what_the_drive_does_in_its_own_second_it_does_in_that_time():
    """A fast clock measures a slow shaft: at 60 rpm by its own time the motor turns 1.001 times in a true second."""
    ways = {}
    for ppm in (-1000, 0, 1000):
        line = line_of(str(ppm))
        line.enable()
        line.run(1.0)
        begun = float(line.farm.columns.axis[0].motor.position)
        line.run(100.0)
        ways[ppm] = float(line.farm.columns.axis[0].motor.position) - begun
    assert ways[1000] / ways[0] == pytest.approx(1.001, abs=1e-4)
    assert ways[-1000] / ways[0] == pytest.approx(0.999, abs=1e-4)


@pytest.mark.parametrize("ppm", [-1000, 1000])
def test_the_data_hold_timer_is_the_drives(ppm):
    line = line_of(str(ppm))
    line.connect()
    held = int(line.farm.columns.cpm[0].hold_ns)
    assert held == round(48e6 / (1.0 + ppm * 1e-6))
    assert int(line.plc.columns.cpm[0].hold_ns) == 48_000_000, "the controller's is the controller's"


def test_the_drives_own_supervision_goes_by_its_clock():
    """Moog MSD, P-1283: a time of the drive's own without telegrams; seen by ticks of a millisecond."""
    found = {}
    for ppm in (-1000, 1000):
        line = line_of(str(ppm), "moog-msd", 1, 1, params="{P-1283: 60000}", watchdog=1900)
        line.enable()
        line.plc.columns.ppm["active"] = 0
        begun = line.world.now
        axis = line.farm.columns.axis[0]
        # neither the data hold timer nor the controller ends the connection before
        line.farm.columns.cpm["hold_ns"] = 10**12
        line.plc.columns.cpm["hold_ns"] = 10**12
        assert line.world.run(70.0, until=lambda axis=axis: int(axis.faults.code[0]) != 0)
        found[ppm] = (line.world.now - begun) / 1e9
    assert found[-1000] - found[1000] == pytest.approx(0.12, abs=0.01)


@pytest.mark.parametrize("ppm", [-1000, 1000])
@pytest.mark.parametrize(("model", "telegram"), [("hiwin-e1", 3), ("moog-msd", 2)])
def test_its_sign_of_life_counts_its_own_frames(model, telegram, ppm):
    line = line_of(str(ppm), model, telegram, 1)
    line.connect()
    line.run(0.1)
    (cr,) = [cr for ar in line.farm.axes[0].device.ars.values() for _, cr in ar.providers]
    row = line.farm.columns.ppm[0]
    place = int(next(row.word_offset[i] for i in range(row.words) if int(row.word_code[i]) == ZSW2 * 4))
    # at 1000 ppm a frame more, or less, than the controller sends in this time
    counts = [frame[place] >> 4 for _, frame in sent(line, 1.2)]
    assert cr.cycle_ns == 1_000_000
    assert {(after - before) % 15 for before, after in pairwise(counts)} == {1}


def test_durations_in_the_log_are_no_difference_of_two_clocks():
    line = line_of("1000", program="{kind: constant, speed_rpm: 60, acknowledge_after: 1s}")
    line.enable()
    # by now the drive's clock is a tenth of a second ahead
    line.run(100.0)
    line.farm.axes[0].raise_fault("F702", hold=False)
    line.run(3.0)
    entries = line.log.entries("axis-01")
    (cleared,) = [entry for entry in entries if entry.event == "fault acknowledged"]
    (raised,) = [entry for entry in entries if entry.event == "fault"]
    assert cleared.data["after_seconds"] == pytest.approx(1.05, abs=0.06)
    assert (cleared.now_ns - raised.now_ns) / 1e9 == pytest.approx(cleared.data["after_seconds"], abs=0.005)


def test_each_drive_of_a_range_has_its_own_drift_the_same_in_each_run():
    def drifts(seed: int) -> list[float]:
        line = VirtualLine(8, realism=f"{{clock_drift: [-50, 50], seed: {seed}}}", controller=False)
        return [float(drift) * 1e6 for drift in line.farm.columns.axis.clock.settings.drift[:8]]

    first = drifts(1)
    assert first == drifts(1)
    assert first != drifts(2)
    assert len(set(first)) == 8
    assert all(-50.0 <= drift <= 50.0 for drift in first)
    assert max(first) - min(first) > 20.0


@pytest.mark.parametrize(
    ("model", "cycle", "params"),
    [
        ("akd-profinet", 16, "{DRV.OPMODE: 2}"),
        ("akd-profinet-2012", 8, "{930: 2}"),
        ("hiwin-e1", 4, "{}"),
        ("moog-msd", 4, "{}"),
    ],
)
def test_positioning_works_as_before(model, cycle, params):
    line = VirtualLine(model=model, telegram=9, cycle=f"{cycle}ms", params=params, realism="{clock_drift: 300}",
                       program="{kind: positions, speed_rpm: 600, acceleration: 20000, targets: [2, -2]}")  # fmt: skip
    line.enable(20.0)
    axis = line.farm.columns.axis[0]
    places = []
    for _ in range(400):
        line.run(0.01)
        places.append(float(axis.motor.position) - float(axis.homing.origin))
    assert max(places) == pytest.approx(2.0, abs=0.01)
    assert min(places) == pytest.approx(-2.0, abs=0.01)
