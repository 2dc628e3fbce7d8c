"""The list of command and response types is what the drive does: those listed are taken, every other one is refused."""

from __future__ import annotations

import pytest
from assembly_bench import ENABLE, FORWARDS, LOAD, POSITION, TORQUE_MODE, VELOCITY, AssemblyBench

from pnfarm.firmware.ethernetip.message_types import (
    COMMAND_OCTETS,
    COMMAND_TYPES,
    ERROR_TYPE,
    ERRORS,
    NO_AXIS,
    NO_COMMAND_TYPE,
    NO_RESPONSE_AXIS,
    NO_RESPONSE_TYPE,
    RESPONSE_OCTETS,
    RESPONSE_TYPES,
    MessageType,
    Octets,
)

MODES = {"torque": TORQUE_MODE, "velocity": VELOCITY, "position": POSITION}
COMMANDS = {one.number: one for one in COMMAND_TYPES}
RESPONSES = {one.number: one for one in RESPONSE_TYPES}
SIZES = {"USINT": 1, "UINT": 2, "DINT": 4, "UDINT": 4}
#: Of each datum: a distance, a speed, a ramp, milliamperes, an attribute or an instance that there is.
VALUE = 5
AXIS = 1 << 5
IN_MOTION = 0x01


def assembly(kind: MessageType | None, command: int, response: int = AXIS, *, load: bool = False) -> bytes:
    """A command with these octets 2 and 3, and data in all octets of its type."""
    data = bytearray(64)
    data[0] = ENABLE | FORWARDS | (LOAD if load else 0)
    data[2:4] = command, response
    for octets in kind.data if kind is not None else ():
        data[octets.first] = VALUE
        if octets.kind == "DINT":
            data[octets.first + 1] = VALUE
    return bytes(data)


def load(drive: AssemblyBench, kind: MessageType | None, command: int, response: int = AXIS) -> int:
    """Load/Start rises; the error, code in the low octet. A task of the event loop is answered well."""
    drive.send(assembly(kind, command, response))
    assert not drive.second & 0x80
    drive.send(assembly(kind, command, response, load=True), 2)
    drive.axis.ethernetip.settings.answer_status = 0
    drive.image.parameter_answered = drive.image.parameter_task
    drive.run()
    status, additional = drive.error
    return status | additional << 8


def ready(mode: int) -> AssemblyBench:
    drive = AssemblyBench(mode)
    drive.enable()
    return drive


@pytest.mark.parametrize("kind", COMMAND_TYPES, ids=lambda kind: kind.name)
def test_a_listed_command_is_loaded_in_each_of_its_modes_and_refused_in_others(kind: MessageType) -> None:
    assert kind.modes
    for name, mode in MODES.items():
        drive = ready(mode)
        error = load(drive, kind, AXIS | kind.number)
        assert (error == 0) == (name in kind.modes), (name, hex(error))
        assert bool(drive.second & 0x80) == (error == 0), "Load Complete"
        assert error & 0xFF != NO_COMMAND_TYPE & 0xFF
        assert bool(drive.first & IN_MOTION) == (name in kind.begins), name


@pytest.mark.parametrize("kind", COMMAND_TYPES, ids=lambda kind: kind.name)
def test_a_command_takes_the_octets_that_the_list_has_and_no_others(kind: MessageType) -> None:
    """Load Complete and the axis are the same, whatever the octets hold that no list names."""
    listed = {place for octets in (*kind.data, *COMMAND_OCTETS) for place in range(octets.first, octets.last + 1)}
    found = []
    for filled in (0x00, 0xFF):
        drive = ready(MODES[kind.modes[0]])
        for high in (False, True):
            data = bytearray(assembly(kind, AXIS | kind.number, load=high))
            for place in set(range(64)) - listed:
                data[place] = filled
            drive.send(bytes(data), 2)
        drive.axis.ethernetip.settings.answer_status = 0
        drive.image.parameter_answered = drive.image.parameter_task
        drive.run(20)
        own = drive.axis.ethernetip
        found.append(
            (drive.response, int(own.task_value), int(own.target_units), int(own.velocity_units), float(own.up))
        )
    assert found[0] == found[1]


def test_every_other_octet_of_a_command_s_type_is_refused() -> None:
    drive = ready(POSITION)
    for octet in range(256):
        number, axis = octet & 0x1F, octet >> 5
        if axis != 1:
            assert load(drive, None, octet) == NO_AXIS, hex(octet)
        elif number not in COMMANDS:
            assert load(drive, None, octet) == NO_COMMAND_TYPE, hex(octet)
            assert drive.response[6:8] == bytes((octet, AXIS))


def test_a_listed_response_is_given_and_every_other_octet_of_its_type_is_refused() -> None:
    drive = ready(POSITION)
    for octet in range(256):
        number, axis = octet & 0x1F, octet >> 5
        drive.send(assembly(None, AXIS, octet))
        if number in RESPONSES:
            assert (drive.response[3], drive.error) == (octet, (0, 0))
        else:
            assert drive.error == (NO_RESPONSE_TYPE & 0xFF, NO_RESPONSE_TYPE >> 8), hex(octet)
            assert drive.response[3] == octet & 0xE0 | ERROR_TYPE
        # with a command its axis counts, too
        loaded = load(drive, COMMANDS[3], AXIS | 3, octet)
        wanted = NO_RESPONSE_AXIS if axis != 1 else 0 if number in RESPONSES else NO_RESPONSE_TYPE
        assert loaded == wanted, hex(octet)


@pytest.mark.parametrize("kind", RESPONSE_TYPES, ids=lambda kind: kind.name)
def test_a_response_has_data_in_the_octets_that_the_list_has_and_zero_in_the_others(kind: MessageType) -> None:
    drive = ready(TORQUE_MODE)
    load(drive, COMMANDS[5], AXIS | 5)
    drive.send(assembly(None, AXIS | 5, AXIS | kind.number), 20)
    if kind.number == ERROR_TYPE:
        drive.send(assembly(None, AXIS | 0x0C, AXIS | kind.number, load=True))
    own = {place for octets in kind.data for place in range(octets.first, octets.last + 1)}
    always = {place for octets in RESPONSE_OCTETS for place in range(octets.first, octets.last + 1)}
    assert own <= {4, 5, 6, 7}
    assert not own & always
    assert any(drive.response[place] for place in own) == bool(kind.data)
    assert not any(drive.response[place] for place in range(64) if place not in own | always)


@pytest.mark.parametrize("kind", [*COMMAND_TYPES, *RESPONSE_TYPES], ids=lambda kind: f"{kind.number:02X} {kind.name}")
def test_octets_follow_each_other_and_have_the_size_of_their_type(kind: MessageType) -> None:
    everywhere: list[Octets] = [*(RESPONSE_OCTETS if kind in RESPONSE_TYPES else COMMAND_OCTETS), *kind.data]
    places = [place for octets in everywhere for place in range(octets.first, octets.last + 1)]
    assert len(places) == len(set(places))
    for octets in everywhere:
        assert SIZES.get(octets.kind, octets.last - octets.first + 1) == octets.last - octets.first + 1, octets
        assert octets.meaning
    assert kind.source
    assert kind.source != "assumed" or kind.note


def test_each_error_of_the_list_is_named_once() -> None:
    assert len(ERRORS) == len({meaning for meaning, _ in ERRORS.values()})
    assert {NO_AXIS, NO_RESPONSE_AXIS, NO_COMMAND_TYPE, NO_RESPONSE_TYPE} <= ERRORS.keys()
