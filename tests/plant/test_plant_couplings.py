"""Couplings of shafts against closed forms; nothing gains energy."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pnfarm.testing import Line

TURN = 2.0 * math.pi
RPM = 60.0 / TURN


@dataclass
class Shaft:
    """A shaft that turns freely: no friction, no brake, no power."""

    line: Line
    row: int

    def __post_init__(self) -> None:
        self._axis = self.line.core.axes[self.row].handle.axis
        self._axis.motor.settings.brake_damping = 0.0

    @property
    def inertia(self) -> float:
        return float(self._axis.load.settings.inertia)

    @property
    def angle(self) -> float:
        return float(self._axis.outside.shaft) * TURN

    @property
    def speed(self) -> float:
        return float(self._axis.outside.shaft_speed) / RPM

    @property
    def energy(self) -> float:
        return 0.5 * self.inertia * self.speed**2


def _line(
    models: str, *, step: str = "1ms", axes: int = 1, inertia: float = 1e-4, friction: float = 0.0, wires: str = ""
) -> Line:
    names = ", ".join(
        f"{{name: x{n}, model: akd-profinet, ip: 10.77.0.{n}/24, "
        f"load: {{inertia: {inertia}, friction: {friction}, damping: 0}}}}"
        for n in range(1, axes + 1)
    )
    return Line.from_text(
        f"farm: t\nlink: {{kind: memory}}\ndrives: [{names}]\nplant:\n  step: {step}\n  models: [{models}]\n"
        f"  wires: [{wires}]\n"
    )


def _crossings(values: list[float], step: float) -> list[float]:
    """Times of the rising passages through 0."""
    return [
        (i - before / (after - before)) * step
        for i, (before, after) in enumerate(itertools.pairwise(values))
        if before < 0.0 <= after
    ]


@pytest.mark.parametrize(("stiffness", "inertia", "step"), [(1.0, 2e-4, 1), (5.0, 1e-3, 1), (10.0, 2e-4, 0.5)])
def test_two_masses_oscillate_at_the_frequency_of_the_closed_form(stiffness: float, inertia: float, step: float):
    model = f"{{name: mass, kind: elastic-load, axis: x1, stiffness: {stiffness}, inertia: {inertia}}}"
    with _line(model, step=f"{step}ms") as line:
        shaft = Shaft(line, 0)
        line.run(0.01)
        line.plant.mass.offset = 0.01
        reduced = shaft.inertia * inertia / (shaft.inertia + inertia)
        expected = math.sqrt(stiffness / reduced) / TURN
        twists = []
        for _ in range(round(30.0 / expected / step * 1e3)):
            line.run(step * 1e-3)
            twists.append(float(line.plant.mass.twist))
        passed = _crossings(twists, step * 1e-3)
        assert (len(passed) - 1) / (passed[-1] - passed[0]) == pytest.approx(expected, rel=1e-4)


def test_a_gantry_that_stands_askew_has_the_torque_of_its_spring():
    """A lead of 10 mm, 1 mm of offset: a tenth of a revolution wound up between two held axes."""
    text = """
farm: t
link: {kind: memory}
drives:
- {name: "x{n}", count: 2, model: akd-profinet, ip: 10.77.0.11/24, load: {inertia: 1.0e-4, lead: 10, friction: 0}}
controller: {ip: 10.77.0.1/24, program: {kind: constant, speed_rpm: 0}}
plant:
  models:
  - {name: gantry, kind: elastic-coupling, axes: [x1, x2], stiffness: 0.5, damping: 0.001}
"""
    with Line.from_text(text) as line:
        line.wait_running()
        line.plant.gantry.offset = 0.1
        line.run(5.0)
        twist = float(line.plant.gantry.twist)
        torques = [line.core.axes[n].handle.axis.motor.torque for n in range(2)]
        assert line.plant.gantry.torque == pytest.approx(0.5 * twist * TURN, rel=1e-4)
        # what the motors hold against: the one forwards, the other one backwards
        assert torques[0] == pytest.approx(0.5 * twist * TURN, rel=1e-3)
        assert torques[1] == pytest.approx(-0.5 * twist * TURN, rel=1e-3)


def test_axes_with_a_rigid_coupling_turn_as_one_by_their_ratio():
    model = "{name: gear, kind: rigid-coupling, axes: [x1, x2], ratio: 3}"
    with _line(model, axes=2) as line:
        first, second = Shaft(line, 0), Shaft(line, 1)
        line.core.axes[0].handle.axis.load.settings.torque = -0.01
        line.run(2.0)
        assert second.angle == pytest.approx(3 * first.angle, abs=1e-9)
        assert second.speed == pytest.approx(3 * first.speed, abs=1e-9)
        # the torque accelerates both inertias, the second one nine times as seen by the first
        assert first.speed == pytest.approx(2.0 * 0.01 / (first.inertia + 9 * second.inertia), rel=2e-3)


@pytest.mark.parametrize(
    ("holds", "torque"),
    [
        ("button.on -> x1.brake_applied", -0.02),
        ("place.value -> x1.load_position", -0.02),
        ("place.value * 1 revolutions -> x1.stop_high", -0.02),
        ("place.value -> x2.load_position", 0.0),
    ],
)
def test_what_holds_one_of_two_rigid_axes_holds_both(holds: str, torque: float):
    models = (
        "{name: gear, kind: rigid-coupling, axes: [x1, x2], ratio: 2}, {name: button, kind: push-button}, "
        "{name: place, kind: first-order, time_constant: 0ms}"
    )
    with _line(models, axes=2, wires=holds) as line:
        first, second = Shaft(line, 0), Shaft(line, 1)
        line.plant.button.press = True
        line.core.axes[1].handle.axis.load.settings.torque = -0.01
        line.run(0.5)
        angle = second.angle
        line.run(1.0)
        assert second.angle == pytest.approx(angle, abs=1e-6)
        assert (first.speed, second.speed) == pytest.approx((0.0, 0.0), abs=1e-6)
        # the load of the second, as seen by the first
        assert line.plant.gear.torque == pytest.approx(torque, abs=1e-6)


def test_a_drive_that_turns_another_shaft_by_a_rigid_coupling_has_one_inertia_more():
    text = """
farm: t
link: {kind: memory}
drives:
- {name: "x{n}", count: 2, model: akd-profinet, ip: 10.77.0.11/24, load: {inertia: 1.0e-4, friction: 0, damping: 0}}
controller: {ip: 10.77.0.1/24, program: {kind: constant, speed_rpm: 600}}
plant:
"""
    whole = "  models: [{name: more, kind: first-order, time_constant: 0ms, rest: 1.0e-4, start: 1.0e-4}]\n"
    whole += "  wires: [more.value -> x1.load_inertia]\n"
    found = []
    for plant in (whole, "  models: [{name: gear, kind: rigid-coupling, axes: [x1, x2]}]\n"):
        with Line.from_text(text + plant) as line:
            first, _ = Shaft(line, 0), Shaft(line, 1)
            line.core.axes[1].handle.axis.powered = 0
            line.wait_until(lambda first=first: first.speed > 0.0, 2.0)
            speeds = []
            for _ in range(500):
                line.run(1e-3)
                speeds.append(first.speed)
            found.append(speeds)
    assert max(found[0]) > 63.0
    assert max(abs(one - two) for one, two in zip(*found, strict=True)) < 1.0


def test_backlash_leaves_the_shaft_free_between_its_stops():
    model = "{name: m, kind: elastic-load, axis: x1, stiffness: 100, inertia: 1.0e-3, backlash: 20}"
    with _line(model) as line:
        shaft = Shaft(line, 0)
        line.run(0.01)
        line.plant.m.offset = 9.9 / 360
        line.run(1.0)
        assert shaft.speed == 0.0
        assert line.plant.m.torque == 0.0
        line.plant.m.offset = 12.0 / 360
        line.run(0.01)
        assert shaft.speed != 0.0


def test_a_twist_beyond_all_machines_leaves_a_shaft_that_still_turns_behind_backlash():
    model = "{name: m, kind: elastic-load, axis: x1, stiffness: 30, inertia: 1.0e-4, backlash: 1}"
    with _line(model) as line:
        shaft = Shaft(line, 0)
        line.run(0.01)
        for offset in (1e200, -1e200, 0.0):
            line.plant.m.offset = offset
            line.run(0.05)
            assert math.isfinite(shaft.angle)
            assert math.isfinite(float(line.plant.m.position))


@settings(max_examples=10, deadline=None)
@given(
    stiffness=st.floats(1e-3, 1e3),
    inertia=st.floats(1e-6, 1e-2),
    backlash=st.sampled_from([0.0, 0.0, 1.0, 90.0]),
    damping=st.sampled_from([0.0, 1e-5, 1e-2]),
    offset=st.floats(0.001, 0.5),
    step=st.sampled_from(["0.5ms", "1ms", "4ms"]),
)
def test_no_spring_gives_more_energy_than_was_put_into_it(
    stiffness: float, inertia: float, backlash: float, damping: float, offset: float, step: str
):
    model = (
        f"{{name: m, kind: elastic-load, axis: x1, stiffness: {stiffness}, inertia: {inertia}, "
        f"backlash: {backlash}, damping: {damping}}}"
    )
    with _line(model, step=step) as line:
        shaft = Shaft(line, 0)
        line.run(0.02)
        line.plant.m.offset = offset
        gap = math.radians(backlash) / 2
        put_in = 0.5 * stiffness * max(0.0, offset * TURN - gap) ** 2
        found = []
        for _ in range(300):
            line.run(float(step[:-2]) * 1e-3)
            found.append(shaft.energy + 0.5 * inertia * (float(line.plant.m.velocity) / RPM) ** 2)
        # at the speeds of the steps, which are up to a tenth above those between them for the stiffest springs
        assert max(found) <= 1.2 * put_in + 1e-15
        # a slow spring reaches its highest speed only in the second half
        assert max(found[150:]) <= 1.02 * max(put_in, *found[:150])
