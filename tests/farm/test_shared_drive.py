"""A drive that two controllers share: each has its own connection, one of them feeds the drive."""

from __future__ import annotations

import pytest
from shared_line import SharedLine

from pnfarm.protocols.profinet.cm.ar import CmdevState

FILE = """
farm: shared
link: {kind: memory}
drives:
  - {name: axis-01, model: moog-msd, ip: 10.77.0.11/23, params: {P-1283: 200}}
controller:
  name: plc
  ip: 10.77.1.250/23
  cycle: 1ms
  telegram: 1
  program: {kind: constant, speed_rpm: 60, acknowledge_after: 200ms}
"""
HEAD, DRIVE = 0, 1


@pytest.fixture
def line() -> SharedLine:
    """Controller 0 has the head, controller 1 the telegram."""
    line = SharedLine(FILE, [lambda slot: slot == 0, lambda slot: slot == 1])
    assert line.until(lambda: all(c.all_connected for c in line.controllers)), line.reasons()
    return line


def test_two_controllers_are_in_data_and_the_owner_of_the_telegram_moves_the_drive(line: SharedLine) -> None:
    (station,) = line.farm.axes
    line.run(1.0)
    assert [(ar.initiator_name, {key[1] for key in ar.owned}) for ar in station.device.cm.ars] == [
        ("plc-0", {0}),
        ("plc-1", {1}),
    ]
    assert sum(line.farm.columns.cpm["active"]) == 2
    assert station.handle.axis.drive.state == 4
    assert station.handle.axis.motor.velocity == pytest.approx(60.0, abs=0.1)


def test_a_controller_that_does_not_own_the_telegram_cannot_drive_the_axis_nor_fault_it_by_leaving(
    line: SharedLine,
) -> None:
    (station,) = line.farm.axes
    line.run(1.0)
    line.controllers[HEAD].columns.ppm["active"] = 0
    line.run(2.0)
    assert [ar.initiator_name for ar in station.device.cm.ars] == ["plc-1"]
    assert station.device.watchdog_expirations == 1
    assert station.handle.axis.drive.state == 4
    assert station.handle.axis.faults.code[0] == 0
    assert station.handle.axis.motor.velocity == pytest.approx(60.0, abs=0.1)


def test_the_loss_of_the_owner_of_the_telegram_faults_the_drive_and_the_other_stays(line: SharedLine) -> None:
    (station,) = line.farm.axes
    line.run(1.0)
    line.controllers[DRIVE].columns.ppm["active"] = 0
    assert line.until(lambda: station.handle.axis.faults.code[0] != 0, 1.0)
    assert station.model.faults[int(station.handle.axis.faults.code[0]) & 0xFFFFFF].label == "32-1"
    assert [ar.initiator_name for ar in station.device.cm.ars] == ["plc-0"]


def test_a_missing_application_ready_is_counted_and_missing_on_one_of_two_connections_that_start_at_once() -> None:
    line = SharedLine(FILE, [lambda slot: slot == HEAD, lambda slot: slot == DRIVE])
    fault = line.farm.injections.inject({"kind": "no-application-ready", "on": "all", "count": 1}, line.world.now)
    line.run(1.0)
    (station,) = line.farm.axes
    assert sorted(ar.state for ar in station.device.cm.ars) == [CmdevState.DATA, CmdevState.W_ARDY]
    assert fault.evidence().activations == 1
