"""Position mode of every model, from the controller's program over real frames to the shaft, in virtual time."""

import pytest
from virtual_line import VirtualLine

from pnfarm.buses.profinet.controller.plan import plan_devices
from pnfarm.drives.catalogue import model
from pnfarm.errors import ConfigError
from pnfarm.farm.file.reading import expand, parse_farm
from pnfarm.farm.views.snapshot import drive_snapshot
from pnfarm.metrics import FarmCollector
from pnfarm.table.signals import AKTSATZ, POS_ZSW1, POS_ZSW2, SATZANW, ZSW1

MOVES = "{kind: positions, speed_rpm: 600, acceleration: 20000, targets: [%s], dwell: 50ms, acknowledge_after: 200ms}"

#: Model, telegram, cycle, parameters that put the drive into position mode.
EVERY = [
    ("akd-profinet", 9, "16ms", "{DRV.OPMODE: 2}"),
    ("akd-profinet", 353, "16ms", "{DRV.OPMODE: 2}"),
    ("akd-profinet", 400, "16ms", "{DRV.OPMODE: 2}"),
    ("akd-profinet-2012", 9, "8ms", "{930: 2}"),
    ("hiwin-e1", 9, "1ms", "{}"),
    ("hiwin-e1", 111, "2ms", "{}"),
    ("moog-msd", 9, "1ms", "{}"),
]


def line_of(name, telegram, cycle, params, targets="3, -2.5", **options):
    return VirtualLine(model=name, telegram=telegram, cycle=cycle, params=params, program=MOVES % targets, **options)


def moves(line, drive=0):
    return int(line.plc.columns.program[drive].moves)


def run_until(line, condition, seconds=20.0):
    """Virtual seconds until it holds, to a cycle or so."""
    begun = line.world.now
    assert line.world.run(seconds, until=condition, look_ns=1_000_000), line.reasons()
    return (line.world.now - begun) / 1e9


def place(line, drive=0):
    axis = line.farm.columns.axis[drive]
    return float(axis.motor.position) - float(axis.homing.origin)


@pytest.mark.parametrize(("name", "telegram", "cycle", "params"), EVERY)
def test_an_axis_is_homed_and_goes_from_target_to_target(name, telegram, cycle, params):
    line = line_of(name, telegram, cycle, params)
    line.enable()
    for count, target in enumerate((3.0, -2.5, 3.0), 1):
        run_until(line, lambda count=count: moves(line) == count)
        line.run(0.04)
        assert place(line) == pytest.approx(target, abs=0.01)
    assert line.farm.columns.axis[0].homing.homed


@pytest.mark.parametrize(("name", "telegram", "cycle", "params"), EVERY)
def test_a_move_takes_the_time_of_its_trapezoid_and_some_cycles(name, telegram, cycle, params):
    line = line_of(name, telegram, cycle, params, targets="20, 0")
    line.enable()
    run_until(line, lambda: moves(line) == 1)
    took = run_until(line, lambda: moves(line) == 2)
    # 20 rev at 10 rev/s with 333 rev/s^2, after a dwell; the drive's own units round velocity and ramps
    cycles = {"16ms": 0.016, "8ms": 0.008, "2ms": 0.002, "1ms": 0.001}[cycle]
    least = 0.05 + 2.0 + 10.0 / (20000 / 60)
    assert least * 0.98 <= took <= least * 1.05 + 8 * cycles + 0.1


def test_a_fault_in_a_move_ends_the_task_and_the_next_one_counts_from_the_present_position():
    line = line_of(*EVERY[5], targets="50, 0")
    line.enable()
    line.run(1.0)
    line.farm.axes[0].handle.push_command(1, 15)
    line.run(0.1)
    assert not line.plc.all_running
    line.enable()
    run_until(line, lambda: moves(line) == 1)
    line.run(0.04)
    assert place(line) == pytest.approx(50.0, abs=0.01)


def test_3_14_3_15_the_position_words_of_telegram_111():
    line = line_of(*EVERY[5], targets="50, 0")
    line.enable()
    line.run(2.0)
    image = line.plc.columns.image[0]
    assert int(image.received[POS_ZSW1]) == 0x8000
    assert int(image.received[POS_ZSW2]) == 0x8014, "set point, forwards, task active"
    run_until(line, lambda: moves(line) == 1)
    run_until(line, lambda: int(image.received[POS_ZSW2]) & 0x20)


def test_3_10_aktsatz_shows_the_mdi_submode():
    line = line_of(*EVERY[4])
    line.enable()
    line.run(0.5)
    assert int(line.plc.columns.image[0].received[AKTSATZ]) == 0x8000


def test_5_10_1_telegram_7_starts_motion_tasks_of_the_drive_over_frames():
    line = VirtualLine(telegram=7, params="{DRV.OPMODE: 2, HOME.MODE: 0}", program="{kind: constant, speed_rpm: 0}")
    line.enable()
    drive, plc = line.farm.axes[0], line.plc.columns
    for name, value in (("MT.NUM", 7), ("MT.P", 2 * 65536), ("MT.V", 600_000), ("MT.SET", 1)):
        drive.store.set(name, value)
    drive.store.set("HOME.MOVE", 1)
    plc.image[0].sent[SATZANW] = 7
    run_until(line, lambda: int(plc.image[0].received[ZSW1]) & 0x0800)
    # out of operation and back: STW1.6 rises with operation enabled only when the program sets it then
    drive.store.set("MT.MOVE", 7)
    run_until(line, lambda: int(plc.image[0].received[AKTSATZ]) == 7)
    run_until(line, lambda: int(plc.image[0].received[ZSW1]) & 0x2400 == 0x2400)
    line.run(0.1)
    assert place(line) == pytest.approx(2.0, abs=0.01)


def test_snapshot_and_metrics_show_the_position_from_the_home_position():
    line = line_of(*EVERY[4], targets="4")
    line.enable()
    run_until(line, lambda: moves(line) == 1)
    line.run(0.04)
    shown = drive_snapshot(line.farm, line.farm.axes[0], line.world.now)["position_revolutions"]
    (family,) = (one for one in FarmCollector(line.farm).collect() if one.name == "pnfarm_axis_position_revolutions")
    assert float(line.farm.columns.axis[0].homing.origin) != 0.0
    assert [shown, family.samples[0].value] == pytest.approx([4.0, 4.0], abs=0.01)


def test_a_telegram_without_tasks_is_refused_for_a_program_of_positions():
    config = parse_farm(
        "farm: x\nlink: {kind: memory}\ndrives: [{name: a, model: akd-profinet}]\n"
        "controller: {name: plc, ip: 10.0.0.1/24, telegram: 1, program: {kind: positions}}\n"
    )
    drives = expand(config)
    with pytest.raises(ConfigError, match="telegram 1 of akd-profinet has no signal of a position task"):
        plan_devices(config.controller, drives, [model("akd-profinet")])


def limit(line, *sides):
    for side in sides:
        line.farm.injections.inject({"kind": "limit-switch", "on": "all", "params": {"side": side}}, line.world.now)


@pytest.mark.parametrize(("name", "telegram", "cycle", "params"), EVERY)
def test_an_axis_that_could_not_be_homed_or_take_its_task_goes_on_when_it_can(name, telegram, cycle, params):
    line = line_of(name, telegram, cycle, params)
    limit(line, "positive", "negative")
    line.enable()
    line.run(12.0)
    before = moves(line)
    line.farm.injections.clear(None, line.world.now)
    run_until(line, lambda: moves(line) >= before + 2)


@pytest.mark.parametrize(("name", "telegram", "cycle", "params"), EVERY)
def test_an_axis_that_was_stopped_on_its_way_sets_off_again(name, telegram, cycle, params):
    line = line_of(name, telegram, cycle, params, targets="30, 0")
    line.enable()
    line.run(1.0)
    limit(line, "positive")
    line.run(12.0)
    before = moves(line)
    line.farm.injections.clear(None, line.world.now)
    run_until(line, lambda: moves(line) >= before + 2)


@pytest.mark.parametrize("bit", ["at-rest", "moving"])
def test_a_homing_that_takes_long_is_not_disturbed(bit):
    # one revolution to the zero mark at 5 rpm
    params = "{DRV.OPMODE: 2, HOME.MODE: 7, HOME.V: 5000}"
    line = line_of("akd-profinet", 9, "16ms", params, behaviour=f"{{stopped-bit: {bit}}}")
    line.enable()
    took = run_until(line, lambda: moves(line) >= 2, 30.0)
    assert took > 8.0
    line.run(1.0)
    assert moves(line) > 2
