"""slow-ramp and fault-not-acknowledging, as a controller sees them."""

import pytest
from fault_line import FaultLine
from storm import LINES, left_behind

from pnfarm.faults.errors import InjectionError
from pnfarm.table.axis_codes import CMD_ACKNOWLEDGE

FAULT, REACHED = 0x0008, 0x0400
RAMP = "{DRV.ACC: 1000000, DRV.DEC: 1000000}"
PROGRAM = "{{kind: constant, speed_rpm: {speed}, acknowledge_after: 200ms}}"


def velocity(line: FaultLine) -> float:
    return float(line.farm.columns.axis[0].motor.velocity)


def seconds_to(line: FaultLine, rpm: float) -> float:
    before = line.world.now
    assert line.until(lambda: velocity(line) >= rpm, 20.0)
    return (line.world.now - before) / 1e9


def starting(factor: float | None, **options) -> FaultLine:
    """A drive that is about to accelerate."""
    line = FaultLine(params=RAMP, program=PROGRAM.format(speed=1000), **options)
    line.connect()
    if factor is not None:
        line.add("slow-ramp", params={"factor": factor}, as_="slow")
    assert line.until(lambda: velocity(line) > 1.0, 10.0)
    return line


def test_a_ramp_takes_as_many_times_longer_as_asked():
    usual = seconds_to(starting(None), 900.0)
    slow = seconds_to(starting(3.0), 900.0)
    assert slow == pytest.approx(3 * usual, rel=0.03)


def test_zsw1_reports_the_target_speed_only_when_the_slow_ramp_gets_there():
    line = starting(4.0)
    line.run(1.5)
    assert not line.seen_zsw1() & REACHED, "in time it would be there"
    line.run(3.5)
    assert line.seen_zsw1() & REACHED


def seconds_of_a_stop(factor: float | None) -> float:
    """From the set point 0 to standstill."""
    line = starting(None)
    line.run(2.0)
    if factor is not None:
        line.add("slow-ramp", params={"factor": factor})
    line.plc.columns.program[0].speed = 0.0
    before = line.world.now
    assert line.until(lambda: abs(velocity(line)) < 10.0, 20.0)
    return (line.world.now - before) / 1e9


def test_a_stop_takes_longer_too():
    assert seconds_of_a_stop(3.0) == pytest.approx(3 * seconds_of_a_stop(None), rel=0.1)


def left_behind_of_ramp(line: FaultLine) -> tuple[float, float]:
    axis = line.farm.columns.axis[0]
    return float(axis.ramp.settings.slowness), float(axis.profile.settings.slowness)


def test_factors_of_two_injections_multiply_and_end_one_by_one(line):
    line.add("slow-ramp", params={"factor": 2.0}, as_="one")
    line.add("slow-ramp", params={"factor": 3.0}, as_="two")
    assert left_behind_of_ramp(line) == (5.0, 5.0)
    line.clear("one")
    assert left_behind_of_ramp(line) == (2.0, 2.0)
    line.clear("two")
    assert left_behind_of_ramp(line) == (0.0, 0.0)


def test_a_slow_ramp_is_confirmed_by_a_frame_that_left_since(line):
    fault = line.add("slow-ramp", for_="100ms")
    assert not fault.evidence().confirmed
    line.run(0.05)
    assert fault.evidence().confirmed
    line.run(0.1)
    assert fault.state == "ended"


def test_a_drive_without_a_ramp_generator_refuses_a_slow_ramp_with_the_reason():
    line = FaultLine(model="hiwin-e1", **LINES["hiwin-e1"])
    with pytest.raises(InjectionError, match=r"fault\.kind: axis-01 \(hiwin-e1\) has no ramp generator"):
        line.add("slow-ramp")
    assert line.faults.list() == []


@pytest.mark.parametrize("factor", [0.5, 0, -1, 1e6, float("nan"), "fast"])
def test_a_factor_that_is_no_slower_ramp_is_refused(line, factor):
    with pytest.raises(InjectionError, match=r"params\.factor"):
        line.add("slow-ramp", params={"factor": factor})


@pytest.mark.parametrize("model", list(LINES))
def test_a_fault_stays_as_long_as_its_acknowledgement_is_ignored(model):
    line = FaultLine(model=model, **LINES[model])
    line.connect(20.0)
    line.enable(20.0)
    number = next(fault.number for fault in line.farm.axes[0].model.faults.values() if not fault.warning)
    mute = line.add("fault-not-acknowledging", as_="mute")
    line.add("drive-fault", params={"fault": number})
    line.run(3.0)
    assert line.seen_zsw1() & FAULT
    seen = mute.evidence()
    assert seen.activations >= 2, "the controller tries again and again"
    assert seen.confirmed
    assert "acknowledgement ignored" in line.events("axis-01")
    line.clear("mute")
    line.enable(10.0)
    assert not line.seen_zsw1() & FAULT
    assert left_behind(line) == {}


def test_so_many_acknowledgements_are_ignored_and_the_next_one_works(line):
    mute = line.add("fault-not-acknowledging", count=3)
    line.add("f702")
    assert line.until(lambda: mute.state == "ended", 10.0)
    assert mute.evidence().activations == 3
    assert mute.evidence().confirmed
    assert line.seen_zsw1() & FAULT
    line.enable(5.0)
    assert line.events("axis-01").count("acknowledgement ignored") == 3


def test_without_a_fault_there_is_nothing_to_ignore(line):
    mute = line.add("fault-not-acknowledging")
    line.run(2.0)
    assert mute.evidence().activations == 0
    assert not mute.evidence().confirmed


def test_an_acknowledgement_of_a_positioning_error_is_ignored_once_though_no_frame_reports_a_fault(line):
    mute = line.add("fault-not-acknowledging", count=1)
    axis = line.farm.columns.axis[0]
    axis.positioning.error = 1
    line.farm.axes[0].handle.push_command(CMD_ACKNOWLEDGE, 0)
    assert line.until(lambda: mute.state == "ended", 1.0)
    assert (mute.evidence().activations, mute.evidence().confirmed) == (1, False)
    assert axis.positioning.error == 1
    line.farm.axes[0].handle.push_command(CMD_ACKNOWLEDGE, 0)
    assert line.until(lambda: axis.positioning.error == 0, 1.0)


def test_a_parameter_that_acknowledges_is_ignored_as_well_and_the_supply_clears_the_fault(line):
    mute = line.add("fault-not-acknowledging")
    line.add("drive-fault", params={"fault": 702})
    line.run(0.05)
    line.farm.axes[0].handle.push_command(CMD_ACKNOWLEDGE, 0)
    line.run(0.05)
    assert mute.evidence().activations == 1
    line.add("power-cycle", params={"off": "100ms"})
    line.run(1.0)
    assert int(line.farm.columns.axis[0].faults.code[0]) == 0
    line.clear(mute.id)
    line.enable(10.0)
