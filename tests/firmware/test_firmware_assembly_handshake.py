"""The position controller's handshake, octet by octet as the AKD EtherNet/IP manual has it in 6.2.4, and its errors."""

from __future__ import annotations

import pytest
from assembly_bench import (
    ENABLE,
    HARD_STOP,
    JOG,
    LOAD,
    MOVE,
    POSITION,
    REVOLUTION,
    SMOOTH_STOP,
    START_BLOCK,
    TORQUE,
    TORQUE_MODE,
    VELOCITY,
    AssemblyBench,
    command,
)

#: In position, and a status without a fault.
TARGET_1000 = bytes.fromhex("80002120e8030000")


@pytest.fixture
def unhomed() -> AssemblyBench:
    """As in the manual's example, whose responses have no Homed bit: a drive that may move without."""
    drive = AssemblyBench(homed=False)
    drive.axis.homing.settings.required = 0
    drive.enable()
    return drive


def test_the_five_steps_have_the_manuals_octets(unhomed: AssemblyBench) -> None:
    # 1, 2: a valid command, Load/Start low
    assert unhomed.send(TARGET_1000)[:8] == bytes.fromhex("8400002000000000")
    # 3, 4: Load/Start high
    assert unhomed.send(bytes.fromhex("81002120e8030000"))[:8] == bytes.fromhex("8100802000000000")
    # 5: Load/Start low; Load Complete goes, the move goes on, forwards
    assert unhomed.send(bytes.fromhex("80002120e8030000"))[:8] == bytes.fromhex("9100002000000000")
    unhomed.run(500)
    assert unhomed.response[:8] == bytes.fromhex("8400002000000000")
    assert unhomed.signed(8) == pytest.approx(1000, abs=655)
    assert unhomed.axis.profile.position * REVOLUTION == pytest.approx(1000.0)


def test_an_error_has_the_manuals_octets(unhomed: AssemblyBench) -> None:
    """Step 4 of the example, where data are out of range; its status word 1 has no In Position, which is 1 at rest."""
    unhomed.store.set("SWLS.EN", 2)
    unhomed.store.set("SWLS.LIMIT1", 900 << 16)
    unhomed.axis.homing.homed = 1
    unhomed.send(TARGET_1000)
    found = unhomed.send(bytes.fromhex("81002120e8030000"))
    assert found[1:8] == bytes.fromhex("00003409ff2120")
    assert found[0] & ENABLE
    assert not found[0] & LOAD, "not in motion"


def test_load_complete_stays_until_load_start_falls_and_nothing_is_loaded_twice() -> None:
    drive = AssemblyBench()
    drive.enable()
    drive.load(ENABLE, MOVE, position=REVOLUTION, velocity=REVOLUTION * 10, up=REVOLUTION * 100, down=REVOLUTION * 100)
    assert drive.second & 0x80
    drive.run(1000)
    assert drive.second & 0x80
    assert drive.first & 0x04
    # other data with Load/Start high are not taken
    drive.send(
        command(ENABLE | LOAD, MOVE, position=0, velocity=REVOLUTION * 10, up=REVOLUTION * 100, down=REVOLUTION * 100),
        100,
    )
    assert not drive.first & 0x01
    drive.send(command(ENABLE))
    assert not drive.second & 0x80


def test_an_error_goes_when_load_start_falls() -> None:
    drive = AssemblyBench()
    drive.enable()
    drive.load(ENABLE, 0x0C)
    assert drive.error == (0x08, 0x01)
    drive.run(100)
    assert drive.error == (0x08, 0x01)
    drive.send(command(ENABLE))
    assert drive.error == (0, 0)
    assert drive.response[3] == 0x20


FAST = {"velocity": REVOLUTION, "up": REVOLUTION, "down": REVOLUTION}


@pytest.mark.parametrize(
    ("mode", "word", "kind", "fields", "error"),
    [
        (POSITION, ENABLE, 0, {}, (0x08, 0x01)),
        (POSITION, ENABLE, 0x0A, {}, (0x08, 0x01)),
        (POSITION, ENABLE, TORQUE, {"data": 100}, (0x0C, 0xFF)),
        (VELOCITY, ENABLE, MOVE, FAST, (0x0C, 0xFF)),
        (TORQUE_MODE, ENABLE, JOG, FAST, (0x0C, 0xFF)),
        (POSITION, ENABLE, MOVE, FAST | {"velocity": 0}, (0x09, 0xFF)),
        (POSITION, ENABLE, MOVE, FAST | {"velocity": -1}, (0x09, 0xFF)),
        (POSITION, ENABLE, MOVE, FAST | {"up": 0}, (0x09, 0xFF)),
        (POSITION, ENABLE, MOVE, FAST | {"down": -5}, (0x09, 0xFF)),
        (VELOCITY, ENABLE, JOG, FAST | {"velocity": -1}, (0x09, 0xFF)),
        (TORQUE_MODE, ENABLE, TORQUE, {"data": 9001}, (0x09, 0xFF)),
        (TORQUE_MODE, ENABLE, TORQUE, {"data": -9001}, (0x09, 0xFF)),
        (VELOCITY, ENABLE, 0x03, {"data": 0}, (0x09, 0xFF)),
        (VELOCITY, ENABLE, 0x04, {"data": -1}, (0x09, 0xFF)),
        (VELOCITY, 0, JOG, FAST, (0x10, 0xFF)),
        (POSITION, 0, MOVE, FAST, (0x10, 0xFF)),
        (POSITION, ENABLE | SMOOTH_STOP, MOVE, FAST, (0x0C, 0xFF)),
        (VELOCITY, ENABLE | SMOOTH_STOP, JOG, FAST, (0x0C, 0xFF)),
        (VELOCITY, ENABLE | START_BLOCK, JOG, FAST, (0x0C, 0xFF)),
    ],
)
def test_a_command_that_cannot_be_has_its_error_and_its_echo(mode, word, kind, fields, error) -> None:
    drive = AssemblyBench(mode)
    drive.enable()
    if not word & ENABLE:
        drive.send(command(0), 10)
    drive.load(word, kind, **fields)
    assert drive.error == error
    assert drive.response[3] == 0x34
    assert drive.response[6:8] == bytes([0x20 | kind, 0x20])
    assert not drive.second & 0x80
    drive.run(50)
    assert abs(float(drive.axis.motor.velocity)) < 0.5


@pytest.mark.parametrize(("octets", "error"), [("81004120", (0x05, 0x01)), ("81002140", (0x05, 0x02))])
def test_another_axis_there_is_not(octets: str, error: tuple[int, int]) -> None:
    drive = AssemblyBench()
    drive.enable()
    drive.send(bytes.fromhex("80" + octets[2:]))
    drive.send(bytes.fromhex(octets))
    assert drive.error == error
    assert drive.response[6:8] == bytes.fromhex(octets)[2:]


def test_a_response_type_there_is_not_is_answered_in_each_response_while_it_is_asked_for() -> None:
    drive = AssemblyBench()
    drive.enable()
    drive.send(command(ENABLE, 0, response=0x06))
    assert drive.error == (0x08, 0x02)
    drive.send(command(ENABLE))
    assert drive.error == (0, 0)


def test_a_load_in_the_first_frame_of_a_connection_counts_as_its_edge() -> None:
    drive = AssemblyBench(VELOCITY)
    drive.send(command(LOAD, 0x03, data=200 * REVOLUTION))
    assert drive.second & 0x80
    drive.enable()
    drive.load(ENABLE | 0x08, 0x02, 26, data=10 * REVOLUTION)
    assert float(drive.axis.motor.velocity) == pytest.approx(300, abs=30), "12000 rpm/s"


def test_a_hard_stop_bars_commands_until_enable_was_cleared() -> None:
    drive = AssemblyBench(VELOCITY)
    drive.enable()
    drive.send(command(ENABLE | HARD_STOP), 20)
    drive.load(ENABLE, JOG, **FAST)
    assert drive.error == (0x10, 0xFF)
    drive.enable()
    drive.load(ENABLE, JOG, **FAST)
    assert drive.error == (0, 0)
