"""The sensor interface of PROFIdrive (6.3.6; Moog MSD manual 11, HIWIN E1 manual 3.7 and 3.8) on the bench."""

from __future__ import annotations

import pytest
from bench_axis import MS, BenchAxis

from pnfarm.firmware.profidrive.sensor_interface import PRIORITY, TRANSITIONS
from pnfarm.table.axis_codes import (
    CMD_ACKNOWLEDGE,
    CMD_HOLD_FAULT,
    CMD_POWER_ON,
    CMD_RAISE_FAULT,
    CMD_RELEASE_FAULT,
    EDGE_FALLING,
    MARK_NONE,
    MARK_PROBE_1,
    MARK_PROBE_2,
    MARK_ZERO,
)
from pnfarm.table.image import LOST_EXPIRED
from pnfarm.table.signals import G1_STW, G1_XIST1, G1_XIST2, G1_ZSW, G2_XIST1, STW1

STEP = 2.0**-20
INPUT_5, INPUT_6 = 1 << 5, 1 << 6
ENCODER_FAULT = 21

ACTIVATE, READ, CANCEL = 0x10, 0x20, 0x30
ON_THE_FLY = 0x80
SET_HOME, ABSOLUTE, PARK, ACKNOWLEDGE = 0x1000, 0x2000, 0x4000, 0x8000
ERROR = 0x8000


class SensorBench(BenchAxis):
    """``ask`` with G1_STW; ``zsw`` and ``xist2`` answer."""

    def __init__(self) -> None:
        super().__init__()
        axis = self.axis
        axis.sensor.settings.step = axis.sensor.settings.step_2 = STEP
        axis.sensor.settings.bits, axis.sensor.settings.status_bits = 0xF8FF, 0xFBFF
        axis.sensor.settings.refused = SET_HOME
        axis.sensor.settings.marks[:] = (
            MARK_PROBE_1,
            MARK_PROBE_2,
            MARK_ZERO,
            MARK_NONE,
            0,
            EDGE_FALLING,
            0,
            0,
            0,
            0,
            0,
            0,
        )
        axis.sensor.settings.probe_inputs[:] = (INPUT_5, INPUT_6)
        axis.sensor.settings.fault = ENCODER_FAULT
        self.write(0x0400)
        self.run(1)

    def ask(self, word: int) -> int:
        self.image.received[G1_STW] = word
        self.run(1)
        return self.zsw

    @property
    def zsw(self) -> int:
        return int(self.image.sent[G1_ZSW]) & 0xFFFF

    @property
    def xist1(self) -> int:
        return int(self.image.sent[G1_XIST1])

    @property
    def xist2(self) -> int:
        return int(self.image.sent[G1_XIST2])

    def turn(self, to: float, per_step: float = 0.01) -> None:
        """Turn the shaft by hand."""
        while abs(to - self.axis.motor.position) > 1e-9:
            way = to - self.axis.motor.position
            self.axis.motor.position += max(-per_step, min(per_step, way))
            self.run(1)

    def edge(self, mask: int, *, rising: bool = True) -> None:
        inputs = int(self.axis.machine.settings.fault_inputs)
        self.axis.machine.settings.fault_inputs = inputs | mask if rising else inputs & ~mask
        self.run(1)

    def error(self) -> int:
        """The code in G1_XIST2, 0 while G1_ZSW.15 is not set."""
        return self.xist2 if self.zsw & ERROR else 0


@pytest.fixture
def sensor() -> SensorBench:
    return SensorBench()


def test_every_transition_leads_from_a_state_that_is_reached_and_its_event_has_a_priority() -> None:
    assert {event for _, event in TRANSITIONS} == set(PRIORITY)
    assert len(PRIORITY) == len(set(PRIORITY))
    reached = {0} | set(TRANSITIONS.values())
    assert {state for state, _ in TRANSITIONS} == reached


def test_a_drive_without_the_interface_answers_nothing() -> None:
    bench = SensorBench()
    bench.axis.sensor.settings.bits = 0
    bench.image.sent[G1_ZSW] = 0
    assert bench.ask(PARK | ABSOLUTE | ACTIVATE | 1) == 0


# reference marks


def test_a_reference_mark_is_searched_found_read_and_taken(sensor: SensorBench) -> None:
    """Moog MSD manual 11.4: function, edge of the input, position in G1_XIST2."""
    assert sensor.ask(ACTIVATE | 1) == 0x0001
    sensor.turn(0.25)
    assert sensor.zsw == 0x0001
    sensor.edge(INPUT_5)
    place = sensor.axis.motor.position
    # the probe's own level is bit 8
    assert sensor.zsw == 0x0110
    sensor.turn(0.5)
    assert sensor.ask(0) == 0x0110
    assert sensor.xist2 == 0
    assert sensor.ask(READ | 1) == 0x0110
    assert sensor.xist2 == round(place / STEP) != sensor.xist1
    assert sensor.ask(0) == 0x0100
    assert sensor.xist2 == 0


def test_a_mark_that_is_found_may_be_read_without_a_pause(sensor: SensorBench) -> None:
    sensor.ask(ACTIVATE | 1)
    sensor.turn(0.125)
    sensor.edge(INPUT_5)
    assert sensor.ask(READ | 1) & 0x80F0 == 0x0010
    assert sensor.xist2 == round(0.125 / STEP)


def test_the_search_goes_on_without_the_command_until_the_mark_comes(sensor: SensorBench) -> None:
    sensor.ask(ACTIVATE | 1)
    assert sensor.ask(0) == 0x0001
    sensor.edge(INPUT_5)
    assert sensor.zsw == 0x0110


def test_only_the_configured_edge_counts_and_only_after_the_request(sensor: SensorBench) -> None:
    sensor.edge(INPUT_6)
    sensor.edge(INPUT_6, rising=False)
    assert sensor.ask(ACTIVATE | 2) == 0x0002
    sensor.edge(INPUT_6)
    assert sensor.zsw == 0x0202
    sensor.edge(INPUT_6, rising=False)
    assert sensor.zsw == 0x0020


@pytest.mark.parametrize(("start", "end", "mark"), [(0.4, 1.3, 1), (1.3, 0.7, 1), (-0.3, 0.2, 0), (0.2, -1.1, 0)])
def test_the_encoders_zero_mark_is_found_where_it_is(sensor: SensorBench, start: float, end: float, mark: int) -> None:
    sensor.turn(start, per_step=10.0)
    sensor.ask(ACTIVATE | 4)
    sensor.turn(end, per_step=0.013)
    assert sensor.zsw == 0x0040
    sensor.ask(0)
    sensor.ask(READ | 4)
    assert sensor.xist2 == mark << 20


def test_several_marks_are_searched_together_and_read_one_by_one(sensor: SensorBench) -> None:
    assert sensor.ask(ACTIVATE | 0x5) == 0x0005
    sensor.turn(0.5)
    sensor.edge(INPUT_5)
    sensor.edge(INPUT_5, rising=False)
    assert sensor.zsw == 0x0014
    sensor.turn(1.1)
    assert sensor.zsw == 0x0050
    for function, place in ((4, 1.0), (1, 0.5)):
        sensor.ask(0)
        sensor.ask(READ | function)
        assert sensor.xist2 == round(place / STEP)
    assert sensor.ask(0) == 0


def test_cancel_ends_a_search(sensor: SensorBench) -> None:
    sensor.ask(ACTIVATE | 0x5)
    assert sensor.ask(CANCEL | 1) == 0x0004
    assert sensor.ask(CANCEL | 4) == 0
    assert sensor.ask(0) == 0
    sensor.edge(INPUT_5)
    assert sensor.zsw == 0x0100
    sensor.ask(ACTIVATE | 0x5)
    assert sensor.ask(CANCEL) == 0x0100


def test_a_new_search_makes_the_old_value_void(sensor: SensorBench) -> None:
    sensor.ask(ACTIVATE | 1)
    sensor.edge(INPUT_5)
    sensor.ask(0)
    assert sensor.ask(ACTIVATE | 1) == 0x0101


# measuring on the fly


@pytest.mark.parametrize(
    ("function", "mask", "rising"),
    [(1, INPUT_5, True), (2, INPUT_5, False), (4, INPUT_6, True), (8, INPUT_6, False)],
)
def test_functions_on_the_fly_are_the_edges_of_two_probes(
    sensor: SensorBench, function: int, mask: int, rising: bool
) -> None:
    if not rising:
        sensor.edge(mask)
    assert sensor.ask(ON_THE_FLY | ACTIVATE | function) & 0x0F == function
    sensor.turn(0.375)
    sensor.edge(mask, rising=not rising)
    assert sensor.zsw & 0xFF == function
    sensor.edge(mask, rising=rising)
    assert sensor.zsw & 0xFF == function << 4
    sensor.turn(0.4)
    sensor.ask(ON_THE_FLY)
    sensor.ask(ON_THE_FLY | READ | function)
    assert sensor.xist2 == round(0.375 / STEP)
    assert sensor.ask(0) & 0xFF == 0


def test_a_value_is_read_while_another_edge_is_awaited(sensor: SensorBench) -> None:
    """Transitions TD32 and TD33 of the profile."""
    sensor.ask(ON_THE_FLY | ACTIVATE | 0x5)
    sensor.edge(INPUT_5)
    assert sensor.zsw & 0xFF == 0x14
    sensor.ask(ON_THE_FLY | READ | 1)
    assert sensor.zsw & 0xFF == 0x14
    assert sensor.ask(ON_THE_FLY) & 0xFF == 0x04
    sensor.edge(INPUT_6)
    assert sensor.zsw & 0xFF == 0x40
    sensor.ask(ON_THE_FLY | READ | 4)
    assert sensor.error() == 0
    assert sensor.ask(0) & 0xFF == 0


def test_one_edge_after_the_other_is_measured_and_read_without_command_0_between(sensor: SensorBench) -> None:
    """TD33: from the value that is read straight to the next edge."""
    for turn in (0.25, 0.5, 0.75):
        assert sensor.ask(ON_THE_FLY | ACTIVATE | 1) & 0xFF == 0x01
        sensor.turn(turn)
        sensor.edge(INPUT_5)
        assert sensor.zsw & 0xFF == 0x10
        sensor.edge(INPUT_5, rising=False)
        sensor.ask(ON_THE_FLY | READ | 1)
        sensor.run(3)
        assert (sensor.error(), sensor.xist2) == (0, round(turn / STEP))


def test_further_functions_join_with_a_command_of_their_own(sensor: SensorBench) -> None:
    """TD31."""
    sensor.ask(ON_THE_FLY | ACTIVATE | 1)
    sensor.edge(INPUT_5)
    assert sensor.ask(ON_THE_FLY | ACTIVATE | 5) & 0xFF == 0x10
    sensor.ask(ON_THE_FLY)
    assert sensor.ask(ON_THE_FLY | ACTIVATE | 4) & 0xFF == 0x14


# absolute position


def test_the_absolute_position_is_sent_on_request_and_not_beside_a_search(sensor: SensorBench) -> None:
    sensor.turn(2.5, per_step=1.0)
    assert sensor.ask(ABSOLUTE) == 0x2000
    assert sensor.xist2 == round(2.5 / STEP)
    assert sensor.ask(ABSOLUTE | ACTIVATE | 1) == 0x0001
    assert sensor.ask(ABSOLUTE | CANCEL | 1) == 0x2000
    assert sensor.ask(0) == 0
    assert sensor.xist2 == 0


def test_a_drive_whose_second_value_always_shows_the_position_does_so(sensor: SensorBench) -> None:
    """Moog MSD manual 11.3.1: G1_XIST2 is identical to G1_XIST1."""
    sensor.axis.sensor.settings.shows = 1
    sensor.turn(1.75, per_step=1.0)
    assert sensor.xist2 == sensor.xist1 == round(1.75 / STEP)


def test_a_request_for_an_absolute_position_that_is_not_there_is_error_8(sensor: SensorBench) -> None:
    sensor.axis.sensor.settings.refused = ABSOLUTE
    sensor.ask(ABSOLUTE)
    assert sensor.error() == 0x0008


# errors


@pytest.mark.parametrize(
    ("words", "code"),
    [
        ((0x40,), 0x0F01), ((0x70 | 1,), 0x0F01), ((SET_HOME,), 0x0F01),
        ((ACTIVATE | 8,), 0x0004), ((ACTIVATE | 1, READ | 1), 0x0004),
        ((ACTIVATE | 1, ON_THE_FLY | ACTIVATE | 1), 0x0004),
        ((READ | 1,), 0x0005), ((READ,), 0x0005), ((READ | 3,), 0x0005),
        ((ON_THE_FLY | ACTIVATE | 1, ACTIVATE | 1), 0x0006), ((ON_THE_FLY | ACTIVATE | 1, READ | 1), 0x0006),
        ((ON_THE_FLY | READ | 1,), 0x0007), ((ON_THE_FLY | ACTIVATE | 1, ON_THE_FLY | READ | 1), 0x0007),
    ],
)  # fmt: skip
def test_what_cannot_be_is_an_error_with_its_code(sensor: SensorBench, words: tuple[int, ...], code: int) -> None:
    for word in words:
        assert sensor.error() == 0
        sensor.ask(word)
    assert (sensor.zsw & ~0x0300, sensor.error()) == (ERROR, code)
    # nothing but the acknowledgement leads out
    assert sensor.ask(0) == ERROR
    assert sensor.ask(ACKNOWLEDGE) == ERROR | 0x0800
    sensor.run(1)
    assert (sensor.zsw, sensor.xist2) == (0x0800, 0)
    assert sensor.ask(0) == 0


def test_probes_that_do_not_measure_cannot_be_waited_for(sensor: SensorBench) -> None:
    sensor.axis.sensor.settings.probe_mode = 1
    sensor.ask(ACTIVATE | 1)
    assert sensor.error() == 0x0004
    other = SensorBench()
    other.axis.sensor.settings.probe_inputs[0] = 0
    other.ask(ON_THE_FLY | ACTIVATE | 1)
    assert other.error() == 0x0006


def test_a_drive_that_reserves_measuring_on_the_fly_refuses_it(sensor: SensorBench) -> None:
    """HIWIN E1 manual 3.7: bit 7."""
    sensor.axis.sensor.settings.bits, sensor.axis.sensor.settings.refused = 0xC0FF, ON_THE_FLY
    assert sensor.ask(ON_THE_FLY) == 0
    sensor.ask(ON_THE_FLY | ACTIVATE | 1)
    assert sensor.error() == 0x0F01


def test_bits_that_a_drive_reserves_do_nothing_and_are_not_shown(sensor: SensorBench) -> None:
    sensor.axis.sensor.settings.bits, sensor.axis.sensor.settings.status_bits = 0xC0FF, 0xC8FF
    sensor.edge(INPUT_5)
    assert sensor.ask(ABSOLUTE | SET_HOME) == 0


def test_an_illegal_word_that_stays_is_an_error_again(sensor: SensorBench) -> None:
    sensor.ask(0x50)
    sensor.ask(0x50 | ACKNOWLEDGE)
    sensor.run(2)
    assert sensor.zsw == 0x0800
    sensor.ask(0x50)
    sensor.run(1)
    assert sensor.error() == 0x0F01


def test_a_failing_encoder_is_error_1_until_it_is_well_and_acknowledged(sensor: SensorBench) -> None:
    sensor.ask(ACTIVATE | 1)
    sensor.command(CMD_HOLD_FAULT, ENCODER_FAULT)
    sensor.run(1)
    assert (sensor.zsw, sensor.error()) == (ERROR, 1)
    # the cause stays: no acknowledgement helps
    sensor.ask(ACKNOWLEDGE)
    sensor.run(2)
    assert sensor.zsw == ERROR | 0x0800
    sensor.ask(0)
    assert (sensor.zsw, sensor.error()) == (ERROR, 1)
    sensor.command(CMD_RELEASE_FAULT, ENCODER_FAULT)
    sensor.run(2)
    assert sensor.error() == 1
    sensor.ask(ACKNOWLEDGE)
    sensor.run(1)
    assert sensor.zsw == 0x0800
    assert sensor.ask(0) == 0
    # the drive's own fault wants an acknowledgement of its own
    assert sensor.zsw1 & 0x0008
    sensor.command(CMD_ACKNOWLEDGE)
    sensor.run(1)
    assert not sensor.zsw1 & 0x0008


def test_a_fault_of_the_encoder_that_comes_and_goes_is_an_error_once(sensor: SensorBench) -> None:
    sensor.command(CMD_RAISE_FAULT, ENCODER_FAULT)
    sensor.run(1)
    assert sensor.error() == 1
    sensor.ask(ACKNOWLEDGE)
    sensor.run(1)
    assert sensor.ask(0) == 0
    sensor.run(10)
    assert sensor.zsw == 0


# parking


def test_a_parked_encoder_shows_nothing_and_forgets_what_was_asked(sensor: SensorBench) -> None:
    sensor.turn(1.5, per_step=1.0)
    sensor.ask(ACTIVATE | 1)
    assert sensor.ask(PARK | ACTIVATE | 1) == 0x4000
    assert (sensor.xist1, sensor.xist2) == (0, 0)
    sensor.edge(INPUT_5)
    assert sensor.zsw == 0x4000
    assert sensor.ask(0) == 0x0100
    assert sensor.xist1 == round(1.5 / STEP)


def test_parking_leads_out_of_an_error_and_hides_a_broken_encoder(sensor: SensorBench) -> None:
    sensor.command(CMD_HOLD_FAULT, ENCODER_FAULT)
    sensor.run(1)
    assert sensor.ask(PARK) == 0x4000
    sensor.run(5)
    assert sensor.zsw == 0x4000
    sensor.ask(0)
    sensor.run(1)
    assert sensor.error() == 1


def test_an_encoder_that_is_at_work_cannot_be_parked(sensor: SensorBench) -> None:
    sensor.enable()
    sensor.ask(PARK)
    assert sensor.error() == 0x0003
    assert sensor.axis.drive.state == 4
    assert sensor.xist1 == 0


# the controller


def test_words_count_with_control_by_plc_and_are_zero_without_valid_data(sensor: SensorBench) -> None:
    sensor.ask(ABSOLUTE)
    sensor.image.received[STW1] = 0
    sensor.ask(0)
    assert sensor.zsw == 0x2000
    sensor.image.received[STW1] = 0x0400
    sensor.run(1)
    assert sensor.zsw == 0
    sensor.ask(ABSOLUTE)
    sensor.lose(LOST_EXPIRED)
    assert sensor.zsw == 0


def test_a_drive_that_boots_has_no_request(sensor: SensorBench) -> None:
    sensor.ask(0x50)
    assert sensor.error() == 0x0F01
    sensor.image.received[G1_STW] = 0
    sensor.command(CMD_POWER_ON)
    sensor.run(1)
    assert sensor.zsw == 0
    sensor.run(150)
    assert sensor.ask(ABSOLUTE) == 0x2000


def test_encoder_2_counts_from_0_behind_a_power_cycle_as_encoder_1_does_if_both_are_incremental() -> None:
    bench = SensorBench()
    for sensor in (bench.axis.sensor, bench.axis.sensor_2):
        sensor.settings.step, sensor.settings.revolutions = STEP, 0.0
    bench.turn(0.5)
    assert bench.image.sent[G2_XIST1] == bench.xist1 == round(0.5 / STEP)
    bench.off_and_on()
    assert bench.image.sent[G2_XIST1] == bench.xist1 == 0


@pytest.mark.parametrize("boots_ms", [0, 100])
def test_a_power_cycle_ends_errors_and_functions_whether_the_drive_takes_time_to_boot_or_not(boots_ms: int) -> None:
    bench = SensorBench()
    bench.axis.boot_time_ns = boots_ms * MS
    assert bench.ask(ACTIVATE | 0x4) == 0x0004
    bench.off_and_on()
    assert bench.zsw == 0
    bench.run(boots_ms)
    bench.write(0x0400)
    assert bench.ask(SET_HOME) & ERROR
    bench.off_and_on()
    bench.run(boots_ms)
    assert (bench.zsw & ERROR, bench.axis.sensor.state) == (0, 1)
