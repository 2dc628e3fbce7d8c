"""The sensor interface of encoder 1: G1_STW, G1_ZSW, G1_XIST1 and G1_XIST2 (PROFIdrive 4.2, 6.3.6).

States as in the profile's state diagram (6.3.6.7), for one encoder:

====  ==========================  ===================================================================
SD1   normal operation            the absolute position on request (G1_STW.13)
SD2   error acknowledgement       G1_STW.15 = 1: G1_ZSW.11
SD3   error                       G1_ZSW.15, the code in G1_XIST2
SD4   reference value             G1_STW.4-6 = 2: the position at a reference mark in G1_XIST2
SD5   wait for a reference mark   G1_STW.4-6 = 1: functions in G1_ZSW.0-3, then their values in G1_ZSW.4-7
SD10  wait for measured values    as SD5 with G1_STW.7 = 1: edges of the probes, measured on the fly
SD11  measured value              as SD4 with G1_STW.7 = 1
SD12  parking                     G1_STW.14 = 1: nothing is evaluated, no error is reported
====  ==========================  ===================================================================

No model here has SD7, which sets or shifts the home position; they refuse it.  Which bits a drive supports, which of
them it refuses, and where its reference marks come from are settings of the axis (``sensor``); the bits and codes are
those of the profile, as Moog MSD manual 11 and HIWIN E1 manual 3.7 and 3.8 repeat them.

One function writes the state: :func:`_advance`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pnfarm.firmware.motor.measurement import measured_position
from pnfarm.firmware.profidrive.sensor_marks import ALL_FUNCTIONS, can_wait, cause_stays, encoder_faulty, look_for_marks
from pnfarm.firmware.transitions import as_array, possible
from pnfarm.firmware.whole_numbers import signed32
from pnfarm.table.axis_codes import SENSOR_PARKING
from pnfarm.table.axis_readings import SETPOINTS_NONE, SETPOINTS_TAKEN
from pnfarm.table.compiling.compiled import compiled, inlined
from pnfarm.table.signals import G1_XIST1, G1_XIST2, G1_ZSW, G2_XIST1, G2_XIST2, G2_ZSW

__all__ = ["ENCODER_1", "ENCODER_2", "PRIORITY", "TRANSITIONS", "forget_sensor", "step_sensor"]

#: Slots of each encoder's status and positions; arrays, because indexing a tuple in compiled code copies it.
ENCODER_1 = np.array((G1_ZSW, G1_XIST1, G1_XIST2), np.int64)
ENCODER_2 = np.array((G2_ZSW, G2_XIST1, G2_XIST2), np.int64)


# States (``sensor.state``); 0 while the drive boots.
START = 0
NORMAL = 1
ACKNOWLEDGING = 2
ERROR = 3
REFERENCE_VALUE = 4
WAIT_MARK = 5
WAIT_MEASURED = 10
MEASURED_VALUE = 11
PARKING = SENSOR_PARKING
STATES = 13

# Events.
BOOTED = 0
PARK = 1  # G1_STW.14 = 1
UNPARK = 2  # G1_STW.14 = 0
TROUBLE = 3  # the encoder fails, or an impossible function is requested
ACKNOWLEDGE = 4  # G1_STW.15 = 1
CLEARED = 5  # G1_STW.15 = 0, and the error is gone
REMAINS = 6  # G1_STW.15 = 0, and the error is still there
SEARCH = 7  # command 1, reference marks
MEASURE = 8  # command 1, on the fly
READ_MARK = 9  # command 2
READ_MEASURED = 10  # command 2, on the fly
CANCELLED = 11  # command 3, and no function remains
IDLE = 12  # command 0, and no function is waiting
WAITS = 13  # command 0, and a function is waiting
EVENTS = 14

#: Row by row as the profile numbers them (6.3.6.7, table of transitions).
TRANSITIONS: dict[tuple[int, int], int] = {
    (START, BOOTED): NORMAL,
    (ACKNOWLEDGING, CLEARED): NORMAL,  # TD1
    (REFERENCE_VALUE, IDLE): NORMAL,  # TD2
    (NORMAL, READ_MARK): REFERENCE_VALUE,  # TD3
    (WAIT_MARK, IDLE): NORMAL,  # TD4
    (WAIT_MARK, CANCELLED): NORMAL,  # TD5
    (NORMAL, SEARCH): WAIT_MARK,  # TD6
    (NORMAL, MEASURE): WAIT_MEASURED,  # TD11
    (WAIT_MEASURED, CANCELLED): NORMAL,  # TD12
    (WAIT_MEASURED, IDLE): NORMAL,  # TD13
    (NORMAL, READ_MEASURED): MEASURED_VALUE,  # TD14
    (MEASURED_VALUE, IDLE): NORMAL,  # TD15
    (MEASURED_VALUE, CANCELLED): NORMAL,  # TD15
    # TD16
    (NORMAL, PARK): PARKING,
    (REFERENCE_VALUE, PARK): PARKING,
    (WAIT_MARK, PARK): PARKING,
    (WAIT_MEASURED, PARK): PARKING,
    (MEASURED_VALUE, PARK): PARKING,
    (PARKING, UNPARK): NORMAL,  # TD17
    # TD20
    (NORMAL, TROUBLE): ERROR,
    (REFERENCE_VALUE, TROUBLE): ERROR,
    (WAIT_MARK, TROUBLE): ERROR,
    (WAIT_MEASURED, TROUBLE): ERROR,
    (MEASURED_VALUE, TROUBLE): ERROR,
    (ERROR, ACKNOWLEDGE): ACKNOWLEDGING,  # TD21
    (ACKNOWLEDGING, REMAINS): ERROR,  # TD22
    # TD23
    (ERROR, PARK): PARKING,
    (ACKNOWLEDGING, PARK): PARKING,
    (WAIT_MEASURED, MEASURE): WAIT_MEASURED,  # TD31
    (WAIT_MEASURED, READ_MEASURED): MEASURED_VALUE,  # TD32
    (MEASURED_VALUE, MEASURE): WAIT_MEASURED,  # TD33
    (MEASURED_VALUE, WAITS): WAIT_MEASURED,  # TD33
    (MEASURED_VALUE, READ_MEASURED): MEASURED_VALUE,  # TD34
    # assumed: a mark that was found may be read without command 0 in between, as most controllers do
    (WAIT_MARK, READ_MARK): REFERENCE_VALUE,
}

#: Priority of events that hold together.
PRIORITY = (
    BOOTED, PARK, UNPARK, TROUBLE, ACKNOWLEDGE, CLEARED, REMAINS, CANCELLED, READ_MARK, READ_MEASURED, SEARCH, MEASURE,
    IDLE, WAITS,
)  # fmt: skip

# Bits of G1_STW and G1_ZSW.
COMMAND = 0x0070
COMMAND_SHIFT = 4
ON_THE_FLY = 0x0080
SET_HOME = 0x1000
ABSOLUTE = 0x2000
PARK_BIT = 0x4000
ERROR_BIT = 0x8000
VALUE_SHIFT = 4
PROBE_SHIFT = 8
ACKNOWLEDGED = 0x0800

ACTIVATE = 1
READ = 2
CANCEL = 3

# Codes in G1_XIST2 (6.3.6.3, table of error codes).
SENSOR_ERROR = 0x0001
PARKING_FAILED = 0x0003
SEARCH_ABORTED = 0x0004
NO_REFERENCE_VALUE = 0x0005
MEASURING_ABORTED = 0x0006
NO_MEASURED_VALUE = 0x0007
NO_ABSOLUTE_VALUE = 0x0008
NOT_SUPPORTED = 0x0F01


# Sets of events and of states.
ACTIVATES = 1 << SEARCH | 1 << MEASURE
READS = 1 << READ_MARK | 1 << READ_MEASURED
ENDS = 1 << IDLE | 1 << WAITS | 1 << CANCELLED
WAITING = 1 << WAIT_MARK | 1 << WAIT_MEASURED
SHOWS_ABSOLUTE = 1 << NORMAL | 1 << WAIT_MEASURED
SHOWS_VALUE = 1 << REFERENCE_VALUE | 1 << MEASURED_VALUE

_NEXT = as_array(TRANSITIONS, STATES, EVENTS)
_POSSIBLE = possible(TRANSITIONS, STATES)
_PRIORITY = np.array(PRIORITY, np.int64)


@inlined
def _activation_error(sensor: Any, word: int, probing: int) -> int:
    """Error code of activating the functions of ``word``, 0 for none."""
    aborted = MEASURING_ABORTED if probing else SEARCH_ABORTED
    if 1 << int(sensor.state) & WAITING and probing != sensor.probing:
        return MEASURING_ABORTED if sensor.probing else SEARCH_ABORTED
    for function in range(4):
        if word & (1 << function) and not can_wait(sensor, function, probing):
            return aborted
    return 0


@inlined
def _reading_error(sensor: Any, word: int, probing: int) -> int:
    """Error code of reading the value that ``word`` requests, 0 for none: one value at a time, and only if found."""
    if sensor.state == WAIT_MARK and sensor.active:
        return SEARCH_ABORTED
    if sensor.state == WAIT_MEASURED and not probing:
        return MEASURING_ABORTED
    wanted = word & ALL_FUNCTIONS
    single = wanted != 0 and wanted & (wanted - 1) == 0
    if single and wanted & int(sensor.found) and probing == sensor.probing:
        return 0
    return NO_MEASURED_VALUE if probing else NO_REFERENCE_VALUE


@inlined
def _trouble(drive: Any, sensor: Any, word: int) -> int:
    """Error code of this step, 0 for none."""
    if sensor.error:
        return int(sensor.error)
    if word & PARK_BIT and drive.state >= 4:
        return PARKING_FAILED
    command = (word & COMMAND) >> COMMAND_SHIFT
    probing = 1 if word & ON_THE_FLY else 0
    refused = int(sensor.settings.refused)
    if command > CANCEL or word & refused & SET_HOME or (command and word & refused & ON_THE_FLY):
        return NOT_SUPPORTED
    if word & refused & ABSOLUTE:
        return NO_ABSOLUTE_VALUE
    if command == ACTIVATE and sensor.state != REFERENCE_VALUE:
        return _activation_error(sensor, word, probing)
    if command == READ and sensor.state != REFERENCE_VALUE:
        return _reading_error(sensor, word, probing)
    return 0


@compiled
def _held(drive: Any, sensor: Any, word: int, trouble: int) -> int:
    """The events that hold now, as a bit set."""
    held = 0
    if drive.state != 0:
        held |= 1 << BOOTED
    if not word & PARK_BIT:
        held |= 1 << UNPARK
    elif drive.state < 4:
        held |= 1 << PARK
    if trouble:
        held |= 1 << TROUBLE
    if word & ERROR_BIT:
        held |= 1 << ACKNOWLEDGE
    else:
        held |= 1 << (REMAINS if sensor.error else CLEARED)
    command = (word & COMMAND) >> COMMAND_SHIFT
    if command == ACTIVATE and word & ALL_FUNCTIONS:
        held |= 1 << (MEASURE if word & ON_THE_FLY else SEARCH)
    elif command == READ and word & ALL_FUNCTIONS:
        held |= 1 << (READ_MEASURED if word & ON_THE_FLY else READ_MARK)
    elif command == CANCEL and not sensor.active:
        held |= 1 << CANCELLED
    elif command == 0:
        held |= 1 << (WAITS if sensor.active else IDLE)
    return held


@inlined
def _forget(sensor: Any) -> None:
    """Clear all active functions and values."""
    sensor.active = 0
    sensor.found = 0
    sensor.read = 0


@inlined
def _activate(sensor: Any, word: int) -> None:
    """Activate the functions of ``word``; values of the other kind are dropped."""
    probing = 1 if word & ON_THE_FLY else 0
    if probing != sensor.probing:
        _forget(sensor)
    sensor.probing = probing
    wanted = word & ALL_FUNCTIONS
    sensor.active = int(sensor.active) | wanted
    sensor.found = int(sensor.found) & ~wanted & ALL_FUNCTIONS


@inlined
def _read_value(sensor: Any, word: int) -> None:
    for function in range(4):
        if word & (1 << function):
            sensor.read = function + 1


@inlined
def _value_taken(sensor: Any) -> None:
    """Drop the value that the controller has read."""
    if sensor.read:
        sensor.found = int(sensor.found) & ~(1 << (int(sensor.read) - 1)) & ALL_FUNCTIONS
        sensor.read = 0


@compiled
def _advance(sensor: Any, held: int, word: int, before: int, trouble: int) -> None:
    """Take at most one transition and carry out its action: the only writer of ``sensor.state``."""
    held &= _POSSIBLE[sensor.state]
    if held == 0:
        return
    for event in _PRIORITY:
        if not held & (1 << event):
            continue
        following = _NEXT[sensor.state, event]
        again = sensor.state == following
        if 1 << event & ACTIVATES:
            # a command that stays set is carried out once
            if not again or (word ^ before) & COMMAND:
                _value_taken(sensor)
                _activate(sensor, word)
        elif 1 << event & READS:
            if not again or (word ^ before) & COMMAND:
                _value_taken(sensor)
                _read_value(sensor, word)
        elif 1 << event & ENDS:
            _value_taken(sensor)
        elif event == TROUBLE:
            sensor.error = trouble
            _forget(sensor)
        elif event == PARK:
            sensor.error = 0
            _forget(sensor)
        sensor.state = following
        return


@inlined
def _cancel(sensor: Any, word: int) -> None:
    """Command 3: cancel the functions of ``word``, or all if it names none."""
    if (word & COMMAND) >> COMMAND_SHIFT == CANCEL:
        wanted = word & ALL_FUNCTIONS or ALL_FUNCTIONS
        sensor.active = int(sensor.active) & ~wanted & ALL_FUNCTIONS
        sensor.found = int(sensor.found) & ~wanted & ALL_FUNCTIONS


@compiled
def _status(machine: Any, sensor: Any, word: int) -> int:
    """G1_ZSW."""
    state = int(sensor.state)
    if state == PARKING:
        return PARK_BIT & int(sensor.settings.status_bits)
    # signed, or the loop would make a float of it
    status = np.int64(sensor.active) | np.int64(sensor.found) << VALUE_SHIFT
    for probe in range(2):
        if int(machine.inputs) & int(sensor.settings.probe_inputs[probe]):
            status |= 1 << (PROBE_SHIFT + probe)
    if state == ACKNOWLEDGING:
        status |= ACKNOWLEDGED
    if sensor.error:
        status |= ERROR_BIT
    elif _sends_absolute(state, word):
        status |= ABSOLUTE
    return int(status) & int(sensor.settings.status_bits)


@inlined
def _sends_absolute(state: int, word: int) -> bool:
    return word & ABSOLUTE != 0 and 1 << state & SHOWS_ABSOLUTE != 0


@compiled
def _count(sensor: Any, place: float, step: float) -> int:
    """The encoder's count at a shaft position."""
    return signed32(round((place - sensor.zero) / step))


@inlined
def _second_value(motor: Any, sensor: Any, measurement: Any, word: int) -> int:
    """G1_XIST2: an error's code, else a value that is read, else the absolute position."""
    step = sensor.settings.step_2 if sensor.settings.step_2 > 0.0 else sensor.settings.step
    state = int(sensor.state)
    if sensor.error:
        return int(sensor.error)
    if state == ACKNOWLEDGING or step <= 0.0:
        return 0
    if 1 << state & SHOWS_VALUE:
        return _count(sensor, sensor.value[int(sensor.read) - 1], step)
    if _sends_absolute(state, word) or sensor.settings.shows:
        return _count(sensor, measured_position(motor, measurement), step)
    return 0


@inlined
def _control_word(profidrive: Any, sensor: Any, received: int) -> int:
    """G1_STW in force: 0 without valid set points, the last one while set points are held."""
    if profidrive.setpoints == SETPOINTS_NONE:
        return 0
    if (
        profidrive.setpoints != SETPOINTS_TAKEN
        or profidrive.settings.control_location != profidrive.settings.bus_location
    ):
        return int(sensor.stw)
    return received & int(sensor.settings.bits)


@inlined
def _watch_encoder(faults: Any, sensor: Any) -> None:
    """Report a failing encoder as an error until acknowledged; not while it is parked."""
    faulty = encoder_faulty(faults, sensor)
    parked = sensor.state == PARKING
    if not parked and sensor.error == 0 and (cause_stays(faults, sensor) or (faulty and not sensor.faulty)):
        sensor.error = SENSOR_ERROR
        _forget(sensor)
    sensor.faulty = 1 if faulty else 0
    if sensor.state == ACKNOWLEDGING and not (sensor.error == SENSOR_ERROR and cause_stays(faults, sensor)):
        sensor.error = 0


@inlined
def forget_sensor(sensor: Any) -> None:
    """The drive was switched on, or boots still: no request, no error."""
    sensor.state = START
    sensor.stw = 0
    sensor.error = 0
    _forget(sensor)


@inlined
def step_sensor(axis: Any, sensor: Any, image: Any, received: int, slots: Any) -> None:
    """Once in each firmware step, after the motor: carry out an encoder's control word, update status and positions.

    ``received`` is its control word, ``slots`` are those of G1_ZSW, G1_XIST1 and G1_XIST2, or of encoder 2.
    """
    if sensor.settings.bits == 0:
        # no sensor interface: positions only
        if sensor.settings.step > 0.0:
            image.sent[slots[1]] = _count(sensor, measured_position(axis.motor, axis.measurement), sensor.settings.step)
        if sensor.settings.step_2 > 0.0:
            image.sent[slots[2]] = _count(
                sensor, measured_position(axis.motor, axis.measurement), sensor.settings.step_2
            )
        return
    if axis.drive.state == 0:
        forget_sensor(sensor)
    before = int(sensor.stw)
    word = _control_word(axis.profidrive, sensor, received)
    sensor.stw = word
    _watch_encoder(axis.faults, sensor)
    _cancel(sensor, word)
    trouble = _trouble(axis.drive, sensor, word)
    _advance(sensor, _held(axis.drive, sensor, word, trouble), word, before, trouble)
    look_for_marks(axis.machine, axis.motor, sensor)
    sensor.position = axis.motor.measured_position
    sensor.inputs = axis.machine.inputs
    image.sent[slots[0]] = _status(axis.machine, sensor, word)
    if sensor.state == PARKING:
        image.sent[slots[1]] = 0
        image.sent[slots[2]] = 0
        return
    step = sensor.settings.step
    image.sent[slots[1]] = _count(sensor, measured_position(axis.motor, axis.measurement), step) if step > 0.0 else 0
    image.sent[slots[2]] = _second_value(axis.motor, sensor, axis.measurement, word)
