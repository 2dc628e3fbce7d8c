"""The built-in controller's program of one axis whose commands are assemblies (AKD EtherNet/IP manual 6.2 to 6.6).

It sets the operating mode while the drive is disabled (attribute 3), enables, and loads commands by the handshake of
6.2.4: a jog for each new speed, homing (attribute 0x65) and a position move for each target.  A speed that changes all
the time is loaded as fast as the handshake goes, about four packet intervals each.  A fault is cleared by the command
that writes DRV.CLRFAULTS (6.2.2.7, 6.6), while Enable is withdrawn.
"""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.ethernetip.control_word import DIRECTION, ENABLE, LOAD
from pnfarm.firmware.ethernetip.message_types import (
    AXIS,
    ERROR_TYPE,
    JOG_MOVE,
    PARAMETER,
    POSITION_MOVE,
    SET_ATTRIBUTE,
)
from pnfarm.firmware.ethernetip.octets import put, received_octet
from pnfarm.firmware.ethernetip.status import ENABLED, GENERAL_FAULT, HOMED, IN_MOTION, IN_POSITION, LOAD_COMPLETE
from pnfarm.firmware.program_steps import begin_leg, enter, runs, speed_of
from pnfarm.firmware.whole_numbers import clamp32
from pnfarm.table.compiling.compiled import compiled, inlined
from pnfarm.table.program import (
    ACKNOWLEDGING,
    FAULTED,
    LEG_DWELLING,
    LEG_HOMING,
    LEG_LOADING,
    LEG_MOVING,
    LOAD_DONE,
    LOAD_HIGH,
    LOAD_LOW,
    LOAD_NONE,
    LOAD_REFUSED,
    OFFLINE,
    POSITIONS,
    RUNNING,
    STOPPED,
    SWITCHING_ON,
)
from pnfarm.table.signals import ASSEMBLY, ASSEMBLY_WORDS

__all__ = ["step_program"]

#: The operating mode: attribute and its values (7.1), in the position controller's own numbers.
MODE = 3
POSITION_MODE = 0
VELOCITY_MODE = 1
#: Attribute that starts homing (6.4.2).
START_HOME = 0x65
#: Octet of the data of an attribute or a parameter, and of the number of these; octet 6 is 1 for a write.
VALUE = 24
NUMBER = 4
WRITE = 6

#: Before a command that was refused is loaded again.
RETRY_NS = 500_000_000
#: A command without an answer is given up after this time: a parameter may take up to 5 s (manual 3).
ANSWER_NS = 10_000_000_000
#: Before the next attempt to clear a fault that was not cleared.
CLEAR_NS = 1_000_000_000
#: Enable has to rise: of a drive that does not follow it, it is cleared after this time, and set again.
ENABLE_NS = 2_000_000_000
EDGE_NS = 200_000_000
#: An axis that was told to home and has been at rest for so long does not: it is told again.
REST_NS = 4_000_000_000


@inlined
def _loading(program: Any, leg: int, now: int) -> None:
    program.loading = leg
    program.loading_ns = now


@compiled
def _enter(program: Any, phase: int, now: int) -> None:
    """Be in this phase; the command of another one is not loaded any more."""
    if program.phase != phase:
        _loading(program, LOAD_NONE, now)
        enter(program, phase, now)


@compiled
def _show(program: Any, image: Any, kind: int) -> None:
    """The type of a command, whose data follow."""
    program.command = kind
    put(image, 2, 1, kind)


@inlined
def _begin(program: Any, image: Any, kind: int, now: int) -> None:
    """Load a command, or go on with it."""
    _show(program, image, kind)
    if program.loading == LOAD_NONE:
        _loading(program, LOAD_LOW, now)


@compiled
def _answer(program: Any, image: Any, now: int) -> None:
    """The handshake goes on with what the drive answers."""
    complete = received_octet(image, 2) & LOAD_COMPLETE
    failed = received_octet(image, 3) & 0x1F == ERROR_TYPE
    if program.loading == LOAD_LOW:
        if not complete and not failed:
            _loading(program, LOAD_HIGH, now)
    elif program.loading == LOAD_HIGH:
        if complete:
            _loading(program, LOAD_DONE, now)
        elif failed:
            program.refused += 1
            program.error = received_octet(image, 4) | received_octet(image, 5) << 8
            _loading(program, LOAD_REFUSED, now)
        elif now - program.loading_ns >= ANSWER_NS:
            _loading(program, LOAD_REFUSED, now)
    elif program.loading == LOAD_REFUSED and now - program.loading_ns >= RETRY_NS:
        _loading(program, LOAD_NONE, now)


@inlined
def _taken(program: Any, now: int) -> bool:
    """Whether the drive took the command; the next one may be loaded."""
    if program.loading != LOAD_DONE:
        return False
    _loading(program, LOAD_NONE, now)
    return True


@inlined
def _set_attribute(program: Any, image: Any, number: int, value: int, now: int) -> bool:
    """Set an attribute of the position controller; whether it is set."""
    _begin(program, image, SET_ATTRIBUTE, now)
    put(image, NUMBER, 2, number)
    put(image, VALUE, 8, value)
    return _taken(program, now)


@inlined
def _put_ramps(program: Any, image: Any, up: float, down: float) -> None:
    """Acceleration and deceleration of a motion, which have to be more than 0."""
    put(image, 16, 4, max(1, clamp32(up / program.ramp_step)))
    put(image, 20, 4, max(1, clamp32(down / program.ramp_step)))


@compiled
def _run(program: Any, image: Any, now: int) -> int:
    """An axis that follows a speed; its bits of the control word."""
    if _taken(program, now):
        program.speed_set = 1
    if program.loading == LOAD_NONE:
        units = clamp32(speed_of(program, now) / program.velocity_step)
        if not program.speed_set or units != program.speed_units:
            program.speed_set = 0
            program.speed_units = units
            _loading(program, LOAD_LOW, now)
    _show(program, image, JOG_MOVE)
    put(image, 12, 4, min(abs(int(program.speed_units)), 0x7FFFFFFF))
    _put_ramps(program, image, program.speed_up, program.speed_down)
    return DIRECTION if program.speed_units >= 0 else 0


@compiled
def _position(program: Any, image: Any, status: int, now: int) -> None:
    """An axis that is homed and goes from target to target (6.4)."""
    if program.leg == LEG_HOMING:
        if status & HOMED and program.loading != LOAD_HIGH:
            _loading(program, LOAD_NONE, now)
            begin_leg(program, LEG_LOADING, now)
        elif not program.homing_set:
            program.homing_set = 1 if _set_attribute(program, image, START_HOME, 1, now) else 0
            program.leg_ns = now
        elif status & IN_MOTION:
            program.leg_ns = now
        elif now - program.leg_ns >= REST_NS:
            program.homing_set = 0
    elif program.leg == LEG_LOADING:
        _begin(program, image, POSITION_MOVE, now)
        put(image, 8, 4, clamp32(program.targets[program.target_index] / program.target_step))
        put(image, 12, 4, clamp32(abs(program.speed) / program.velocity_step))
        _put_ramps(program, image, program.acceleration, program.acceleration)
        if _taken(program, now):
            begin_leg(program, LEG_MOVING, now)
    elif program.leg == LEG_MOVING:
        if status & (IN_POSITION | IN_MOTION) == IN_POSITION:
            program.moves += 1
            begin_leg(program, LEG_DWELLING, now)
    elif program.leg == LEG_DWELLING and now - program.leg_ns >= program.dwell_ns:
        program.target_index = (program.target_index + 1) % max(1, int(program.target_count))
        begin_leg(program, LEG_LOADING, now)


@inlined
def _clear(program: Any, image: Any, now: int) -> None:
    """Write DRV.CLRFAULTS; the phase begins anew with the answer."""
    _begin(program, image, PARAMETER, now)
    put(image, NUMBER, 2, int(program.clear_number))
    put(image, WRITE, 1, 1)
    put(image, VALUE, 8, 1)
    if program.loading == LOAD_REFUSED or _taken(program, now):
        _loading(program, LOAD_NONE, now)
        program.phase_ns = now


@compiled
def _fault(program: Any, image: Any, now: int) -> None:
    """Enable is withdrawn; after the user's time the fault is cleared."""
    if program.phase == ACKNOWLEDGING:
        if program.loading != LOAD_NONE:
            _clear(program, image, now)
        elif now - program.phase_ns >= CLEAR_NS:
            _enter(program, FAULTED, now)
    elif program.phase != FAULTED:
        program.faults += 1
        if program.fault_ns == 0:
            program.fault_ns = now
        _enter(program, FAULTED, now)
    elif 0 <= program.acknowledge_after_ns <= now - program.phase_ns:
        _enter(program, ACKNOWLEDGING, now)
        _clear(program, image, now)


@inlined
def _switch_on(program: Any, image: Any, status: int, now: int) -> int:
    """Enable, once the mode is set; a drive that is enabled already is disabled for that."""
    _enter(program, SWITCHING_ON, now)
    if not program.mode_set:
        if not status & ENABLED:
            mode = POSITION_MODE if program.kind == POSITIONS else VELOCITY_MODE
            if _set_attribute(program, image, MODE, mode, now):
                program.mode_set = 1
                program.phase_ns = now
        return 0
    return 0 if (now - program.phase_ns) % (ENABLE_NS + EDGE_NS) >= ENABLE_NS else ENABLE


@compiled
def _start(program: Any, now: int) -> None:
    """The axis came into operation."""
    _loading(program, LOAD_NONE, now)
    program.speed_set = 0
    program.homing_set = 0
    begin_leg(program, LEG_HOMING, now)
    runs(program, now)


@compiled
def _measure(program: Any, image: Any, control: int, status: int, now: int) -> None:
    """The times from a changed Enable to the drive's changed status; keeps both words."""
    if program.asked_ns != 0 and (status ^ int(program.zsw1)) & (ENABLED | GENERAL_FAULT):
        program.reaction_ns = now - program.asked_ns
        program.reaction_max_ns = max(program.reaction_max_ns, program.reaction_ns)
        program.asked_ns = 0
    if (control ^ int(program.stw1)) & ENABLE and image.valid:
        program.asked_ns = now
    program.zsw1 = status
    program.stw1 = control


@compiled
def step_program(program: Any, image: Any, now: int) -> None:
    """Evaluate the response assembly, write the command assembly."""
    for word in range(ASSEMBLY_WORDS):
        image.sent[ASSEMBLY + word] = 0
    program.command = 0
    control = 0
    status = 0
    if not image.valid:
        _enter(program, OFFLINE, now)
        # the drive may be another one when it comes back
        program.mode_set = 0
    else:
        status = received_octet(image, 0)
        _answer(program, image, now)
        if status & GENERAL_FAULT:
            _fault(program, image, now)
        elif not program.enable:
            _enter(program, STOPPED, now)
        elif status & ENABLED and program.mode_set:
            control = ENABLE
            if program.phase != RUNNING:
                _start(program, now)
            if program.kind == POSITIONS:
                _position(program, image, status, now)
            else:
                control |= _run(program, image, now)
        else:
            control = _switch_on(program, image, status, now)
        status |= received_octet(image, 2) << 8
    if program.loading == LOAD_HIGH:
        control |= LOAD
    put(image, 0, 1, control)
    put(image, 2, 1, AXIS << 5)
    put(image, 3, 1, AXIS << 5)
    _measure(program, image, control | int(program.command) << 8, status, now)
