"""What a plant puts on an axis, against closed forms: end stops, a brake, switches."""

from __future__ import annotations

from itertools import pairwise

import pytest

from pnfarm.testing import Line

HEAD = """
farm: t
link: {kind: memory}
drives:
  - {name: x, model: akd-profinet, ip: 10.77.0.11/24, load: {LOAD}PARAMS}
controller: {ip: 10.77.0.1/24, program: PROGRAM}
plant:
  models:
  - {name: stop, kind: first-order, time_constant: 1ms, gain: 1, start: 50}
  - {name: button, kind: push-button}
  wires: [WIRE]
"""
TURNING = "{kind: constant, speed_rpm: 600}"
IDLE = "{kind: idle}"


def _line(wire: str, *, program: str = TURNING, load: str = "inertia: 2.0e-4", params: str = "") -> Line:
    text = HEAD.replace("PROGRAM", program).replace("WIRE", wire).replace("LOAD", load)
    return Line.from_text(text.replace("PARAMS", f", params: {params}" if params else ""))


def _record(line: Line):
    return line.core.axes[0].handle.axis


def test_an_axis_driven_into_a_stop_stands_within_a_step_with_its_torque_at_the_limit():
    with _line("stop.value * 1 mm -> x.stop_high", load="lead: 10, gear: 2, inertia: 2.0e-4") as line:
        line.plant.stop.input = 50
        line.wait_running()
        axis = line["x"]
        shaft = _record(line).outside
        # 50 mm are 10 revolutions of the motor
        while float(shaft.shaft) < 10.0:
            assert line.now < 5
            before = float(shaft.shaft_speed)
            line.run(0.001)
        assert before == pytest.approx(600, rel=1e-3)
        assert (float(shaft.shaft), axis.velocity) == (10.0, 0.0)
        line.run(0.5)
        assert (float(shaft.shaft), axis.velocity) == (10.0, 0.0)
        motor = _record(line).motor.settings
        most = float(motor.torque_constant * motor.peak_current)
        assert axis.current == pytest.approx(float(motor.peak_current), rel=1e-6)
        assert float(_record(line).motor.torque) == pytest.approx(most, rel=1e-6)


def test_a_shaft_that_the_plant_holds_is_where_it_is_held_and_goes_no_further():
    with _line("stop.value * 1 revolutions -> x.load_position", program=IDLE) as line:
        line.run(0.2)
        assert line.plant.stop.value == pytest.approx(0.0, abs=1e-9)
        line.plant.stop.input = 1
        places = []
        for _ in range(200):
            line.run(0.001)
            places.append((float(_record(line).outside.shaft), float(line.plant.stop.value)))
        assert places[-1] == pytest.approx((1.0, 1.0), abs=1e-6)
        assert all(before - 1e-9 <= shaft <= value + 1e-9 for (before, _), (shaft, value) in pairwise(places))


def test_a_stop_that_moves_away_lets_the_axis_go_on():
    with _line("stop.value * 1 revolutions -> x.stop_high") as line:
        line.plant.stop.input = 5
        line.wait_running()
        line.run(1.5)
        assert float(_record(line).outside.shaft) == pytest.approx(5.0, abs=1e-6)
        line.plant.stop.input = 100
        line.run(1.0)
        assert float(_record(line).outside.shaft) > 10.0


def test_a_stop_holds_a_shaft_that_a_weight_pulls_down_without_power():
    with _line("stop.value * -1 revolutions -> x.stop_low", program=IDLE, load="torque: 0.3") as line:
        line.plant.stop.input = 2
        line.core.axes[0].station.power_off(line.now_ns)
        line.run(3.0)
        assert float(_record(line).outside.shaft) == -2.0
        assert float(_record(line).outside.shaft_speed) == 0.0


@pytest.mark.parametrize("wire", ["button.on -> x.brake_applied", "not button.off -> x.brake_applied"])
def test_an_axis_does_not_move_while_a_brake_of_the_machine_is_applied(wire: str):
    with _line(wire) as line:
        line.plant.button.press = True
        line.wait_until(lambda: line["x"].state == "S4", 5.0)
        line.run(0.5)
        record = _record(line)
        assert (float(record.outside.shaft), line["x"].velocity) == (0.0, 0.0)
        assert line["x"].current == pytest.approx(float(record.motor.settings.peak_current), rel=1e-6)
        line.plant.button.press = False
        line.run(1.0)
        assert line["x"].velocity == pytest.approx(600, rel=1e-3)
        line.plant.button.press = True
        line.run(0.003)
        place = float(record.outside.shaft)
        line.run(0.5)
        assert float(record.outside.shaft) == place


def test_a_brake_of_the_machine_holds_a_weight_without_power():
    with _line("button.off -> x.brake_applied", program=IDLE, load="torque: 5") as line:
        line.run(0.003)
        place = float(_record(line).outside.shaft)
        line.run(1.0)
        assert float(_record(line).outside.shaft) == place
        line.plant.button.press = True
        line.run(1.0)
        assert float(_record(line).outside.shaft) < place - 1


POSITIONS = (
    "{kind: positions, targets: [0, 6], speed_rpm: 240, acceleration: 3000, acknowledge_after: 10s}, telegram: 9"
)


def test_the_drive_reports_its_following_error_when_a_stop_holds_a_task():
    params = "{DRV.OPMODE: 2, PL.ERRFTHRESH: 32768}"
    wire = "stop.value * 1 revolutions -> x.stop_high"
    with _line(wire, program=POSITIONS, params=params) as line:
        line.plant.stop.input = 3
        line.wait_until(lambda: line["x"].position > 2.9, 20.0, every=0.002)
        positioning = _record(line).positioning
        # 4 revolutions per second, and half a revolution is the limit of PL.ERRFTHRESH
        reached = line.wait_until(lambda: float(_record(line).outside.shaft) == 3.0, 1.0)
        waited = line.wait_until(lambda: line["x"].fault is not None, 1.0)
        assert reached < 0.03
        assert waited == pytest.approx(0.5 / 4, abs=0.02)
        assert line["x"].fault.number == 439
        assert float(positioning.following_error) > 0.5
        line.run(0.5)
        assert float(_record(line).outside.shaft) <= 3.0


def test_an_axis_homes_at_a_switch_of_the_plant_on_a_digital_input():
    text = HEAD.replace("PROGRAM", POSITIONS).replace("LOAD", "lead: 10, gear: 2")
    text = text.replace("PARAMS", ", params: {DRV.OPMODE: 2, HOME.MODE: 4, DIN1.MODE: 11, HOME.V_32: 300000}")
    text = text.replace("  wires:", "  - {name: cam, kind: position-sensor, from: 40, to: 50}\n  wires:")
    with Line.from_text(text.replace("WIRE", "x.place -> cam.position, cam.on -> x.input_0")) as line:
        line.wait_until(lambda: _record(line).homing.homed, 30.0, every=0.01)
        # 5 mm to a turn of the motor
        assert float(_record(line).homing.origin) * 5.0 == pytest.approx(40.0, abs=0.1)
