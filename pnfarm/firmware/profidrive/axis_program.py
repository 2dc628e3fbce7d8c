"""The built-in controller's program of one axis: switch on, run a speed or go to positions, acknowledge faults.

It walks the drive through the states as PROFIdrive asks (AKD PROFINET manual 5.9: 0x0476, 0x0477, 0x047F):
bit 0 is cleared in S1 to leave the switching-on inhibit, also after a fault.
"""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.profidrive.objects import INFEED_CONTROL, STATELESS_CONTROL
from pnfarm.firmware.profidrive.real_words import DEGREES, DEGREES_A_SECOND, PERCENT, bits_of
from pnfarm.firmware.profidrive.tasks import WHOLE
from pnfarm.firmware.profidrive.telegram import clamp16, clamp_unsigned, long_step
from pnfarm.firmware.program_steps import begin_leg, enter, runs, speed_of
from pnfarm.firmware.whole_numbers import clamp32
from pnfarm.table.axis_codes import (
    CONFIG_RISING_EDGE,
    MDI_SELECTED,
    OBJECT_AXIS,
    OBJECT_CONTROL_UNIT,
    OBJECT_ENCODER,
    OBJECT_INFEED,
    TASKS_TARPOS,
)
from pnfarm.table.compiling.compiled import compiled, inlined
from pnfarm.table.program import (
    ACKNOWLEDGING,
    FAULTED,
    LEG_DWELLING,
    LEG_HOMING,
    LEG_LOADING,
    LEG_MOVING,
    LEG_STARTED,
    OFFLINE,
    POSITIONS,
    PYTHON,
    RUNNING,
    STOPPED,
    SWITCHING_ON,
)
from pnfarm.table.signals import (
    DRV_ACC,
    DRV_DEC,
    MDI_ACC,
    MDI_DEC,
    MDI_MOD,
    MDI_TARPOS,
    MDI_VELOCITY,
    NSOLL_A,
    NSOLL_B,
    OVERRIDE,
    POS_STW1,
    SATZANW,
    STW1,
    STW2,
    TARPOS_A,
    VELOCITY_A,
    ZSW1,
    ZSW2,
)

__all__ = ["step_program"]

READY = 0x0476  # OFF, nothing stopped, ramp generator working, control by PLC
ON = 0x0477
RUN = 0x047F
ACKNOWLEDGE = 0x0080
#: Position mode: as RUN without STW1.6, whose edges start tasks.
POSITION = 0x043F
START_TASK = 0x0040
START_HOMING = 0x0800
#: Of ZSW1 in position mode.
TARGET_REACHED = 0x0400
HOME_POSITION_SET = 0x0800
TASK_ACKNOWLEDGED = 0x1000
AT_REST = 0x2000
#: SATZANW.15 and POS_STW1.15, POS_STW1.8; OVERRIDE of 100 %.
POS_ABSOLUTE = 0x0100
WHOLE_OVERRIDE = 0x4000

#: Fault and warning.
STATELESS_STATUS = 0x0088
#: Bits of ZSW1 that respond to a control word: state (0, 1, 2, 6), fault (3), stops (4, 5).
STATE_BITS = 0x007F
#: How long STW1.7 stays set before the next attempt to acknowledge a fault that was not cleared.
RETRY_NS = 1_000_000_000
#: A drive that left operation while its frames did not arrive may wait for STW1.3 to rise (Moog MSD, P-0144).
#: After this time without operation the bit is cleared, and set again after the same time.
EDGE_AFTER_NS = 4_000_000_000
EDGE_NS = 1_000_000_000
#: An axis that has been at rest for so long does not home, does not take its task, or was stopped on its way, by a
#: limit switch for example.  The bit that starts this is cleared, and set again after the time of an edge.
REST_NS = 4_000_000_000


@inlined
def _stateless(program: Any) -> bool:
    """Whether the axis is an encoder or a control unit, which run as soon as they are there."""
    return program.object in (OBJECT_ENCODER, OBJECT_CONTROL_UNIT)


@inlined
def _status(program: Any, image: Any) -> int:
    """ZSW1, or the bits of it that the telegram's status word has."""
    return image.received[ZSW2] & STATELESS_STATUS if _stateless(program) else image.received[ZSW1] & 0xFFFF


@inlined
def _write_task(program: Any, image: Any) -> None:
    """Write the current target to the signals of the telegram's form."""
    target = clamp32(program.targets[program.target_index] / program.target_step)
    velocity = abs(program.speed) / program.task_velocity_step
    if program.task_form == TASKS_TARPOS:
        image.sent[TARPOS_A] = target
        image.sent[VELOCITY_A] = clamp32(velocity)
        image.sent[DRV_ACC] = clamp_unsigned(program.acceleration / program.ramp_step)
        image.sent[DRV_DEC] = clamp_unsigned(program.acceleration / program.ramp_step)
        return
    most = 0x7FFF if program.task_ramps_signed else 0xFFFF
    up = min(most, clamp_unsigned(program.acceleration / program.task_acceleration_step))
    down = min(most, clamp_unsigned(program.acceleration / program.task_deceleration_step))
    if program.real_tasks:
        image.sent[MDI_TARPOS] = bits_of(program.targets[program.target_index] * DEGREES)
        image.sent[MDI_VELOCITY] = bits_of(abs(program.speed) * DEGREES_A_SECOND)
        image.sent[MDI_ACC] = bits_of(up / WHOLE * PERCENT)
        image.sent[MDI_DEC] = bits_of(down / WHOLE * PERCENT)
    else:
        image.sent[MDI_TARPOS] = target
        image.sent[MDI_VELOCITY] = clamp32(velocity)
        image.sent[MDI_ACC] = up
        image.sent[MDI_DEC] = down
    image.sent[MDI_MOD] = 1
    image.sent[SATZANW] = MDI_SELECTED
    image.sent[POS_STW1] = MDI_SELECTED | POS_ABSOLUTE
    image.sent[OVERRIDE] = WHOLE_OVERRIDE


@compiled
def _position(program: Any, image: Any, zsw1: int, now: int) -> int:
    """STW1 of an axis in operation that goes from target to target (AKD PROFINET manual 5.10.2, the handshake)."""
    _write_task(program, image)
    toggles = not program.control_config & CONFIG_RISING_EDGE
    if program.leg != LEG_DWELLING and (zsw1 & AT_REST != 0) == (program.moving_bit != 0):
        program.leg_ns = now
    rest_ns = now - program.leg_ns
    if program.leg == LEG_HOMING:
        if not zsw1 & HOME_POSITION_SET:
            return POSITION if rest_ns % (REST_NS + EDGE_NS) >= REST_NS else POSITION | START_HOMING
        begin_leg(program, LEG_LOADING, now)
    elif program.leg == LEG_LOADING:
        if toggles or not zsw1 & TASK_ACKNOWLEDGED:
            program.acknowledged = zsw1 & TASK_ACKNOWLEDGED
            program.start_bit ^= START_TASK
            begin_leg(program, LEG_STARTED, now)
    elif program.leg == LEG_STARTED:
        if (zsw1 & TASK_ACKNOWLEDGED) != program.acknowledged:
            if not toggles:
                program.start_bit = 0
            begin_leg(program, LEG_MOVING, now)
        elif rest_ns >= REST_NS:
            if not toggles:
                program.start_bit = 0
            if rest_ns >= REST_NS + EDGE_NS:
                begin_leg(program, LEG_HOMING, now)
    elif program.leg == LEG_MOVING:
        if zsw1 & TARGET_REACHED and (toggles or not zsw1 & TASK_ACKNOWLEDGED):
            program.moves += 1
            begin_leg(program, LEG_DWELLING, now)
        elif rest_ns >= REST_NS:
            begin_leg(program, LEG_HOMING, now)
    elif now - program.leg_ns >= program.dwell_ns:
        program.target_index = (program.target_index + 1) % max(1, int(program.target_count))
        begin_leg(program, LEG_LOADING, now)
    return POSITION | program.start_bit


@compiled
def _measure(program: Any, image: Any, stw1: int, zsw1: int, now: int) -> None:
    """The times from a changed control word to the drive's changed status; keeps both words."""
    if program.asked_ns != 0 and (zsw1 ^ int(program.zsw1)) & STATE_BITS:
        program.reaction_ns = now - program.asked_ns
        program.reaction_max_ns = max(program.reaction_max_ns, program.reaction_ns)
        program.asked_ns = 0
    if stw1 != program.stw1 and image.valid:
        program.asked_ns = now
    program.zsw1 = zsw1
    program.stw1 = stw1


@compiled
def _follow(program: Any, image: Any, now: int) -> None:
    """Phase and measures of an axis whose set points a user's program writes."""
    stateless = _stateless(program)
    stw1 = image.sent[STW2] & STATELESS_CONTROL if stateless else image.sent[STW1] & 0xFFFF
    zsw1 = 0
    if not image.valid:
        enter(program, OFFLINE, now)
    else:
        zsw1 = _status(program, image)
        if zsw1 & 0x0008:
            if program.phase not in (FAULTED, ACKNOWLEDGING):
                program.faults += 1
                if program.fault_ns == 0:
                    program.fault_ns = now
            enter(program, ACKNOWLEDGING if stw1 & ACKNOWLEDGE else FAULTED, now)
        elif zsw1 & 0x0004 or stateless:
            if program.phase != RUNNING:
                runs(program, now)
        elif stw1 & 0x0001:
            enter(program, SWITCHING_ON, now)
        else:
            enter(program, STOPPED, now)
    _measure(program, image, stw1, zsw1, now)


@compiled
def step_program(program: Any, image: Any, now: int) -> None:
    """Evaluate ZSW1, write STW1 and the velocity set points; count the sign of life with each frame sent."""
    if program.kind == PYTHON:
        _follow(program, image, now)
        return
    stw1 = READY
    speed = 0.0
    if not image.valid:
        enter(program, OFFLINE, now)
        zsw1 = 0
    else:
        zsw1 = _status(program, image)
        if zsw1 & 0x0008:
            if program.phase == ACKNOWLEDGING:
                if now - program.phase_ns < RETRY_NS:
                    stw1 |= ACKNOWLEDGE
                else:
                    enter(program, FAULTED, now)
            elif program.phase != FAULTED:
                program.faults += 1
                if program.fault_ns == 0:
                    program.fault_ns = now
                enter(program, FAULTED, now)
            elif 0 <= program.acknowledge_after_ns <= now - program.phase_ns:
                stw1 |= ACKNOWLEDGE
                enter(program, ACKNOWLEDGING, now)
        elif not program.enable:
            enter(program, STOPPED, now)
        elif zsw1 & 0x0004 or _stateless(program):
            stw1 = RUN
            if program.phase != RUNNING:
                begin_leg(program, LEG_HOMING, now)
                program.start_bit = 0
                runs(program, now)
            if program.kind == POSITIONS and program.object == OBJECT_AXIS:
                stw1 = _position(program, image, zsw1, now)
            else:
                speed = speed_of(program, now)
        else:
            enter(program, SWITCHING_ON, now)
            if zsw1 & 0x0002 and (now - program.phase_ns) % (EDGE_AFTER_NS + EDGE_NS) >= EDGE_AFTER_NS:
                stw1 = ON
            elif zsw1 & 0x0002:
                stw1 = POSITION if program.kind == POSITIONS else RUN
            elif zsw1 & 0x0001:
                stw1 = ON
    life = (1 + int(image.filled) % 15) << 12 if program.life else 0
    if _stateless(program):
        stw1 &= STATELESS_CONTROL
        _measure(program, image, stw1, zsw1, now)
        image.sent[STW2] = stw1 | life
        return
    if program.object == OBJECT_INFEED:
        stw1 &= INFEED_CONTROL
    _measure(program, image, stw1, zsw1, now)
    image.sent[STW1] = stw1
    image.sent[NSOLL_A] = clamp16(speed / program.velocity_step) if program.velocity_step > 0.0 else 0
    step = long_step(program.velocity_step, program.velocity_step_b)
    image.sent[NSOLL_B] = clamp32(speed / step) if step > 0.0 else 0
    if program.life:
        image.sent[STW2] = life
