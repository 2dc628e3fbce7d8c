"""The position controller's assemblies in words (AKD EtherNet/IP manual 6.2.2, 6.2.3)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from pnfarm.drives.profiles.cip.words import CONTROL_BITS, STATUS_1_BITS, STATUS_2_BITS
from pnfarm.firmware.ethernetip.message_types import (
    COMMAND_TYPES,
    ERROR_TYPE,
    JOG_MOVE,
    PARAMETER,
    POSITION_MOVE,
    RESPONSE_TYPES,
    SET_ATTRIBUTE,
    TARGET_POSITION,
    TORQUE,
)
from pnfarm.protocols.enip.status import status_text

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.drives.description.model import Model

__all__ = ["STATIC", "changes", "values"]

#: Octets of the static part; an assembly that is shorter is not of this kind.
STATIC: Final = 36
#: Class of the position controller, whose attributes are numbered in the assemblies.
_CONTROLLER: Final = 0x25
_LOAD: Final = 0x01
_COMMANDS: Final = {0x00: "none"} | {one.number: one.name for one in COMMAND_TYPES}
_RESPONSES: Final = {one.number: one.name for one in RESPONSE_TYPES}
_MAPS: Final = {0: "static", 1: "custom map", 2: "dynamic map"}
# Octets.
_CONTROL, _BLOCK, _COMMAND, _RESPONSE, _DATA = 0, 1, 2, 3, 4
_POSITION, _VELOCITY, _ACCELERATION, _DECELERATION = 8, 12, 16, 20
_PARAMETER_DATA, _ATTRIBUTE, _MAP = 24, 32, 33
_STATUS_1, _STATUS_2, _MOTION = 0, 2, 16
#: Bits that follow from every motion, and so make no line.
_DIRECTION: Final = 0x10


def _signed(data: bytes, place: int, size: int = 4) -> int:
    return int.from_bytes(data[place : place + size], "little", signed=True)


def _number(data: bytes, place: int, size: int) -> int:
    return int.from_bytes(data[place : place + size], "little")


def _bits(old: int, new: int, names: tuple[str, ...]) -> str:
    words = []
    for bit in range(8):
        if (old ^ new) >> bit & 1:
            name = names[bit].replace("_", " ") if bit < len(names) and names[bit] else f"bit {bit}"
            words.append(f"{name} {'set' if new >> bit & 1 else 'reset'}")
    return ", ".join(words)


def _set_bits(word: int, names: tuple[str, ...]) -> str:
    return ", ".join(names[bit].replace("_", " ") or f"bit {bit}" for bit in range(8) if word >> bit & 1) or "none"


def _type(octet: int, known: dict[int, str]) -> str:
    """A type with its axis: the lower five bits, and the upper three."""
    kind, axis = octet & 0x1F, octet >> 5
    text = f"0x{kind:02X} {known.get(kind, 'unknown')}"
    return text if axis == 1 or not octet else f"{text} of axis {axis}"


def _attribute(number: int, model: Model | None) -> str:
    row = model.cip.attributes.get((_CONTROLLER, number)) if model is not None else None
    return f"attribute {number} {row.name}" if row is not None else f"attribute {number}"


def _command(data: bytes, model: Model | None) -> str:
    """What a loaded command asks for."""
    kind = data[_COMMAND] & 0x1F
    text = _type(data[_COMMAND], _COMMANDS)
    if kind in {POSITION_MOVE, JOG_MOVE}:
        target = f"position {_signed(data, _POSITION)}, " if kind == POSITION_MOVE else ""
        velocity, up, down = (_signed(data, place) for place in (_VELOCITY, _ACCELERATION, _DECELERATION))
        return f"{text}: {target}velocity {velocity}, acceleration {up}, deceleration {down}"
    if kind == SET_ATTRIBUTE:
        number = _number(data, _DATA, 2)
        return f"{text}: {_attribute(number, model)} = {_signed(data, _PARAMETER_DATA, 8)}"
    if kind == PARAMETER:
        number = _number(data, _DATA, 2)
        row = model.cip.instances.get(number) if model is not None else None
        name = f"{number} {row.name}" if row is not None else str(number)
        if data[_DATA + 2] == 1:
            return f"{text}: writes {name} = {_signed(data, _PARAMETER_DATA, 8)}"
        return f"{text}: reads {name}"
    if TARGET_POSITION <= kind <= TORQUE:
        return f"{text}: {_signed(data, _DATA)}"
    return text


def _error(data: bytes) -> str:
    """The response of an error: status, additional code, echo of the two types."""
    command, response = data[_DATA + 2], data[_DATA + 3]
    return (
        f"{status_text(data[_DATA])} (0x{data[_DATA]:02X}, additional 0x{data[_DATA + 1]:02X}) of command "
        f"{_type(command, _COMMANDS)}, response {_type(response, _RESPONSES)}"
    )


def changes(
    before: bytes, after: bytes, model: Model | None, *, from_device: bool
) -> Iterator[tuple[str, str, dict[str, int]]]:
    """What changed between two frames: the word's name, text, and details.  Both have the static part."""
    yield from _response_changes(before, after) if from_device else _command_changes(before, after, model)


def _command_changes(before: bytes, after: bytes, model: Model | None) -> Iterator[tuple[str, str, dict[str, int]]]:
    old, new = before[_CONTROL], after[_CONTROL]
    if old != new:
        text = f"0x{old:02X} -> 0x{new:02X}: {_bits(old, new, CONTROL_BITS)}"
        yield "control word", text, {"before": old, "after": new}
    if new & _LOAD and not old & _LOAD:
        yield "command", _command(after, model), {"command_type": after[_COMMAND] & 0x1F}
    if before[_BLOCK] != after[_BLOCK]:
        yield "block number", f"{before[_BLOCK]} -> {after[_BLOCK]}", {"before": before[_BLOCK], "after": after[_BLOCK]}
    if before[_RESPONSE] != after[_RESPONSE]:
        yield "response type", f"asks for {_type(after[_RESPONSE], _RESPONSES)}", {}
    if before[_ATTRIBUTE] != after[_ATTRIBUTE]:
        number = after[_ATTRIBUTE]
        yield "attribute to get", _attribute(number, model) if number else "none", {"attribute": number}
    if before[_MAP] != after[_MAP]:
        yield "map type", f"{after[_MAP]} {_MAPS.get(after[_MAP], 'unknown')}", {"map_type": after[_MAP]}


def _response_changes(before: bytes, after: bytes) -> Iterator[tuple[str, str, dict[str, int]]]:
    for name, place, names, quiet in (
        ("status word 1", _STATUS_1, STATUS_1_BITS, _DIRECTION),
        ("status word 2", _STATUS_2, STATUS_2_BITS, 0),
    ):
        old, new = before[place] & ~quiet, after[place] & ~quiet
        if old != new:
            details = {"before": before[place], "after": after[place]}
            yield name, f"0x{before[place]:02X} -> 0x{after[place]:02X}: {_bits(old, new, names)}", details
    if before[_BLOCK] != after[_BLOCK]:
        text = f"{before[_BLOCK]} -> {after[_BLOCK]}"
        yield "executing block", text, {"before": before[_BLOCK], "after": after[_BLOCK]}
    if after[_RESPONSE] & 0x1F == ERROR_TYPE:
        if before[_RESPONSE : _DATA + 4] != after[_RESPONSE : _DATA + 4]:
            status = {"status": after[_DATA], "additional": after[_DATA + 1]}
            yield "response error", _error(after), status
    elif before[_RESPONSE] != after[_RESPONSE]:
        yield "response type", _type(after[_RESPONSE], _RESPONSES), {"response_type": after[_RESPONSE] & 0x1F}


def values(data: bytes, *, from_device: bool) -> str:
    """The static part's values."""
    numbers = f"position {_signed(data, _POSITION)} velocity {_signed(data, _VELOCITY)}"
    if not from_device:
        word = data[_CONTROL]
        return (
            f"control 0x{word:02X} ({_set_bits(word, CONTROL_BITS)}) command {_type(data[_COMMAND], _COMMANDS)} "
            f"{numbers}"
        )
    first, second, motion = data[_STATUS_1], data[_STATUS_2], _number(data, _MOTION, 4)
    answer = _error(data) if data[_RESPONSE] & 0x1F == ERROR_TYPE else _type(data[_RESPONSE], _RESPONSES)
    return (
        f"status 1 0x{first:02X} ({_set_bits(first, STATUS_1_BITS)}) status 2 0x{second:02X} "
        f"({_set_bits(second, STATUS_2_BITS)}) response {answer} {numbers} motion status 0x{motion:08X}"
    )
