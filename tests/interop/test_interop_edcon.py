"""Festo's edcon (PyPI: festo-edcon) as PROFIdrive master of every model, in virtual time.

Its handlers know the profile's state machine, its telegrams and the handshakes of positioning by themselves.  Where
edcon expects a drive of Festo's, and a manual has another, :data:`DIFFERENCES` says so.
"""

from __future__ import annotations

from dataclasses import dataclass

import pytest

pytest.importorskip("edcon", reason="needs the package festo-edcon")

from edcon.edrive import telegram111_handler
from edcon.utils import func_helpers
from edcon_line import TELEGRAMS, EdconLine, StillWaitingError, VirtualTime, knows, names_of, own_words

from pnfarm.drives.catalogue import model, models


@dataclass(frozen=True)
class Case:
    """A telegram of a model: what commissions the drive, and what 600 rpm and one turn are in its units."""

    model: str
    telegram: int
    cycle_ms: int
    speed: int
    source: str
    #: Increments of a turn; 0 in speed mode.
    turn: int = 0
    #: MDI_ACC and MDI_DEC; 0 where the telegram has none.
    ramp: int = 0
    jog_rpm: float = 100.0
    params: str = "{}"

    @property
    def name(self) -> str:
        return f"{self.model}-{self.telegram}"


#: 2^32 are 12000 rpm in MDI_VELOCITY of the AKD, and 2^30 are 3000 rpm in NSOLL_B of HIWIN and Moog.
LONG = 600 * 2**32 // 12000
AKD_JOG = "1004: 273, 1005: -273"  # 5.12.1: 100 rpm
PROFILE_JOG = "{2585: 1000, 2586: -1000}"  # tenths of an rpm
SPEED = [
    Case("akd-profinet", 1, 16, 1638, "5.12.1"),
    Case("akd-profinet-2012", 1, 8, 1638, "5.12.1"),
    Case("hiwin-e1", 3, 4, LONG, "6.1, with Pt317 = 3000"),
    Case("moog-msd", 1, 4, 600, "13.2"),
    Case("moog-msd", 3, 4, LONG, "10.7, with P-0338 = 3000"),
    Case("profidrive", 1, 4, 600 * 0x4000 // 3000, "PNU 2000 = 3000"),
    Case("profidrive", 102, 4, LONG, "PNU 2000 = 3000"),
]
POSITION = [
    Case("akd-profinet", 9, 16, LONG, "5.12.1 to 5.12.3", 2**16, 26, params=f"{{DRV.OPMODE: 2, {AKD_JOG}}}"),
    Case("akd-profinet-2012", 9, 8, LONG, "5.12.1 to 5.12.3", 2**16, 26, params=f"{{930: 2, {AKD_JOG}}}"),
    Case("hiwin-e1", 9, 4, 600 * 2**23 // 1000, "6.6.1, 6.8", 2**23, 0x4000, 600.0),
    Case("hiwin-e1", 111, 4, 600 * 2**23 // 1000, "6.6.1, 6.8", 2**23, 0x4000, 600.0),
    Case("profidrive", 9, 4, 6000, "10000 length units", 10_000, 0x4000, params=PROFILE_JOG),
    Case("profidrive", 111, 4, 6000, "10000 length units", 10_000, 0x4000, params=PROFILE_JOG),
    # bit 6 of P-1267 has the task start with the rising edge, as edcon does (table 10.6)
    Case("moog-msd", 9, 4, 600, "13.2", 2**16, params="{1267: 0x40, 1268: 100, 1269: -100}"),
]


@dataclass(frozen=True)
class Difference:
    """What edcon does, and what the manual has; ``cases`` are those where it matters."""

    cases: tuple[str, ...]
    section: str
    edcon: str
    drive: str


EVERY = [*SPEED, *POSITION]
#: Those whose ZSW1.10 is 1 whenever no task is active.
IDLE_IS_REACHED = [case for case in POSITION if model(case.model).firmware.get("profidrive.reached_without_task")]
DIFFERENCES = {
    "stopped": Difference(
        tuple(case.name for case in POSITION if case not in IDLE_IS_REACHED),
        "AKD M 5.5; HIWIN E1 3.5.2; Moog MSD table 10.8",
        "waits for ZSW1.10 after it stopped a task or a jog",
        "ZSW1.10 tells of a target; that the axis stands is ZSW1.13",
    ),
    "no task": Difference(
        tuple(case.name for case in IDLE_IS_REACHED),
        "AKD B 5.5",
        "looks at ZSW1.10 before ZSW1.3, so that a fault in a move passes for its target",
        "ZSW1.10 goes by the motion task: it is 1 as soon as none is active",
    ),
    "jog": Difference(
        ("akd-profinet-9", "akd-profinet-2012-9"),
        "AKD M and B 5.4",
        "leaves STW1.4 and STW1.5 set when it jogs",
        "jogs only while STW1.4 to 6 are 0",
    ),
    "ramps": Difference(
        ("akd-profinet-9", "akd-profinet-2012-9", "hiwin-e1-9", "profidrive-9"),
        "AKD M and B 5.10.2; HIWIN E1 6.6.1",
        "leaves MDI_ACC and MDI_DEC of telegram 9 at zero, if its user does",
        "takes its ramps from them; what cannot be executed is not acknowledged",
    ),
    "relative": Difference(
        ("moog-msd-9",),
        "Moog MSD 10.2.1, table 10.4",
        "says in MDI_MOD whether a position is relative, and opens the holding brake with STW1.12",
        "has no MDI_MOD; STW1.12 = 1 is a relative position",
    ),
    "fault texts": Difference(
        ("hiwin-e1-111", "profidrive-111"),
        "HIWIN E1 5.1",
        "looks FAULT_CODE up in Festo's list and ends with a KeyError for every other number",
        "FAULT_CODE is the code of table 5.1.1",
    ),
    "set-up mode": Difference(
        ("hiwin-e1-111",),
        "HIWIN E1 3.12",
        "runs a velocity with POS_STW1.14",
        "POS_STW1.9 to 14 are reserved: what starts is a task to MDI_TARPOS",
    ),
    "reference here": Difference(
        ("hiwin-e1-111", "profidrive-111"),
        "HIWIN E1 3.13, 3.14",
        "waits for POS_ZSW1.11, homing active, after it set POS_STW2.1",
        "takes the place for the home position at once; POS_ZSW1.11 belongs to the procedure of STW1.11",
    ),
    "leaving": Difference(
        tuple(case.name for case in EVERY),
        "AKD M and B 5.4; HIWIN E1 3.3; Moog MSD 10.2.1",
        "sends STW1 = 0 at its end, to switch the power stage off",
        "takes nothing of a control word without STW1.10",
    ),
}

#: Telegrams of a number that edcon has, with other words; and where the manual says so.
OTHER_TELEGRAMS = {
    ("moog-msd", 9): "8.2.1, table 8.8: put together of edcon's words here",
    ("moog-msd", 102): "8.2.3, table 8.10: PKW words and process data to be mapped freely",
    ("moog-msd", 111): "8.2.3, table 8.10: process data to be mapped freely",
}


@pytest.fixture
def open_line(monkeypatch):
    """Makes the line of a case; edcon's clock is the line's."""

    def opened(case: Case) -> EdconLine:
        line = EdconLine(case.model, case.telegram, case.cycle_ms, case.params)
        for module in (func_helpers, telegram111_handler):
            monkeypatch.setattr(module, "time", VirtualTime(line))
        telegram = line.handler.telegram
        if case.ramp:
            telegram.mdi_acc.value = telegram.mdi_dec.value = case.ramp
        if case.name in DIFFERENCES["fault texts"].cases:
            line.handler.fault_string = lambda: str(line.handler.current_fault_code())
        return line

    return opened


def each(cases):
    return pytest.mark.parametrize("case", cases, ids=lambda case: case.name)


def of(difference):
    return each([case for case in EVERY if case.name in DIFFERENCES[difference].cases])


def waits_for_standstill(handler):
    """Let it wait for ZSW1.13 where it would wait for ZSW1.10 (difference "stopped"), and for the shaft to settle."""

    def wait():
        assert handler.wait_until_or_not_operational(handler.stopped)
        handler.com.line.run(0.3)

    handler.wait_for_stop = wait


def homed(line):
    assert line.handler.enable_powerstage()
    assert line.handler.referencing_task()
    return line.handler


def go(case, handler, turns, *, absolute, nonblocking=False):
    if case.name in DIFFERENCES["relative"].cases:
        handler.configure_brake(active=absolute)
    return handler.position_task(round(turns * case.turn), case.speed, absolute, nonblocking)


# what both know


def test_every_telegram_that_edcon_has_is_driven_or_is_another_one():
    ours = {
        (name, number)
        for name, entry in models().items()
        if entry.bus == "profinet"
        for number in model(name).profidrive.telegrams
        if number in TELEGRAMS
    }
    driven = {(case.model, case.telegram) for case in EVERY}
    assert {place for place in ours if knows(model(place[0]).profidrive.telegrams[place[1]])} == ours - set(
        OTHER_TELEGRAMS
    )
    assert ours - set(OTHER_TELEGRAMS) <= driven


def test_every_difference_is_of_cases_that_are_run():
    assert {name for difference in DIFFERENCES.values() for name in difference.cases} <= {case.name for case in EVERY}


def test_telegram_111_of_hiwin_has_edcons_words_and_one_reserved_word():
    telegram = model("hiwin-e1").profidrive.telegrams[111]
    assert names_of(telegram.output) == [*own_words(111, "outputs"), None]
    assert names_of(telegram.input) == [*own_words(111, "inputs"), None]


# the state machine


@each(EVERY)
def test_edcon_enables_and_disables(open_line, case):
    """PROFIdrive's S1 to S4 and back, as edcon walks it."""
    line = open_line(case)
    handler = line.handler
    assert not handler.ready_for_motion()
    assert handler.enable_powerstage()
    assert handler.ready_for_motion()
    assert int(line.axis.drive.state) == 4
    assert handler.disable_powerstage()
    assert int(line.axis.drive.state) == 2
    assert handler.enable_powerstage()


@each(EVERY)
def test_edcon_sees_a_fault_and_acknowledges_it(open_line, case):
    line = open_line(case)
    handler = line.handler
    assert handler.enable_powerstage()
    assert not handler.fault_present()
    line.farm.axes[0].raise_fault("overvoltage", hold=True)
    line.run(0.1)
    assert handler.fault_present()
    assert not handler.ready_for_motion()
    assert not handler.enable_powerstage(timeout=1.0)
    assert not handler.acknowledge_faults(timeout=1.0), "its cause is still there"
    line.farm.axes[0].release_fault(model(case.model).fault("overvoltage").number)
    assert handler.acknowledge_faults()
    assert handler.enable_powerstage()
    assert handler.ready_for_motion()


@of("leaving")
def test_edcon_leaves_and_the_drive_stays_as_it_was(open_line, case):
    """Difference "leaving"."""
    line = open_line(case)
    assert line.handler.enable_powerstage()
    line.handler.shutdown()
    line.run(0.5)
    assert int(line.axis.drive.state) == 4
    with pytest.raises(ConnectionError):
        line.handler.update_io()


# speed


@each(SPEED)
def test_edcon_runs_a_velocity_both_ways_and_stops_it(open_line, case):
    line = open_line(case)
    handler, telegram = line.handler, line.handler.telegram
    assert handler.enable_powerstage()
    for sign in (1, -1):
        assert handler.velocity_task(sign * case.speed)
        line.run(2.0)
        handler.update_inputs()
        actual = telegram.nist_b if hasattr(telegram, "nist_b") else telegram.nist_a
        assert int(actual) == pytest.approx(sign * case.speed, rel=0.01)
        assert float(line.axis.motor.velocity) == pytest.approx(sign * 600.0, abs=2.0)
        assert telegram.zsw1.speed_error_within_tolerance_range
        assert telegram.zsw1.f_or_n_reached_or_exceeded
    assert handler.velocity_task(case.speed, duration=1.0)
    if int(line.axis.ramp.settings.generator) == 2:
        # HIWIN E1 3.3.1 reserves STW1.4 to 6: the set point itself goes to zero
        telegram.nsoll_b.value = 0
        handler.update_outputs()
    line.run(2.0)
    assert float(line.axis.motor.velocity) == pytest.approx(0.0, abs=0.5)
    assert handler.ready_for_motion()


@each(SPEED)
@pytest.mark.parametrize("stop", ["configure_quick_stop", "configure_coast_stop"])
def test_edcon_stops_a_running_axis_out_of_operation_and_starts_it_again(open_line, case, stop):
    line = open_line(case)
    handler = line.handler
    assert handler.enable_powerstage()
    assert handler.velocity_task(case.speed)
    line.run(1.0)
    getattr(handler, stop)(active=True)
    handler.update_outputs()
    line.run(5.0)
    assert int(line.axis.drive.state) == 1, "switching on inhibited"
    assert not handler.enable_powerstage(timeout=0.5)
    getattr(handler, stop)(active=False)
    assert handler.enable_powerstage()
    line.run(2.0)
    assert float(line.axis.motor.velocity) == pytest.approx(600.0, abs=2.0)


# positions


@each(POSITION)
def test_edcon_homes_and_moves_to_an_absolute_position(open_line, case):
    line = open_line(case)
    handler = homed(line)
    assert handler.referenced()
    for turns in (3.0, -2.5, -2.5, 0.0):
        assert go(case, handler, turns, absolute=True)
        assert handler.target_position_reached()
        line.run(0.1)
        handler.update_inputs()
        assert line.turns == pytest.approx(turns, abs=0.01)
        assert int(handler.telegram.xist_a) == pytest.approx(turns * case.turn, abs=0.01 * case.turn)
        assert handler.stopped()


@each(POSITION)
def test_edcon_moves_by_relative_positions(open_line, case):
    line = open_line(case)
    handler = homed(line)
    for count, turns in enumerate((1.5, 1.5, -4.0)):
        assert go(case, handler, turns, absolute=False)
        line.run(0.1)
        assert line.turns == pytest.approx((1.5, 3.0, -1.0)[count], abs=0.01)


@each(POSITION)
def test_edcon_stops_a_move_and_starts_another(open_line, case):
    line = open_line(case)
    handler = homed(line)
    waits_for_standstill(handler)
    assert go(case, handler, 50.0, absolute=True, nonblocking=True)
    line.run(1.0)
    assert float(line.axis.motor.velocity) == pytest.approx(600.0, abs=2.0)
    assert not handler.stopped()
    handler.stop_motion_task()
    assert handler.stopped()
    assert handler.target_position_reached() == (case in IDLE_IS_REACHED)
    assert 5.0 < line.turns < 20.0
    assert go(case, handler, 2.0, absolute=True)
    line.run(0.1)
    assert line.turns == pytest.approx(2.0, abs=0.01)


@each(POSITION)
def test_edcon_pauses_a_move_and_resumes_it(open_line, case):
    line = open_line(case)
    handler = homed(line)
    # the task is not over, and so neither bit of a stop need come
    handler.wait_for_stop = lambda: line.run(0.5)
    assert go(case, handler, 20.0, absolute=True, nonblocking=True)
    line.run(0.5)
    handler.pause_motion_task()
    held = line.turns
    line.run(1.0)
    assert line.turns == pytest.approx(held, abs=0.05)
    assert held < 15.0
    handler.resume_motion_task()
    assert handler.wait_for_target_position()
    line.run(0.1)
    assert line.turns == pytest.approx(20.0, abs=0.01)


@each(POSITION)
def test_a_fault_ends_edcons_move_and_the_next_one_goes_on_from_there(open_line, case):
    """Difference "no task"."""
    line = open_line(case)
    handler = homed(line)
    assert go(case, handler, 50.0, absolute=True, nonblocking=True)
    line.run(0.5)
    line.farm.axes[0].raise_fault("overvoltage", hold=False)
    assert handler.wait_for_target_position() == (case in IDLE_IS_REACHED)
    assert handler.fault_present()
    line.run(5.0)
    assert handler.acknowledge_faults()
    assert handler.enable_powerstage()
    assert handler.referenced()
    assert go(case, handler, 4.0, absolute=True)
    line.run(0.1)
    assert line.turns == pytest.approx(4.0, abs=0.01)


@of("jog")
def test_edcon_does_not_jog_with_stw1_4_and_5_set(open_line, case):
    """Difference "jog"."""
    line = open_line(case)
    handler = homed(line)
    assert handler.jog_task()
    line.run(1.0)
    assert line.turns == pytest.approx(0.0, abs=0.001)
    assert handler.stopped()


@each(POSITION)
def test_edcon_jogs_both_ways_and_stops(open_line, case):
    line = open_line(case)
    handler, stw1 = homed(line), line.handler.telegram.stw1
    waits_for_standstill(handler)
    for sign in (1, -1):
        if case.name in DIFFERENCES["jog"].cases:
            stw1.do_not_reject_traversing_task = stw1.no_intermediate_stop = False
        assert handler.jog_task(sign > 0, sign < 0)
        line.run(1.0)
        assert float(line.axis.motor.velocity) == pytest.approx(sign * case.jog_rpm, abs=2.0)
        handler.stop_motion_task()
        assert handler.stopped()
        stw1.no_intermediate_stop = True
    assert go(case, handler, 1.0, absolute=True), "a task after the jog"


@of("ramps")
def test_a_task_without_ramps_is_not_acknowledged(open_line, case):
    """Difference "ramps"."""
    line = open_line(case)
    handler = homed(line)
    handler.telegram.mdi_acc.value = handler.telegram.mdi_dec.value = 0
    line.com.allow(5.0)
    with pytest.raises(StillWaitingError):
        go(case, handler, 1.0, absolute=True)
    assert not handler.telegram.zsw1.traversing_task_ack
    assert line.turns == pytest.approx(0.0, abs=0.01)


@of("stopped")
def test_edcon_waits_in_vain_for_a_target_after_a_stop(open_line, case):
    """Difference "stopped"."""
    line = open_line(case)
    handler = homed(line)
    assert go(case, handler, 50.0, absolute=True, nonblocking=True)
    line.run(0.5)
    line.com.allow(10.0)
    with pytest.raises(StillWaitingError):
        handler.stop_motion_task()
    line.com.allow(10.0)
    assert handler.stopped()
    assert not handler.target_position_reached()


@each(POSITION)
def test_edcon_begins_no_move_of_an_axis_that_is_not_enabled(open_line, case):
    line = open_line(case)
    assert not go(case, line.handler, 1.0, absolute=True)
    assert not line.handler.referencing_task()
    assert not line.handler.jog_task()
    line.run(0.5)
    assert line.turns == pytest.approx(0.0, abs=0.001)


# telegram 111


@of("fault texts")
def test_edcon_reads_the_fault_code_of_telegram_111(open_line, case):
    """HIWIN E1 5.1, table 5.1.1: AL.400 is 0x400; of the profile it is fault class 4.  Difference "fault texts"."""
    line = open_line(case)
    line.farm.axes[0].raise_fault("overvoltage", hold=False)
    line.run(0.1)
    assert line.handler.current_fault_code() == {"hiwin-e1": 0x400, "profidrive": 4}[case.model]
    del line.handler.fault_string
    with pytest.raises(KeyError):
        line.handler.fault_string()


@each([case for case in POSITION if case.telegram == 111])
def test_edcons_override_slows_a_move_down(open_line, case):
    """HIWIN E1 3.2, 6.6.1: OVERRIDE, 0x4000 is 100 %; 6.1: NIST_B."""
    line = open_line(case)
    handler = homed(line)
    handler.base_velocity = 3000.0
    handler.over_v = 50.0
    assert go(case, handler, 50.0, absolute=True, nonblocking=True)
    line.run(1.0)
    assert handler.current_velocity() == pytest.approx(300.0, abs=2.0)
    handler.over_v = 100.0
    handler.update_outputs()
    line.run(1.0)
    assert handler.current_velocity() == pytest.approx(600.0, abs=2.0)


@of("reference here")
def test_edcon_takes_the_place_for_the_home_position(open_line, case):
    """Difference "reference here"."""
    line = open_line(case)
    handler = homed(line)
    assert go(case, handler, 2.0, absolute=True)
    line.run(0.1)
    line.com.allow(5.0)
    with pytest.raises(StillWaitingError):
        handler.set_current_position_task()
    line.com.allow(5.0)
    assert handler.referenced()
    assert handler.current_position() == pytest.approx(0, abs=0.01 * case.turn)


@of("set-up mode")
def test_edcons_velocity_task_is_a_positioning_to_mdi_tarpos(open_line, case):
    """Difference "set-up mode"."""
    line = open_line(case)
    handler = homed(line)
    assert go(case, handler, 2.0, absolute=True)
    handler.telegram.mdi_tarpos.value = 5 * case.turn
    assert handler.velocity_task(-case.speed)
    line.run(3.0)
    assert line.turns == pytest.approx(5.0, abs=0.01)


@each([case for case in POSITION if case.name == "profidrive-111"])
def test_edcon_runs_a_velocity_in_set_up_mode_and_jogs_by_a_distance(open_line, case):
    """POS_STW1.9, 10 and 14, and POS_STW2.5 with p2587."""
    line = open_line(case)
    handler = homed(line)
    for sign in (1, -1):
        assert handler.velocity_task(sign * case.speed)
        line.run(2.0)
        handler.update_inputs()
        assert handler.telegram.pos_zsw1.setup_active
        assert float(line.axis.motor.velocity) == pytest.approx(sign * 600.0, abs=2.0)
        handler.telegram.stw1.activate_traversing_task = False
        handler.update_outputs()
    waits_for_standstill(handler)
    handler.stop_motion_task()
    begun = line.turns
    assert handler.jog_task(incremental=True)
    line.run(1.0)
    assert line.turns - begun == pytest.approx(0.1, abs=0.01)


# parameters


@each(EVERY)
def test_edcon_reads_the_telegram_in_use(open_line, case):
    """PNU 922, a word for edcon as well."""
    assert open_line(case).com.read_pnu(922) == case.telegram


@each([case for case in EVERY if 925 in model(case.model).parameters])
def test_edcon_writes_the_tolerance_of_a_sign_of_life_that_it_does_not_send(open_line, case):
    """PNU 925: HIWIN E1 4.1, Moog MSD 8.3.2; a master that never began to count is not watched."""
    line = open_line(case)
    assert line.com.write_pnu(925, 0, 7)
    assert line.com.read_pnu(925) == 7
    assert line.handler.enable_powerstage()
    line.run(2.0)
    assert line.handler.ready_for_motion()


@each(EVERY)
def test_edcon_hears_that_a_parameter_is_read_only(open_line, case):
    line = open_line(case)
    assert not line.com.write_pnu(964, 0, 1)
    assert line.com.read_pnu(947) == 0
