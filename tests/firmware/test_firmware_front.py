"""The front of an axis: what lies behind it knows orders, and no word of a bus."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from bench_axis import BenchAxis

from pnfarm import firmware
from pnfarm.table.axis_codes import (
    POWER_ENABLE,
    POWER_NO_COAST,
    POWER_NO_QUICK_STOP,
    POWER_ON,
    TASK_MDI,
)

READY = POWER_NO_COAST | POWER_NO_QUICK_STOP
RUN = READY | POWER_ON | POWER_ENABLE
#: A number that no front has.
NO_FRONT = 255
FOLDER = Path(firmware.__file__).parent
BEHIND = sorted(path for path in FOLDER.glob("*.py") if path.name not in {"front.py", "axis.py", "__init__.py"})


class LedByOrders(BenchAxis):
    """An axis of no front that there is: the test writes its orders."""

    def __init__(self) -> None:
        super().__init__()
        self.axis.front = NO_FRONT
        for name in self.axis.orders.dtype.names:
            self.axis.orders[name] = 0
        self.image.sent[:] = 0
        self.axis.ramp.up = self.axis.ramp.down = 10_000.0

    def order(self, power: int, run: int = 1) -> None:
        orders = self.axis.orders
        orders.led = 1
        orders.power_changed = power ^ int(orders.power)
        orders.power = power
        self.run(run)

    def enable(self, rpm: float = 0.0) -> None:
        self.axis.ramp.setpoint = rpm
        for power in (READY, READY | POWER_ON, RUN):
            self.order(power)
        assert self.axis.drive.state == 4


def test_a_drive_turns_and_stops_by_orders_alone():
    drive = LedByOrders()
    drive.axis.orders.ramp = drive.axis.orders.ramp_runs = drive.axis.orders.setpoint = 1
    drive.enable(300.0)
    drive.run(300)
    assert abs(float(drive.axis.motor.velocity) - 300.0) < 1.0
    drive.order(RUN & ~POWER_NO_QUICK_STOP, 200)
    assert drive.axis.drive.state == 1
    assert abs(float(drive.axis.motor.velocity)) < 1.0
    assert not drive.image.sent.any(), "no front: nothing is told"


@pytest.mark.parametrize("paused", [False, True])
def test_a_drive_goes_to_a_target_by_orders_alone(paused: bool):
    drive = LedByOrders()
    axis = drive.axis
    axis.drive.settings.opmode = 2
    axis.positioning.settings.gain = 50.0
    axis.motor.settings.speed_feed_forward = 1.0
    drive.enable()
    asked = axis.asked
    asked.position, asked.velocity, asked.acceleration, asked.deceleration = 3.0, 600.0, 20_000.0, 20_000.0
    asked.number, asked.override, asked.begins = TASK_MDI, 1.0, 1
    drive.run(1)
    asked.begins = 0
    drive.run(100)
    axis.orders.pause = paused
    drive.run(1000)
    place = float(axis.motor.position)
    assert (abs(place - 3.0) < 0.01) != paused
    axis.orders.pause = 0
    drive.run(1000)
    assert abs(float(axis.motor.position) - 3.0) < 0.01
    assert axis.positioning.target_reached


@pytest.mark.parametrize("path", BEHIND, ids=lambda path: path.stem)
def test_nothing_behind_the_front_knows_its_words(path: Path):
    tree = ast.parse(path.read_text("utf-8"))
    imported = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert not {module for module in imported if "profidrive" in str(module) or str(module).endswith("table.signals")}
    used = {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    used |= {node.arg for node in ast.walk(tree) if isinstance(node, ast.arg)}
    assert not used & {"profidrive", "stw1", "zsw1", "received", "sent"}
