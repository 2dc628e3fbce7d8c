"""A HIWIN E1 as its controller sees it: real frames and calls on a switch in memory, virtual time."""

from __future__ import annotations

import pytest
from parameter_requests import change_request, read_request
from record_line import access
from virtual_line import VirtualLine

from pnfarm.buses.profinet.controller.plan import plan_devices
from pnfarm.drives.catalogue import model
from pnfarm.drives.profiles.profidrive.base_mode import (
    ParameterAddress,
    ParameterValues,
    emit_request,
)
from pnfarm.errors import ConfigError
from pnfarm.farm.farm import model_of
from pnfarm.farm.file.reading import expand, parse_farm
from pnfarm.farm.views.snapshot import drive_snapshot
from pnfarm.table.program import RUNNING
from pnfarm.table.signals import (
    G1_XIST1,
    G1_XIST2,
    MELDW,
    NIST_B,
    STW1,
    STW2,
    XIST_A,
    ZSW1,
    ZSW2,
)

FBUS = 73


def line_of(telegram: int = 3, cycle: str = "1ms", **options) -> VirtualLine:
    return VirtualLine(model="hiwin-e1", telegram=telegram, cycle=cycle, **options)


def axis_of(line: VirtualLine, drive: int = 0):
    return line.farm.columns.axis[drive]


def seen(line: VirtualLine, slot: int, drive: int = 0) -> int:
    """A signal as the controller received it."""
    return int(line.plc.columns.image[drive].received[slot])


def active(line: VirtualLine, drive: int = 0) -> list[int]:
    return [int(code) & 0xFFFFFF for code in axis_of(line, drive).faults.code if code]


# -- connecting ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("cycle", ["500us", "1ms", "2ms", "4ms"])
def test_2_2_every_send_clock_of_the_table_runs(cycle):
    line = line_of(cycle=cycle)
    line.enable()
    line.run(0.5)
    assert axis_of(line).motor.velocity == pytest.approx(60.0, abs=0.1)
    assert line.plc.sessions[0].measures.losses == 0
    assert axis_of(line).life.errors == 0


@pytest.mark.parametrize(("cycle", "words"), [("250us", "faster"), ("8ms", "slower")])
def test_2_2_other_cycles_are_refused_by_the_farm_file_unless_limits_are_lax(cycle, words):
    with pytest.raises(ConfigError, match=f"{words} than hiwin-e1 can"):
        line_of(cycle=cycle)
    line = line_of(cycle=cycle, limits="lax")
    line.connect()


@pytest.mark.parametrize("startup", ["legacy", "advanced"])
def test_2_7_a_controller_starts_up_assigns_the_address_and_exchanges(startup):
    line = line_of(startup=startup, drives=2)
    line.connect()
    for station in line.farm.axes:
        assert str(station.device.ip.address).startswith("10.77.0.")
    line.run(0.1)
    assert all(int(axis.profidrive.image_valid) for axis in line.farm.columns.axis[:2])


def test_a_controller_without_a_telegram_of_its_own_takes_telegram_3():
    text = (
        "farm: f\nlink: {kind: memory}\ndrives: [{name: a, model: e1, ip: 10.0.0.1/24}]\n"
        "controller: {name: plc, ip: 10.0.0.9/24, cycle: 1ms}\n"
    )
    config = parse_farm(text)
    drives = expand(config)
    (plan,) = plan_devices(config.controller, drives, [model_of(drive) for drive in drives])
    assert plan.submodules[-1].submodule_ident == 0x00020003
    assert plan.life


def test_2_5_3_iops_and_iocs_are_good_while_data_are_valid():
    line = line_of()
    line.connect()
    line.run(0.1)
    session = line.plc.sessions[0]
    assert int(line.plc.columns.cpm[session.consumer].iops) == 0x80
    (ar,) = line.farm.axes[0].device.ars.values()
    assert int(line.farm.columns.cpm[ar.consumers[0][0]].iops) == 0x80


# -- speed mode ------------------------------------------------------------------------------------------------------


def test_3_3_1_speed_mode_walks_through_the_states_and_runs():
    line = line_of()
    line.enable()
    line.run(0.5)
    axis = axis_of(line)
    assert axis.drive.state == 4
    assert axis.motor.velocity == pytest.approx(60.0, abs=0.01)
    assert seen(line, ZSW1) & 0xFFFF == 0x0737
    # 6.1: 60 rpm of 3000
    assert seen(line, NIST_B) == pytest.approx(0x40000000 * 60 / 3000, rel=1e-4)
    assert seen(line, G1_XIST1) == pytest.approx(axis.motor.position * 2**23, abs=2**23 / 500)


def test_the_speed_is_there_without_a_ramp():
    line = line_of()
    line.plc.columns.program[0].speed = 1500.0
    line.enable()
    line.run(0.003)
    assert axis_of(line).ramp.command == pytest.approx(1500.0, abs=1e-3)


def test_stopping_and_starting_again():
    line = line_of()
    line.enable()
    line.run(0.2)
    line.plc.columns.program[0].enable = 0
    line.run(0.5)
    assert axis_of(line).motor.velocity == 0.0
    assert axis_of(line).drive.state == 2
    assert not seen(line, ZSW1) & 0x0004
    line.plc.columns.program[0].enable = 1
    line.enable()
    line.run(0.2)
    assert axis_of(line).motor.velocity == pytest.approx(60.0, abs=0.01)


def test_6_1_another_reference_velocity_scales_both_directions():
    line = line_of()
    line.enable()
    request = change_request(3, [(ParameterAddress(0x2317, 0, 0), ParameterValues(0x06, (6000,)))])
    assert access(line, emit_request(request)) == bytes.fromhex("03 02 00 01")
    line.run(0.3)
    # the controller was planned for 3000 rpm
    assert axis_of(line).motor.velocity == pytest.approx(120.0, abs=0.05)
    assert seen(line, NIST_B) == pytest.approx(0x40000000 * 60 / 3000, rel=1e-3)


def test_a_farm_files_parameter_reaches_the_controller():
    text = (
        "farm: f\nlink: {kind: memory}\ndrives: [{name: a, model: e1, ip: 10.0.0.1/24, params: {Pt317: 1000}}]\n"
        "controller: {name: plc, ip: 10.0.0.9/24, cycle: 1ms}\n"
    )
    config = parse_farm(text)
    (plan,) = plan_devices(config.controller, expand(config), [model("hiwin-e1")])
    assert plan.steps.velocity_step * 0x4000 == 1000.0
    assert line_of().plc.sessions[0].plan.steps.velocity_step * 0x4000 == 3000.0


def test_bits_have_the_names_of_the_telegram():
    line = line_of()
    line.enable()
    line.run(0.2)
    shown = drive_snapshot(line.farm, line.farm.axes[0], line.world.now)
    # the controller sets bits 4 to 6 as every PROFIdrive controller does; this drive reserves them
    assert shown["stw1_bits"] == [
        "on", "no_coast_stop", "no_quick_stop", "enable_operation", "bit_4", "bit_5", "bit_6", "control_by_plc",
    ]  # fmt: skip
    assert "target_velocity_reached" in shown["zsw1_bits"]
    other = line_of(telegram=111)
    other.enable()
    shown = drive_snapshot(other.farm, other.farm.axes[0], other.world.now)
    assert "activate_traversing_task" in shown["stw1_bits"]


# -- sign of life ----------------------------------------------------------------------------------------------------


def counts(line: VirtualLine, frames: int) -> tuple[list[int], list[int]]:
    """What controller and drive count, frame by frame."""
    sent, received = [], []
    for _ in range(frames):
        line.run(0.001)
        sent.append(int(line.farm.columns.image[0].received[STW2]) >> 12 & 0xF)
        received.append(seen(line, ZSW2) >> 12 & 0xF)
    return sent, received


@pytest.mark.parametrize("telegram", [3, 9, 111])
def test_3_4_and_3_6_both_ends_count_from_1_to_15_with_each_frame(telegram):
    line = line_of(telegram)
    line.enable()
    line.run(0.1)
    for series in counts(line, 31):
        assert [1 + n % 15 for n in series[:-1]] == series[1:]
    assert axis_of(line).life.run == 15
    assert axis_of(line).life.errors == 0


def test_a_sign_of_life_that_stays_is_the_fieldbus_alarm_after_pnu_925_frames():
    line = line_of()
    line.enable()
    line.run(0.1)
    line.plc.columns.program[0].life = 0  # the controller's count stands from here on
    line.run(0.0055)
    assert 1 <= axis_of(line).life.errors <= 6
    line.run(0.003)
    assert active(line) == [FBUS]
    assert seen(line, ZSW1) & 0x0008
    line.plc.columns.program[0].life = 1
    assert line.world.run(3.0, until=lambda: line.plc.columns.program[0].phase == RUNNING)
    assert active(line) == []


def test_pnu_925_over_the_wire_changes_the_tolerance():
    line = line_of()
    line.enable()
    request = change_request(1, [(ParameterAddress(925, 0, 0), ParameterValues(0x06, (0xFFFF,)))])
    access(line, emit_request(request))
    line.plc.columns.program[0].life = 0
    line.run(0.5)
    assert active(line) == []
    assert axis_of(line).life.errors > 300


def test_a_drive_without_sign_of_life_is_sent_none():
    line = VirtualLine(cycle="16ms", telegram=9)
    line.connect()
    line.run(0.5)
    assert int(line.farm.columns.image[0].received[STW2]) == 0
    assert seen(line, ZSW2) == 0


def test_g1_xist1_counts_the_turns_and_g1_xist2_stays_0():
    line = line_of()
    line.enable()
    line.run(1.0)
    assert seen(line, G1_XIST1) == pytest.approx(float(axis_of(line).motor.position) * 2**23, rel=0.01)
    assert seen(line, G1_XIST2) == 0


# -- position mode ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("telegram", [9, 111])
def test_position_telegrams_are_exchanged_and_move_nothing_yet(telegram):
    line = line_of(telegram)
    line.enable()
    before = float(axis_of(line).motor.position)
    image = line.plc.columns.image[0]
    image.sent[2:9] = 0x7FFF
    line.run(0.5)
    axis = axis_of(line)
    assert axis.drive.settings.opmode == 2
    assert axis.drive.state == 4
    assert float(axis.motor.position) == before
    assert seen(line, ZSW1) & 0x0007 == 0x0007
    assert seen(line, ZSW2) & 0x0800
    assert seen(line, XIST_A) == 0
    if telegram == 111:
        assert seen(line, MELDW) & 0xFFFF == 0x39C2
    assert int(line.farm.columns.image[0].received[STW1]) == 0x047F
    data = access(line, emit_request(read_request(1, [ParameterAddress(930, 0, 0)])))
    assert data == bytes.fromhex("01 01 00 01 06 01 0002")


# -- parameters ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("index", [47, 0xB02E, 0xB02F])
def test_4_3_single_parameter_requests_only(index):
    line = line_of()
    line.connect()
    one = emit_request(read_request(1, [ParameterAddress(964, 0, 0)]))
    assert access(line, one, index=index) == bytes.fromhex("01 01 00 01 06 01 0AAA")
    two = emit_request(read_request(2, [ParameterAddress(922, 0, 0), ParameterAddress(925, 0, 0)]))
    assert access(line, two, index=index) == bytes.fromhex("02 81 00 01 44 01 0023")


def test_6_2_a_limit_takes_effect_after_power_on_and_outlives_it():
    line = line_of()
    line.plc.columns.program[0].speed = 1500.0
    line.enable()
    request = change_request(1, [(ParameterAddress(0x2316, 0, 0), ParameterValues(0x06, (500,)))])
    assert access(line, emit_request(request)) == bytes.fromhex("01 02 00 01")
    line.run(0.5)
    assert axis_of(line).motor.velocity == pytest.approx(1500.0, abs=1)
    station = line.farm.axes[0]
    station.station.power_cycle(line.world.now)
    line.farm.settle(station.station, line.world.now)
    line.run(0.2)
    line.enable()
    line.run(0.5)
    assert axis_of(line).motor.velocity == pytest.approx(500.0, abs=1)
    assert line.memory.load("axis-01")["drive"]["parameters"] == {str(0x2316): 500}
