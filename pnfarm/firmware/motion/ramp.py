"""The velocity command: set point, ramp generator, jogging, stops (AKD PROFINET manual 5.4, 5.9)."""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.interlocks import at_once, quick_stop_ramp
from pnfarm.firmware.motion.interpolation import servo_command
from pnfarm.firmware.motion.jog import by_sequence, excluded
from pnfarm.firmware.motion.positioning import OUT, positioning_command
from pnfarm.firmware.motion.service_motion import service_setpoint
from pnfarm.firmware.motion.travel import fastest
from pnfarm.firmware.motor.motor import brake_holds, torque_controlled
from pnfarm.table.axis_codes import RAMP_ABSENT, RAMP_PASSED_BY
from pnfarm.table.compiling.compiled import compiled, inlined

__all__ = ["approach", "limited", "velocity_command"]


JOG_1 = 1  # of ``jog.bits``
JOG_2 = 2
QUICK_STOP = 2  # axis.drive.stop


@compiled
def approach(value: float, target: float, up: float, down: float, seconds: float) -> float:
    """``value`` moved towards ``target``: magnitude grows at ``up`` and shrinks at ``down`` per second.

    A reversal first decelerates to zero at ``down``; the rest of the step accelerates at ``up``.
    """
    if value * target < 0.0:
        limit = down * seconds
        if abs(value) > limit:
            return value - limit if value > 0.0 else value + limit
        seconds -= abs(value) / down if down > 0.0 else seconds
        value = 0.0
    limit = (up if abs(target) > abs(value) else down) * seconds
    difference = target - value
    if abs(difference) <= limit:
        return target
    return value + limit if difference > 0.0 else value - limit


@compiled
def limited(motor: Any, travel: Any, target: float) -> float:
    """``target`` within the limits of motor and parameters, rpm."""
    return fastest(motor, travel, target, True) if target > 0.0 else -fastest(motor, travel, -target, False)


@inlined
def _jogs(orders: Any, motor: Any, ramp: Any, jog: Any) -> bool:
    """Whether the axis jogs: a jog begins at standstill while nothing bars it, and ends there once no longer requested.

    With sequences :mod:`pnfarm.firmware.motion.jog` decides when a jog begins and ends.  A frozen ramp generator
    does not keep the speed of a jog that is over: the axis comes to rest.
    """
    if by_sequence(jog):
        if jog.sequence:
            ramp.jogging = 1
        elif ramp.command == 0.0 or not orders.ramp or orders.ramp_runs:
            ramp.jogging = 0
        return ramp.jogging != 0
    if ramp.settings.generator == RAMP_ABSENT or excluded(orders, jog, ramp.jogging != 0):
        ramp.jogging = 0
    elif not ramp.jogging:
        ramp.jogging = 1 if jog.bits and ramp.command == 0.0 and abs(motor.velocity) <= ramp.settings.standstill else 0
    elif not jog.bits and ramp.command == 0.0:
        ramp.jogging = 0
    return ramp.jogging != 0


@inlined
def _jog_command(motor: Any, ramp: Any, travel: Any, jog: Any, seconds: float) -> None:
    """The velocity command of a jog, along its own ramps; bits without a speed request standstill."""
    bits = jog.bits
    target = 0.0
    if by_sequence(jog):
        target = jog.speed if jog.sequence else 0.0
    elif bits == JOG_1:
        target = jog.settings.velocity[0]
    elif bits == JOG_2:
        target = jog.settings.velocity[1]
    up = jog.settings.acceleration if jog.settings.acceleration > 0.0 else ramp.up
    down = jog.settings.deceleration if jog.settings.deceleration > 0.0 else ramp.down
    ramp.command = approach(ramp.command, limited(motor, travel, target), up, down, seconds)


@inlined
def _servo(axis: Any, seconds: float) -> None:
    """Dynamic servo control; orders to the ramp generator act as for a speed that bypasses it."""
    if axis.orders.setpoint and axis.orders.ramp_runs and axis.orders.ramp:
        axis.ramp.command = limited(
            axis.motor, axis.travel, servo_command(axis.motor, axis.ramp, axis.profile, axis.interpolation)
        )
    elif not axis.orders.ramp or axis.orders.ramp_runs:
        axis.ramp.command = approach(axis.ramp.command, 0.0, axis.ramp.down, axis.ramp.down, seconds)


@inlined
def _advance_ramp(axis: Any, seconds: float) -> None:
    """One step of ``axis.ramp.command``; ``axis.ramp.setpoint`` is the controller's set point."""
    # positioning has ramps of its own, which are slow in :mod:`pnfarm.firmware.motion.profile_generator`
    ramped = seconds if axis.ramp.settings.slowness == 0.0 else seconds / (1.0 + axis.ramp.settings.slowness)
    if axis.drive.state == 5:
        axis.ramp.jogging = 0
        # a drive without a ramp generator has a single ramp for all stops
        down = axis.ramp.settings.quick_stop_deceleration
        if axis.drive.stop == 1 and axis.ramp.settings.generator != RAMP_ABSENT:
            down = axis.ramp.down
        elif axis.drive.settings.opmode == 2 and axis.ramp.settings.position_stop_deceleration > 0.0:
            down = axis.ramp.settings.position_stop_deceleration
        if axis.drive.stop == QUICK_STOP:
            if at_once(axis.drive):
                axis.ramp.command = 0.0
                return
            down = quick_stop_ramp(axis.drive, axis.ramp, down)
        axis.ramp.command = approach(axis.ramp.command, 0.0, down, down, ramped)
        return
    if axis.drive.state != 4 or torque_controlled(axis.orders, axis.drive, axis.brake):
        # the axis coasts, stands or is torque controlled: a later start begins at its present speed
        axis.ramp.command = axis.motor.velocity
        axis.ramp.jogging = 0
        return
    if brake_holds(axis.brake):
        axis.ramp.command = 0.0
        return
    if axis.positioning.state != OUT:
        axis.ramp.command = limited(
            axis.motor,
            axis.travel,
            positioning_command(axis.motor, axis.positioning, axis.profile, axis.interpolation, seconds),
        )
        return
    if (
        axis.interpolation.settings.servo_control
        and axis.interpolation.settings.servo_control == axis.drive.settings.opmode
    ):
        _servo(axis, ramped)
        return
    if axis.drive.settings.opmode != 1:
        axis.ramp.command = approach(axis.ramp.command, 0.0, axis.ramp.down, axis.ramp.down, ramped)
        return
    if axis.ramp.settings.generator == RAMP_ABSENT:
        axis.ramp.command = limited(axis.motor, axis.travel, axis.ramp.setpoint)
        return
    if axis.service.leg:
        axis.ramp.command = approach(
            axis.ramp.command,
            limited(axis.motor, axis.travel, service_setpoint(axis.service)),
            axis.ramp.settings.acceleration,
            axis.ramp.settings.deceleration,
            ramped,
        )
        return
    if _jogs(axis.orders, axis.motor, axis.ramp, axis.jog):
        _jog_command(axis.motor, axis.ramp, axis.travel, axis.jog, ramped)
        return
    if not axis.orders.ramp:
        # a ramp generator that is switched off gives zero; the axis decelerates along its jog or stop ramp
        off = (
            0.0
            if axis.ramp.settings.off_at_once
            else approach(axis.ramp.command, 0.0, axis.ramp.down, axis.ramp.down, ramped)
        )
        axis.ramp.command = off
        return
    if not axis.orders.ramp_runs:
        return
    target = limited(axis.motor, axis.travel, axis.ramp.setpoint) if axis.orders.setpoint else 0.0
    if axis.ramp.settings.generator == RAMP_PASSED_BY:
        # the controller interpolates (Moog MSD manual, table 10.1: the set point acts directly on the control)
        axis.ramp.command = target
        return
    axis.ramp.command = approach(axis.ramp.command, target, axis.ramp.up, axis.ramp.down, ramped)


@inlined
def velocity_command(axis: Any, seconds: float) -> None:
    """Advance ``axis.ramp.command`` by ``seconds``, and set ``axis.ramp.reference`` for speed control."""
    _advance_ramp(axis, seconds)
    axis.ramp.reference = axis.ramp.command
    # a stop leads to standstill, and the motor does not work against a closed brake
    if axis.ramp.settings.additive_speed != 0.0 and axis.drive.state == 4 and not brake_holds(axis.brake):
        axis.ramp.reference = limited(axis.motor, axis.travel, axis.ramp.command + axis.ramp.settings.additive_speed)
