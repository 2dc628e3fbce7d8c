"""The AKD of manual edition B in a farm, as its controller sees it."""

from __future__ import annotations

import asyncio
from dataclasses import replace

import pytest
from hand_line import HandLine
from record_line import MANUAL_3_6_2_REQUEST, MANUAL_3_6_2_RESPONSE, access, reading, value_of
from virtual_line import VirtualLine

from pnfarm.controller import line as controller_line
from pnfarm.drives.parameters.memory import VolatileMemory
from pnfarm.drives.profiles.profidrive.base_mode import parse_response
from pnfarm.errors import ConfigError
from pnfarm.farm.file.reading import parse_farm
from pnfarm.protocols.profinet.wire.rtc import DataStatus
from pnfarm.station.event_log import EventLog
from pnfarm.table.signals import NIST_A

NAME = "akd-profinet-2012"


def line_of(**options) -> VirtualLine:
    return VirtualLine(model=NAME, **{"cycle": "8ms", **options})


@pytest.mark.parametrize("telegram", [0, 1, 7, 9, 350])
def test_5_11_every_telegram_connects_at_the_8_ms_of_4_2_2_and_exchanges_data(telegram):
    line = line_of(telegram=telegram)
    line.connect()
    line.run(1.0)
    station = line.farm.axes[0]
    assert station.store.telegram_number == telegram
    assert station.station.config.strict
    consumer = line.plc.columns.cpm[line.plc.sessions[0].consumer]
    assert consumer.received >= 120
    assert line.plc.sessions[0].measures.losses == 0


def test_4_2_2_a_cycle_of_4_ms_is_refused_and_the_controller_is_told_why():
    line = line_of(cycle="4ms", limits="lax")
    station = line.farm.axes[0]
    station.station.config = replace(station.station.config, strict=True)
    station.station.power_cycle(line.world.now)
    line.run(2.0)
    session = line.plc.sessions[0]
    assert session.measures.connects == 0
    assert session.measures.refusals > 0
    assert "reduction ratio" in session.measures.last_reason


def test_4_2_2_a_farm_file_with_4_ms_is_refused_with_the_nearest_cycle():
    with pytest.raises(ConfigError, match=r"faster than akd-profinet-2012 can; the nearest is 8ms"):
        line_of(cycle="4ms")


def test_a_telegram_of_the_later_edition_is_refused_by_the_farm_file():
    with pytest.raises(ConfigError, match=r"akd-profinet-2012 has no telegram 351"):
        line_of(telegram=351)


@pytest.mark.parametrize("telegram", [1, 350])
def test_5_9_velocity_mode_runs_at_the_asked_speed(telegram):
    line = line_of(telegram=telegram)
    line.connect()
    line.enable()
    line.run(1.0)
    axis = line.farm.columns.axis[0]
    assert axis.drive.state == 4
    assert axis.motor.velocity == pytest.approx(60, abs=0.4)
    assert line.plc.columns.image[0].received[NIST_A] in {163, 164}


def test_3_6_every_parameter_is_read_over_the_wire():
    line = line_of()
    line.connect()
    for parameter in line.farm.axes[0].model.parameters.values():
        # 3.6 allows 0xEA elements at a time, fewer than the name of the station has
        for first in range(0, max(parameter.elements, 1), 0xEA):
            count = min(max(parameter.elements, 1) - first, 0xEA)
            data = access(line, reading((parameter.pnu, first, count)))
            assert data is not None
            response = parse_response(data)
            assert not response.negative, parameter
            assert len(response.entries[0].values) == count


def test_3_6_2_the_example_switches_the_operation_mode_over_the_wire():
    line = line_of()
    line.connect()
    assert access(line, MANUAL_3_6_2_REQUEST) == MANUAL_3_6_2_RESPONSE
    assert line.farm.columns.axis[0].drive.settings.opmode == 2


def test_a_silent_controller_gives_fault_702_and_after_its_return_recovery():
    line = line_of()
    line.connect()
    line.enable()
    line.plc.columns.ppm[0].active = 0
    line.run(0.2)
    station = line.farm.axes[0]
    assert station.device.watchdog_expirations == 1
    assert station.fault_counts == {702: 1}
    line.enable()
    assert line.farm.columns.axis[0].faults.code[0] == 0
    assert value_of(line, 947, 8) == (702,)
    assert value_of(line, 944) == (1,)


def test_a_controller_in_stop_gives_fault_702_too():
    line = line_of()
    line.connect()
    line.enable()
    line.plc.columns.ppm[0].data_status &= ~DataStatus.RUN & 0xFF
    line.run(0.1)
    station = line.farm.axes[0]
    assert station.device.watchdog_expirations == 0
    assert station.fault_counts == {702: 1}
    assert line.farm.columns.axis[0].motor.velocity == pytest.approx(0, abs=0.5)


@pytest.mark.parametrize(("name", "cycle"), [(NAME, "8ms"), ("akd-profinet", "16ms")])
def test_5_10_1_telegram_7_starts_a_motion_task_that_the_setup_left_in_the_drive(name, cycle):
    tasks = "[{number: 3, position: 2, velocity: 600, acceleration: 30000}, {number: 4, position: -1, velocity: 300, \
      acceleration: 30000, deceleration: 20000, relative: true, next: 3, wait: 100ms}]"
    line = HandLine(model=name, cycle=cycle, telegram=7, params="{930: 2}", tasks=tasks)
    line.enable_axis(0x043F)
    assert line.send(0x0C3F) & 0x0800
    line.send(0x043F)
    assert line.send(0x047F, SATZANW=3) & 0x1000
    assert line.actual("AKTSATZ") == 3
    line.send(0x043F, frames=10)
    line.until(0x2400)
    line.run(0.2)
    assert line.place == pytest.approx(2.0, abs=0.01)
    line.send(0x047F, SATZANW=4)
    seen = []
    while line.actual("AKTSATZ"):
        seen.append(line.actual("AKTSATZ"))
        line.run(0.02)
        assert len(seen) < 500
    assert set(seen) == {4, 3}
    line.run(0.2)
    assert line.place == pytest.approx(2.0, abs=0.01), "back by the task behind it"


@pytest.mark.parametrize(
    ("model", "tasks", "words"),
    [
        ("moog-msd", "[{number: 1, position: 1, velocity: 1, acceleration: 1}]", "moog-msd keeps no motion tasks"),
        (NAME, "[{number: 129, position: 1, velocity: 1, acceleration: 1}]", "number"),
        (NAME, "[{number: 1, position: 1, velocity: 0, acceleration: 1}]", "velocity"),
        (NAME, "[{number: 1, position: 1, velocity: 1, acceleration: 1, wait: x}]", "wait"),
        (
            NAME,
            str([{"number": 1, "position": 1, "velocity": 1, "acceleration": 1}] * 2),
            "1 is given twice",
        ),
    ],
)
def test_a_motion_task_of_the_farm_file_that_cannot_be_is_refused(model, tasks, words):
    with pytest.raises(ConfigError, match=words):
        VirtualLine(model=model, telegram=9, cycle="8ms", tasks=tasks, controller=False)


BOTH = """
farm: both
link: {kind: memory}
drives:
  - {name: older, model: akd-profinet-2012, ip: 10.77.0.11/23, cycle: 8ms}
  - {name: newer, model: akd-profinet, ip: 10.77.0.12/23, cycle: 16ms}
controller: {name: plc, ip: 10.77.1.250/23, program: {kind: constant, speed_rpm: 60}}
"""


def test_both_editions_run_in_one_farm_each_at_its_own_cycle():
    world = asyncio.run(
        controller_line.VirtualLine.create(
            parse_farm(BOTH), memory=VolatileMemory(), log=EventLog(quiet=True), plc_log=EventLog(quiet=True)
        )
    )
    assert world.world.run(5.0, until=lambda: world.plc.all_running)
    before = [int(world.plc.columns.cpm[session.consumer].received) for session in world.plc.sessions]
    world.world.run(1.6)
    after = [int(world.plc.columns.cpm[session.consumer].received) for session in world.plc.sessions]
    counts = dict(
        zip((s.plan.name for s in world.plc.sessions), (b - a for a, b in zip(before, after, strict=True)), strict=True)
    )
    assert counts["older"] == pytest.approx(200, abs=2)
    assert counts["newer"] == pytest.approx(100, abs=2)
    assert [float(world.farm.columns.axis[n].motor.velocity) for n in range(2)] == pytest.approx([60, 60], abs=0.5)
