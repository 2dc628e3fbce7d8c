"""Couplings of shafts: springs with damper and backlash, rigid shafts, masses behind a spring.

With d the angle of the first shaft less that of the second, w its speed, m the reduced inertia and h the step, the
torque of a spring is constant from one step to the next::

    m w' = m w - h T            d' = d + h (w + w') / 2          (what the axes' steps make of T)

* Without backlash T is chosen so that a free oscillation has exactly the frequency sqrt(k / m), whatever the step:
  T (1 + q) = k (d + h w / 2) + q m a, with 1 + q = (z / sin z)^2, z = h sqrt(k / m) / 2, and a the acceleration that
  other torques gave in the last step.  At rest T = k d.  A damper adds c (w + w') / 2.
* With backlash T = (V(d') - V(d)) / (d' - d), V the spring's energy: the sum of energies is the same in each step.
* Rigid shafts: both get the speed and the place of their common centre of mass, and for their next step the torque
  that was between them in the last one.

A damper takes energy, nothing gives some.  A spring too stiff for the step (z above 0.5) is as stiff as it allows.
"""

from __future__ import annotations

from math import pi, sin, sqrt
from typing import Any

from pnfarm.firmware.direction import shaft_sign
from pnfarm.table.compiling.compiled import inlined
from pnfarm.table.plant import COUPLING_RIGID

__all__ = ["COUPLED", "LONGEST", "STIFFEST", "TURN", "couple", "step_with_plant", "uncouple"]

#: Most steps of the plant that one step of a spring, or of an axis that the plant moves, covers.  A torque of the plant
#: is for the time up to its next step: over all of a time in which the machine stood it would tear a spring apart.
LONGEST = 2

#: h sqrt(k / m) / 2 of the stiffest spring that a step can have.
STIFFEST = 0.5
#: Repetitions in which backlash is solved: each one takes three quarters of the error, or more.
_REPETITIONS = 16
#: Radians.
TURN = 2.0 * pi
#: rad/s in rpm.
_RPM = 60.0 / TURN
#: Values of a coupling: offset in revolutions, torque on a mass; torque, twist in revolutions, then of a mass place and
#: speed.
_OFFSET, _LOAD, _TORQUE, _TWIST, _PLACE, _SPEED = 0, 1, 2, 3, 4, 5
COUPLED = 6


@inlined
def _inertia(axis: Any) -> float:
    return float(axis.load.settings.inertia + axis.load.settings.added_inertia + axis.outside.inertia)


@inlined
def _spring(twist: float, gap: float) -> float:
    """How far a spring is wound."""
    if twist > gap:
        return twist - gap
    return twist + gap if twist < -gap else 0.0


@inlined
def _with_backlash(stiffness: float, gap: float, twist: float, speed: float, mass: float, step: float) -> float:
    """The torque of a spring with backlash of twice ``gap``."""
    wound = _spring(twist, gap)
    following = twist + step * speed
    torque = 0.0
    for _ in range(_REPETITIONS):
        after = _spring(following, gap)
        way = following - twist
        if abs(way) > 1e-12:
            torque = 0.5 * stiffness * (after + wound) * ((after - wound) / way)
        else:
            torque = stiffness * 0.5 * (wound + after)
        following = twist + step * (speed - 0.5 * step * torque / mass)
    return torque


@inlined
def step_with_plant(axis: Any, step_ns: int, now: int) -> None:
    """Have an axis step as often as the plant, and in the same ticks: what that puts on its shaft is for one of its
    steps.  ``now``: of this step of the plant."""
    axis.longest_ns = LONGEST * step_ns
    # after a late tick the next one may come early, and still counts
    longest = step_ns - step_ns // 8
    since = now - axis.last_ns
    if 0 < since < step_ns and axis.step_ns >= longest and axis.clock.settings.drift == 0.0:
        # it stepped between two steps of the plant: its next one is longer, and then they go together
        axis.step_ns = longest + since
    else:
        axis.step_ns = min(axis.step_ns, longest)


@inlined
def uncouple(couplings: Any, axes: Any, step_ns: int, now: int) -> None:
    """Take the torques of the last step from the axes."""
    for number in range(len(couplings)):
        coupling = couplings[number]
        for row in (int(coupling.first), int(coupling.second)):
            if row >= 0:
                axes[row].outside.torque = 0.0
                step_with_plant(axes[row], step_ns, now)


@inlined
def _move(axis: Any, angle: float, speed: float) -> None:
    """Put a shaft where its coupling has it; radians."""
    sign = shaft_sign(axis.direction)
    axis.motor.position = sign * angle / TURN
    axis.motor.velocity = sign * speed * _RPM
    axis.outside.shaft = angle / TURN
    axis.outside.shaft_speed = speed * _RPM


@inlined
def couple(coupling: Any, axes: Any, values: Any, seconds: float, step: float) -> None:
    """One coupling: advance its mass by the ``seconds`` since the last step, and put its torque on both shafts.

    ``values`` are its own, ``step`` is the time to the next one.  The torque is added to what is there.
    """
    first = axes[coupling.first]
    ratio = float(coupling.ratio)
    own = _inertia(first)
    angle = float(first.outside.shaft) * TURN
    speed = float(first.outside.shaft_speed) / _RPM
    offset = values[_OFFSET] * TURN
    has_mass = coupling.second < 0
    if has_mass:
        inertia = float(coupling.inertia)
        if coupling.begun == 0:
            coupling.angle = angle - offset
            coupling.speed = speed
        else:
            before = float(coupling.speed)
            torque = float(coupling.torque) - values[_LOAD]
            after = (before * inertia + seconds * torque) / (inertia + seconds * coupling.damped)
            coupling.speed = after
            coupling.angle += 0.5 * seconds * (before + after)
        other_angle, other_speed = float(coupling.angle), float(coupling.speed)
    else:
        second = axes[coupling.second]
        inertia = _inertia(second) * ratio * ratio
        other_angle = float(second.outside.shaft) * TURN / ratio
        other_speed = float(second.outside.shaft_speed) / _RPM / ratio
    twist = angle - other_angle - offset
    faster = speed - other_speed
    mass = own * inertia / (own + inertia)
    if coupling.kind == COUPLING_RIGID:
        part = inertia / (own + inertia)
        # a shaft that the plant holds gives way to none
        if first.outside.leads:
            part, mass = 0.0, inertia
        elif axes[coupling.second].outside.leads:
            part, mass = 1.0, own
        common = speed - part * faster
        _move(first, angle - part * twist, common)
        _move(axes[coupling.second], (other_angle + (1.0 - part) * twist) * ratio, common * ratio)
        # with what one took from the other in the step; it is on both in the next one, or a brake on one would not
        # hold the other, which would creep
        if seconds > 0.0:
            coupling.torque += mass * faster / seconds
        first.outside.torque += coupling.torque
        axes[coupling.second].outside.torque -= coupling.torque / ratio
        values[_TORQUE] = coupling.torque
        values[_TWIST] = twist / TURN
        coupling.begun = 1
        return
    stiffness = float(coupling.stiffness)
    half = 0.5 * step * sqrt(stiffness / mass)
    if half > STIFFEST:
        half = STIFFEST
        stiffness = mass * (2.0 * half / step) ** 2
    if coupling.gap > 0.0:
        torque = _with_backlash(stiffness, 0.5 * float(coupling.gap), twist, faster, mass, step)
        if _spring(twist, 0.5 * float(coupling.gap)) != 0.0:
            torque += coupling.damping * faster / (1.0 + 0.5 * step * coupling.damping / mass)
    else:
        more = (half / sin(half)) ** 2 - 1.0 if half > 0.0 else 0.0
        other = 0.0
        if coupling.begun != 0 and seconds > 0.0:
            other = mass * (faster - coupling.before) / seconds + coupling.torque
        damped = 0.5 * step * coupling.damping / mass
        torque = (stiffness * (twist + 0.5 * step * faster) + coupling.damping * faster + (more + damped) * other) / (
            1.0 + more + damped
        )
    coupling.torque = torque
    coupling.before = faster
    coupling.begun = 1
    first.outside.torque += torque
    if not has_mass:
        axes[coupling.second].outside.torque -= torque / ratio
    values[_TORQUE] = torque
    values[_TWIST] = twist / TURN
    values[_PLACE] = other_angle / TURN
    values[_SPEED] = other_speed * _RPM
