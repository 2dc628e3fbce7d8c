"""Motor and load: one rotating mass with dry and viscous friction, driven by a limited torque.

The closed velocity loop is a first-order lag (``velocity_time_constant``) around the torque limit, in
implicit form, so that it is stable for every step: for an unlimited torque one step takes the speed error
down by ``dt / (T + dt)``.
"""

from __future__ import annotations

from math import pi
from typing import Any

from pnfarm.firmware.torque_limits import limited_torque
from pnfarm.table.compiled import compiled

__all__ = ["step_motor"]

RPM_TO_RAD = 2.0 * pi / 60.0


@compiled
def step_motor(axis: Any, powered_stage: bool, seconds: float) -> None:
    """Advance torque, current, speed and position by ``seconds``.

    ``powered_stage``: the power stage is on.
    """
    velocity = axis.velocity
    omega = velocity * RPM_TO_RAD
    inertia = axis.inertia
    friction = axis.friction
    # everything that the motor does not do itself, without dry friction
    passive = -axis.damping * omega - axis.load_torque
    moving = velocity != 0.0
    if powered_stage:
        error = (axis.ramp - velocity) * RPM_TO_RAD
        wanted = error / (axis.velocity_time_constant + seconds)
        if moving:
            dry = friction if velocity > 0.0 else -friction
        else:
            dry = friction if axis.ramp > 0.0 else (-friction if axis.ramp < 0.0 else 0.0)
        torque = inertia * wanted - passive + dry
        torque = limited_torque(axis, torque)
        if not moving and axis.ramp == 0.0 and abs(passive) <= friction:
            torque = 0.0
    else:
        torque = 0.0
    driving = torque + passive
    if moving:
        net = driving - (friction if velocity > 0.0 else -friction)
    elif abs(driving) <= friction:
        net = 0.0
    else:
        net = driving - (friction if driving > 0.0 else -friction)
    following = velocity + net / inertia * seconds / RPM_TO_RAD
    braking = axis.coast_method == 0 or (axis.coast_method == 1 and not axis.brake_released)
    if braking and not powered_stage:
        # shorted windings; implicit, so that a light load stays stable
        following /= 1.0 + axis.brake_damping / inertia * seconds
    if moving and following * velocity < 0.0 and abs(driving) <= friction:
        following = 0.0
    if abs(following) < 1e-4 and axis.ramp == 0.0 and abs(driving) <= friction:
        following = 0.0
    axis.position += 0.5 * (velocity + following) * seconds / 60.0
    axis.velocity = following
    axis.torque = torque
    axis.current = torque / axis.torque_constant if axis.torque_constant > 0.0 else 0.0
    if not powered_stage:
        axis.commanded_position = axis.position
        axis.profile_velocity = following
    elif axis.motion == 0:
        axis.commanded_position += axis.ramp * seconds / 60.0
        axis.profile_velocity = axis.ramp
    axis.following_error = axis.commanded_position - axis.position
