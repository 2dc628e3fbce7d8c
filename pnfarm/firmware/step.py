"""One step of an axis: the controller's requests, faults, state machine, ramp, motor, and the reported status.

Requests and status are words of the axis' front; everything between is the same for all fronts.
"""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.direction import shaft_sign, take_direction
from pnfarm.firmware.faults import take_commands
from pnfarm.firmware.front import show_state, take_orders
from pnfarm.firmware.interlocks import take_interlocks, with_interlocks
from pnfarm.firmware.machine import take_switches
from pnfarm.firmware.motion.jog import take_jog
from pnfarm.firmware.motion.positioning import take_motion
from pnfarm.firmware.motion.ramp import velocity_command
from pnfarm.firmware.motion.service_motion import step_service
from pnfarm.firmware.motor.measurement import measure
from pnfarm.firmware.motor.motor import brake_holds, constants_of, motor_step_ns, step_motor, watch_motor
from pnfarm.firmware.own_warnings import watch_warnings
from pnfarm.firmware.state_machine import advance, conditions
from pnfarm.table.axis_codes import (
    DISABLE_AT_ONCE,
    FAULT_SLOTS,
    POWER_ENABLE,
    POWER_NO_COAST,
    POWER_NO_QUICK_STOP,
    POWER_ON,
    REACTION_QUICK_STOP,
)
from pnfarm.table.compiling.compiled import compiled_apart, inlined

__all__ = ["step"]


#: Longest time that a step covers, ns: the loop may have been held up.
LONGEST_NS = 1_000_000_000


@inlined
def _power_in_force(drive: Any, orders: Any, commands: Any, reaction: int) -> int:
    """POWER_* as the state machine sees it: a fault reaction runs to its end, and a parameter may disable the axis."""
    power = int(orders.power)
    if drive.state == 5 and drive.stop == 3 and not orders.led:
        # losing the controller meanwhile does not turn the reaction into coasting; a coast stop order does
        power |= POWER_NO_COAST | POWER_NO_QUICK_STOP
    elif drive.state == 4 and reaction:
        power = POWER_ON | POWER_NO_COAST | POWER_NO_QUICK_STOP | POWER_ENABLE
    if commands.disable != 0 and drive.state >= 4:
        # once, as a coast stop or quick stop of the control word: the controller has to switch on again
        power &= ~(POWER_NO_COAST if drive.settings.disable_method == DISABLE_AT_ONCE else POWER_NO_QUICK_STOP)
    commands.disable = 0
    return power


@inlined
def _turn(axis: Any, elapsed: int) -> None:
    """Advance set point, controllers, motor and load, in steps of at most the motor's step time."""
    part = motor_step_ns(axis.motor)
    while elapsed > 0:
        # the last step may be a shorter one
        part = min(part, elapsed)
        constants = constants_of(axis, part * 1e-9)
        while elapsed >= part:
            velocity_command(axis, constants.seconds)
            step_motor(axis, constants, axis.drive.state >= 4)
            elapsed -= part
    sign = shaft_sign(axis.direction)
    axis.outside.shaft = sign * axis.motor.position
    axis.outside.shaft_speed = sign * axis.motor.velocity
    axis.outside.brake = 1.0 if brake_holds(axis.brake) else 0.0


@compiled_apart
def step(axis: Any, image: Any, now: int) -> None:
    """Advance one drive to ``now``; without control supply its shaft coasts, and nothing else happens."""
    elapsed = min(now - axis.last_ns, int(axis.longest_ns) or LONGEST_NS)
    axis.last_ns = now
    if not axis.powered:
        axis.drive.state = 0
        _turn(axis, elapsed)
        return
    switched_on = take_commands(axis, now)
    take_direction(axis)
    take_switches(axis.direction, axis.machine, axis.outside, axis.motor)
    take_orders(axis, image, now, switched_on)

    faulty = axis.faults.code[0] != 0
    reaction = 0
    if faulty:
        reaction = 1
        for i in range(FAULT_SLOTS):
            code = axis.faults.code[i]
            if code != 0 and (code >> 24) != REACTION_QUICK_STOP:
                reaction = 0
    power = _power_in_force(axis.drive, axis.orders, axis.commands, reaction)
    standing = abs(axis.motor.velocity) <= axis.ramp.settings.standstill and axis.ramp.command == 0.0
    if axis.brake.settings.torque > 0.0 and axis.drive.state == 5 and not brake_holds(axis.brake):
        # the power stage holds the axis until the brake does
        standing = False
    take_interlocks(axis)
    held = conditions(power, faulty, reaction, standing, now - axis.boot_ns >= axis.boot_time_ns)
    advance(axis.drive, with_interlocks(axis.drive, axis.orders, axis.sensor, held, power, faulty))
    take_jog(axis)
    step_service(axis.drive, axis.commands, axis.service, now)
    take_motion(axis, now)
    if axis.drive.state >= 4:
        axis.motor.rested = 0
    elif abs(axis.motor.velocity) <= axis.ramp.settings.standstill:
        axis.motor.rested = 1

    _turn(axis, elapsed)
    watch_motor(axis, now)
    measure(axis.measurement)
    watch_warnings(axis)
    show_state(axis, image)
