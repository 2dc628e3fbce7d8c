"""Speed and current control, DC link, motor and load.

Below the position controller (`positioning`) a drive controls its speed by a PI controller and its current by a loop
that is a first-order lag until the DC link's voltage runs out; the motor drives one rotating mass with viscous and dry
friction.  With J the inertia, w the shaft's speed and T the torque::

    T_ref = Kp (w_ref - w) + I + Ka J dw_ref/dt,    dI/dt = Kp / Ti (w_ref - w)
    i_ref = T_ref / Kt within the current limits,    di/dt = (i_ref - i) / Tc
    |L di/dt + R i + Kt / 3 w| <= U / sqrt(6)        (one phase, effective values)
    J dw/dt = Kt i - B w - T_load - T_dry

In torque control T_ref is the torque set point, reduced by a proportional controller where it would drive the shaft
beyond a speed limit.

All of it is solved together in implicit form (backward Euler), which is stable for every step length: short steps give
the response of the real loops, long ones the same final values.  Dry friction is part of the solution: it reduces the
torque that would move the shaft by up to its own amount, and holds the shaft exactly when that is enough.
"""

from __future__ import annotations

from math import inf, pi, sqrt
from typing import Any, NamedTuple

import numpy as np

from pnfarm.firmware.direction import shaft_sign
from pnfarm.firmware.faults import raise_fault
from pnfarm.firmware.machine import hold_at_stops
from pnfarm.firmware.motion.travel import fastest
from pnfarm.firmware.motor.foldback import foldback_constants, folds, step_limit, watch_foldback
from pnfarm.firmware.motor.supply import bus_below, mains
from pnfarm.firmware.motor.torque_limits import most_torque
from pnfarm.table.axis_codes import FASTEST_RPM
from pnfarm.table.compiling.compiled import inlined

__all__ = [
    "brake_holds",
    "constants_of",
    "motor_step_ns",
    "step_motor",
    "torque_controlled",
    "watch_motor",
]


RPM_TO_RAD = 2.0 * pi / 60.0
RAD_TO_RPM = 60.0 / (2.0 * pi)
#: Minutes of a second.
MINUTES = 1.0 / 60.0
#: Longest step of controllers and motor where the axis sets none, ns.
MOTOR_STEP_NS = 1_000_000
#: Integral action time of a speed controller in time constants of its closed loop: no overshoot on a ramp.
INTEGRAL_RATIO = 4.0
#: Filter time of the speed noise that an encoder's resolution causes, s.
FEEDBACK_FILTER = 0.001
#: Speed noise, rad/s, per revolution of filtered position.
FILTERED = 2.0 * pi / FEEDBACK_FILTER
#: At rest the integral part does not wind up for speed set points below this part of ``ramp.standstill``.
RESTING = 0.1
#: Highest effective voltage of one phase per volt of the DC link: 1 / sqrt(6).
PHASE_VOLTAGE = 1.0 / sqrt(6.0)
#: Number of phases of a motor.
PHASES = 3.0
#: ``drive.opmode``.
TORQUE_MODE = 0


class Constants(NamedTuple):
    """What settings and the length of a step alone decide, SI units.  A division takes longer than all else of a term.

    Those of a part that the drive lacks mean nothing.
    """

    seconds: float
    #: Of the speed controller: proportional gain, that with the integral action of one step, the latter per error.
    gain: float
    action: float
    integral: float
    #: Part of a change of the current set point that takes effect in this step.
    share: float
    #: Torque per rad/s of change; the inverse of it with the damping, also of these with the controller's gain; dry
    #: friction without the brake's; the load.
    inertia: float
    per_damped: float
    per_led: float
    dry: float
    load: float
    #: Torque of the acceleration's feed forward per rad/s of change.
    fed: float
    per_torque_constant: float
    #: Most torque forwards and backwards, N m, while foldback allows it.
    most: float
    least: float
    #: One phase: L / step, with R in ``impedance``; V per rad/s.
    inductance: float
    impedance: float
    back: float
    #: Change of the DC link's voltage squared per W; what the mains hold it at.
    bus: float
    mains: float
    per_continuous_current: float
    #: Parts of a step in the time constants of heat and of the encoder's filter.
    thermal: float
    feedback: float
    #: Rev of one increment of the encoder, 0 = infinitely many.
    increment: float
    #: Foldback of motor and drive: the limit's initial value, A, 0 for a drive without; its fall per A above the
    #: continuous current.
    motor_initial: float
    motor_fall: float
    drive_initial: float
    drive_fall: float


@inlined
def _inverse(value: float) -> float:
    """1 / ``value``, 0 for what the drive lacks."""
    return 1.0 / value if value > 0.0 else 0.0


@inlined
def constants_of(axis: Any, seconds: float) -> Constants:
    """The constants of steps of this length; nothing of the axis' settings changes before they are made anew."""
    time = axis.motor.settings.velocity_time_constant
    gain = axis.motor.settings.speed_gain if axis.motor.settings.speed_gain > 0.0 else axis.load.settings.inertia / time
    integral_time = axis.motor.settings.speed_integral_time
    if integral_time <= 0.0:
        integral_time = INTEGRAL_RATIO * time
    integral = gain * (seconds / integral_time)
    frequency = 1.0 / seconds
    inertia = (axis.load.settings.inertia + axis.load.settings.added_inertia + axis.outside.inertia) * frequency
    inductance = axis.motor.settings.inductance * frequency
    damped = inertia + axis.load.settings.damping
    share = seconds / (axis.motor.settings.current_time_constant + seconds)
    lowest = mains(axis.drive, axis.faults, axis.supply) if axis.supply.settings.nominal > 0.0 else 0.0
    motor_initial = motor_fall = drive_initial = drive_fall = 0.0
    if folds(axis.motor, axis.foldback):
        motor_initial, motor_fall = foldback_constants(axis.motor, axis.foldback, 0, seconds)
        drive_initial, drive_fall = foldback_constants(axis.motor, axis.foldback, 1, seconds)
    return Constants(
        seconds=seconds,
        gain=gain,
        action=gain + integral,
        integral=integral,
        share=share,
        inertia=inertia,
        per_damped=1.0 / damped,
        per_led=1.0 / (damped + share * (gain + integral)),
        dry=axis.load.settings.friction
        + axis.load.settings.added_friction
        + axis.outside.friction
        + axis.outside.holding,
        load=shaft_sign(axis.direction)
        * (axis.load.settings.torque + axis.load.settings.added_torque + axis.outside.torque),
        fed=axis.motor.settings.acceleration_gain * axis.load.settings.inertia * RPM_TO_RAD * frequency,
        per_torque_constant=_inverse(axis.motor.settings.torque_constant),
        most=most_torque(axis.motor, axis.torque, axis.homing, 0),
        least=most_torque(axis.motor, axis.torque, axis.homing, 1),
        inductance=inductance,
        impedance=inductance + axis.motor.settings.resistance,
        back=axis.motor.settings.torque_constant / PHASES,
        bus=2.0 * seconds * _inverse(axis.supply.settings.capacitance),
        mains=lowest,
        per_continuous_current=_inverse(axis.motor.settings.continuous_current),
        thermal=seconds / (axis.motor.settings.thermal_time + seconds),
        feedback=seconds / (FEEDBACK_FILTER + seconds),
        increment=_inverse(axis.motor.settings.encoder_steps),
        motor_initial=motor_initial,
        motor_fall=motor_fall,
        drive_initial=drive_initial,
        drive_fall=drive_fall,
    )


@inlined
def motor_step_ns(motor: Any) -> int:
    """Longest step of controllers and motor."""
    return int(motor.settings.step_ns) or MOTOR_STEP_NS


@inlined
def brake_holds(brake: Any) -> bool:
    """Whether there is a holding brake and it is not open."""
    return brake.settings.torque > 0.0 and not brake.open


@inlined
def torque_controlled(orders: Any, drive: Any, brake: Any) -> bool:
    """Whether the torque set point is in control: only in operation, because stops are ramps of the speed."""
    return not orders.halt and drive.state == 4 and drive.settings.opmode == TORQUE_MODE and not brake_holds(brake)


@inlined
def _step_brake(brake: Any, open_it: bool, seconds: float) -> None:
    if open_it != bool(brake.asked):
        brake.asked = 1 if open_it else 0
        brake.left = brake.settings.release if open_it else brake.settings.apply
    elif brake.left > 0.0:
        brake.left -= seconds
    if brake.left <= 0.0:
        brake.open = brake.asked


@inlined
def _speed(brake: Any, constants: Constants, omega: float, drive: float, per_inertia: float) -> float:
    """The shaft's speed after the step, rad/s, for a torque of ``drive - slope * speed`` N m.

    Backward Euler with dry friction as the set-valued force that it is.  ``per_inertia``: the inverse of inertia,
    damping and ``slope`` together.
    """
    dry = constants.dry
    if brake_holds(brake):
        dry += brake.settings.torque
    moving = constants.inertia * omega + drive - constants.load
    if abs(moving) <= dry:
        return 0.0
    return (moving - dry if moving > 0.0 else moving + dry) * per_inertia


@inlined
def _per_inertia(constants: Constants, slope: float) -> float:
    """That of :func:`_speed` for a slope that has none among the constants."""
    return constants.per_damped if slope == 0.0 else constants.per_damped / (1.0 + slope * constants.per_damped)


@inlined
def _within_limits(foldback: Any, motor: Any, constants: Constants, wanted: float) -> float:
    """``wanted`` within the limits of its direction, N m."""
    folded = motor.settings.torque_constant * foldback.current
    return max(-min(constants.least, folded), min(constants.most, folded, wanted))


@inlined
def _coast(axis: Any, constants: Constants, omega: float) -> float:
    """The shaft's speed after a step without power; shorted windings may brake it."""
    braking = axis.motor.settings.coast_method == 0 or (axis.motor.settings.coast_method == 1 and not axis.motor.rested)
    axis.motor.current = 0.0
    axis.motor.torque = 0.0
    axis.motor.speed_integral = 0.0
    axis.motor.fed_speed = axis.profile.velocity
    slope = axis.motor.settings.brake_damping if braking else 0.0
    return _speed(axis.brake, constants, omega, 0.0, _per_inertia(constants, slope))


@inlined
def _fed_forward(constants: Constants, motor: Any, positioning: Any, profile: Any) -> float:
    """Torque for the acceleration of a profile, without the position controller's part of the speed."""
    change = profile.velocity - motor.fed_speed
    motor.fed_speed = profile.velocity
    return 0.0 if positioning.state == 0 else constants.fed * change


@inlined
def _speed_limit(motor: Any, travel: Any, side: int) -> float:
    """The limit of the speed forwards (``side`` 1) or backwards (-1), rad/s with its sign."""
    return side * fastest(motor, travel, inf, side > 0) * RPM_TO_RAD


@inlined
def _beyond(motor: Any, torque: Any, travel: Any, speed: float, given: float, gain: float) -> int:
    """Which limit ``given`` N m would exceed on a shaft that reaches ``speed``, rad/s: 1, -1, or 0 for none."""
    if not torque.settings.speed_limited:
        return 0
    if gain * (_speed_limit(motor, travel, 1) - speed) < given:
        return 1
    return -1 if gain * (_speed_limit(motor, travel, -1) - speed) > given else 0


@inlined
def _controlled(axis: Any, constants: Constants, omega: float, noise: float) -> float:
    """The shaft's speed after a step under control, rad/s; writes current, torque and the integral part.

    ``noise``: what the encoder adds to the speed as the controller sees it, rad/s.
    """
    constant = axis.motor.settings.torque_constant
    action, share, per_inertia = constants.action, constants.share, constants.per_led
    kept = (1.0 - share) * constant * axis.motor.current
    reference = axis.ramp.reference * RPM_TO_RAD - noise
    given = (
        axis.motor.speed_integral
        + _fed_forward(constants, axis.motor, axis.positioning, axis.profile)
        + axis.torque.settings.additive
        + axis.torque.added
    )
    led = torque_controlled(axis.orders, axis.drive, axis.brake)
    if led:
        given = _within_limits(
            axis.foldback,
            axis.motor,
            constants,
            axis.torque.setpoint + axis.torque.settings.additive + axis.torque.added,
        )
        action = 0.0
        per_inertia = constants.per_damped
        free = _speed(axis.brake, constants, omega, kept + share * given, per_inertia)
        side = _beyond(axis.motor, axis.torque, axis.travel, free + noise, given, constants.gain)
        if side != 0:
            reference = _speed_limit(axis.motor, axis.travel, side) - noise
            action = constants.gain
            given = 0.0
            per_inertia = _per_inertia(constants, share * action)
    drive = kept + share * (action * reference + given)
    slope = share * action
    following = _speed(axis.brake, constants, omega, drive, per_inertia)
    wanted = action * (reference - following) + given
    most = _within_limits(axis.foldback, axis.motor, constants, wanted)
    limited = most != wanted
    if limited:
        drive = kept + share * most
        slope = 0.0
        following = _speed(axis.brake, constants, omega, drive, constants.per_damped)
    torque = drive - slope * following
    if axis.supply.settings.nominal > 0.0:
        impedance = constants.impedance
        before = constants.inductance * axis.motor.current
        available = axis.supply.voltage * PHASE_VOLTAGE
        needed = impedance * torque * constants.per_torque_constant - before + constants.back * following
        if abs(needed) > available and impedance > 0.0:
            limited = True
            drive = constant * (before + (available if needed > 0.0 else -available)) / impedance
            slope = constant * constants.back / impedance
            following = _speed(axis.brake, constants, omega, drive, _per_inertia(constants, slope))
            torque = drive - slope * following
    error = reference - following
    resting = omega == 0.0 and following == 0.0 and abs(axis.ramp.reference) <= RESTING * axis.ramp.settings.standstill
    if led:
        # speed control continues from the present torque
        axis.motor.speed_integral = torque - axis.torque.settings.additive - axis.torque.added
    # at a limit the integral part is frozen, unless it would lead away from the limit
    elif not resting and (not limited or error * wanted < 0.0):
        axis.motor.speed_integral += constants.integral * error
    axis.motor.torque = torque
    axis.motor.current = torque * constants.per_torque_constant
    return following


@inlined
def _encoder_noise(motor: Any) -> float:
    """Noise that the encoder's resolution adds to the measured speed, rad/s."""
    if motor.settings.encoder_steps <= 0.0:
        return 0.0
    return (motor.measured_position - motor.position - motor.encoder_low) * FILTERED


@inlined
def _read_encoder(motor: Any, constants: Constants) -> None:
    """Update the position as the encoder reports it."""
    if constants.increment <= 0.0:
        motor.measured_position = motor.position
        return
    motor.measured_position = np.floor(motor.position * motor.settings.encoder_steps + 0.5) * constants.increment
    error = motor.measured_position - motor.position
    motor.encoder_low += (error - motor.encoder_low) * constants.feedback


@inlined
def _step_bus(motor: Any, supply: Any, constants: Constants, omega: float) -> None:
    """Advance the DC link: motor and drive draw from it, a braking motor feeds back.

    Without mains it discharges.
    """
    if supply.settings.capacitance <= 0.0 or supply.voltage <= 0.0:
        supply.voltage = constants.mains
        return
    power = (
        motor.torque * omega + PHASES * motor.settings.resistance * motor.current * motor.current + supply.settings.load
    )
    square = supply.voltage * supply.voltage - constants.bus * power
    voltage = sqrt(square) if square > 0.0 else 0.0
    if supply.settings.brake > 0.0 and voltage > supply.settings.brake:
        voltage = supply.settings.brake
    supply.voltage = max(voltage, constants.mains)


@inlined
def step_motor(axis: Any, constants: Constants, powered_stage: bool) -> None:
    """Advance current, torque, speed, position, DC link, heat and brake by the step of ``constants``.

    ``powered_stage``: the power stage is on; ``axis.ramp.reference`` is the speed set point, rpm, in torque control
    ``axis.torque.setpoint`` that of the torque.
    """
    seconds = constants.seconds
    velocity = axis.motor.velocity
    omega = velocity * RPM_TO_RAD
    if axis.brake.settings.torque > 0.0:
        # a drive that comes to rest on its own waits for the brake to hold before it switches off
        resting = axis.drive.state == 5 and axis.ramp.command == 0.0 and abs(velocity) <= axis.ramp.settings.standstill
        _step_brake(axis.brake, powered_stage and not resting, seconds)
    if constants.motor_initial > 0.0:
        above = abs(axis.motor.current) - axis.motor.settings.continuous_current
        step_limit(axis.foldback, 0, constants.motor_initial, above * constants.motor_fall)
        step_limit(axis.foldback, 1, constants.drive_initial, above * constants.drive_fall)
        axis.foldback.current = min(axis.foldback.limit[0], axis.foldback.limit[1])
    if powered_stage:
        speed = _controlled(axis, constants, omega, _encoder_noise(axis.motor))
    else:
        speed = _coast(axis, constants, omega)
    if axis.outside.leads:
        speed = shaft_sign(axis.direction) * axis.outside.speed
    speed = min(max(speed, -FASTEST_RPM * RPM_TO_RAD), FASTEST_RPM * RPM_TO_RAD)
    following = speed * RAD_TO_RPM
    if axis.outside.leads:
        # at this speed all the time it is there at the end
        velocity = following
    axis.motor.position += 0.5 * (velocity + following) * (seconds * MINUTES)
    axis.motor.velocity = following
    hold_at_stops(axis.direction, axis.machine, axis.outside, axis.motor)
    _read_encoder(axis.motor, constants)
    if axis.supply.settings.nominal > 0.0:
        _step_bus(axis.motor, axis.supply, constants, 0.5 * (omega + speed))
    if axis.motor.settings.thermal_time > 0.0 and axis.motor.settings.continuous_current > 0.0:
        part = axis.motor.current * constants.per_continuous_current
        axis.motor.thermal_load += (part * part - axis.motor.thermal_load) * constants.thermal
    if not powered_stage or torque_controlled(axis.orders, axis.drive, axis.brake):
        axis.profile.position = axis.motor.position
        axis.profile.velocity = following
        # the next speed control starts from here
        axis.ramp.command = axis.motor.velocity
    elif axis.positioning.state == 0:
        axis.profile.position += axis.ramp.reference * (seconds * MINUTES)
        axis.profile.velocity = axis.ramp.command
    axis.positioning.following_error = axis.profile.position - axis.motor.measured_position


@inlined
def watch_motor(axis: Any, now: int) -> None:
    """Raise the drive's faults of a motor that runs too fast or is too hot, and of a DC link out of its bounds."""
    if axis.motor.settings.overspeed > 0.0 and abs(axis.motor.velocity) > axis.motor.settings.overspeed:
        raise_fault(axis.faults, axis.motor.settings.overspeed_fault, now)
    if folds(axis.motor, axis.foldback):
        watch_foldback(axis.faults, axis.motor, axis.foldback, now)
    elif axis.motor.thermal_load > 1.0:
        raise_fault(axis.faults, axis.motor.settings.overload_fault, now)
    if axis.supply.settings.limit > 0.0 and axis.supply.voltage > axis.supply.settings.limit:
        raise_fault(axis.faults, axis.supply.settings.overvoltage_fault, now)
    if bus_below(axis.drive, axis.faults, axis.supply, axis.supply.settings.undervoltage_limit) and (
        axis.drive.state >= 4 or not axis.supply.settings.undervoltage_mode
    ):
        raise_fault(axis.faults, axis.supply.settings.undervoltage_fault, now)
