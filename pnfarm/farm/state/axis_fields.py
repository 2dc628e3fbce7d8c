"""The fields that firmware and plant write into the record of an axis, as plain numbers.

Times are ages before the record's last step, None for none.  What belongs to the run or to a connection is not part of
a state: the command ring, the sign of life, causes of faults that are held, frame counters, the leg of homing.
"""

from __future__ import annotations

import hashlib
from math import inf, isfinite, isnan
from typing import TYPE_CHECKING, Any

import numpy as np

from pnfarm.farm.state.refused import RefusedStateError, listed, mapped
from pnfarm.firmware.axis import AXIS
from pnfarm.firmware.motion import jog, positioning
from pnfarm.firmware.profidrive import sensor_interface
from pnfarm.table.axis_codes import CMD_HOLD_FAULT, CMD_RELEASE_FAULT, COMMANDS, JERK_TAPS, MOTION_TASKS, TASK_MDI
from pnfarm.vocabulary.quoting import shown

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.engine.columns import Columns
    from pnfarm.table.layout import Field

__all__ = ["LAYOUT", "check_fields", "fields_of", "octets_of", "put_octets"]

_OF_RUN = frozenset(
    {
        "last_ns", "faults.held", "faults.causes", "faults.refused", "faults.refusing", "faults.asked_ns", "homing.leg",
        "profidrive.telegram_frames", "interpolation.frames_taken", "interpolation.frames_told", "ethernetip.tasks",
        "ethernetip.targets_seen", "ethernetip.starts_seen", "ethernetip.enables_seen", "ethernetip.map_seen",
        "ethernetip.load_value", "ethernetip.load_number", "ethernetip.load_kind", "ethernetip.load_write",
        "ethernetip.task_value",
    }
)  # fmt: skip
#: Without a controller they are 0, and so is what waited for an answer.
_CLEARED = (
    "profidrive.image_valid", "profidrive.telegram_ns", "ethernetip.image_valid", "ethernetip.by_attribute",
    "ethernetip.loading", "ethernetip.posted", "ethernetip.move",
    "commands.task", "commands.home", "commands.disable", "commands.stop", "commands.resume", "commands.service",
)  # fmt: skip
_WRITTEN = {key: field for key, field in AXIS.fields.items() if field.writer in {"firmware", "engine"}}
#: What is saved of an axis, by key.
_FIELDS: dict[str, Field] = {
    key: field
    for key, field in _WRITTEN.items()
    if key not in _OF_RUN
    and key not in _CLEARED
    and not key.startswith(("life.", "commands."))
    and (field.writer == "firmware" or key.startswith("outside."))
}
#: Bounds of fields that are places in tables of compiled code.
_LIMITS: dict[str, tuple[int, int]] = {
    "drive.state": (0, 5),
    "drive.stop": (0, 3),
    "positioning.state": (0, positioning.STATES - 1),
    "positioning.error": (0, 2),
    "positioning.task": (TASK_MDI, MOTION_TASKS - 1),
    "asked.number": (TASK_MDI, MOTION_TASKS - 1),
    "profile.tap_next": (0, JERK_TAPS - 1),
    "service.leg": (0, 2),
    "sensor.state": (0, sensor_interface.STATES - 1),
    "sensor_2.state": (0, sensor_interface.STATES - 1),
    "sensor.read": (0, 4),
    "sensor_2.read": (0, 4),
    "jog.bits": (0, 3),
    "jog.first": (0, 3),
    "jog.sequence": (0, jog.STATES - 1),
    "orders.jog": (0, 3),
}
#: Largest number of a field of floating point, and longest time, ns.
_LARGEST = 1e15
_LONGEST_NS = 10**18
#: What a state of this version has; another one is not read.
LAYOUT = hashlib.sha256(repr([(key, one.kind, one.shape) for key, one in _FIELDS.items()]).encode()).hexdigest()[:16]


def _places() -> Any:
    """Which octets of a record a restore writes."""
    mask = np.zeros(AXIS.dtype.itemsize, bool)
    for key in (*_FIELDS, *_CLEARED):
        begin, kind = AXIS.place(key)
        mask[begin : begin + kind.itemsize] = True
    return mask


_PLACES = _places()


def _bounds(key: str, field: Field) -> tuple[int, int]:
    if key in _LIMITS:
        return _LIMITS[key]
    info = np.iinfo(field.kind)
    return int(info.min), int(info.max)


def fields_of(rows: Any) -> list[dict[str, Any]]:
    """The fields of copied records, axis by axis."""
    found: list[dict[str, Any]] = [{} for _ in rows]
    last = rows["last_ns"].tolist()
    for key, field in _FIELDS.items():
        for number, value in enumerate(AXIS.read(rows, key).tolist()):
            found[number][key] = (
                [_plain(key, field, one, last[number]) for one in value]
                if field.shape
                else _plain(key, field, value, last[number])
            )
    return found


def _plain(key: str, field: Field, value: Any, last_ns: int) -> Any:
    if field.unit == "ns":
        return last_ns - value if value else None
    if field.kind.startswith("f"):
        if value == inf and field.default == inf:
            return "inf"
        return 0.0 if isnan(value) else min(max(value, -_LARGEST), _LARGEST)
    low, high = _bounds(key, field)
    return min(max(value, low), high)


def check_fields(fields: Any, axis: str) -> dict[str, Any]:
    """What :func:`fields_of` gave of an axis of this name; raises :class:`RefusedStateError`."""
    mapped(fields, f"`fields` of {axis}", _FIELDS.keys())
    for key, field in _FIELDS.items():
        what = f"{key} of {axis}"
        for value in listed(fields[key], what, field.shape[0]) if field.shape else [fields[key]]:
            if not _fits(key, field, value):
                raise RefusedStateError(f"{what} cannot be {shown(value)}")
    return dict(fields)


def _fits(key: str, field: Field, value: Any) -> bool:
    if field.unit == "ns":
        return value is None or (type(value) is int and abs(value) <= _LONGEST_NS)
    if field.kind.startswith("f"):
        if value == "inf":
            return field.default == inf
        return type(value) in {int, float} and abs(value) <= _LARGEST and isfinite(value)
    low, high = _bounds(key, field)
    return type(value) is int and low <= value <= high


def octets_of(row: Any, fields: Mapping[str, Any]) -> Any:
    """A record with these fields for the axis with the record ``row``, a table of one row."""
    made = AXIS.copies(row)
    last = int(row[0]["last_ns"])
    for key, field in _FIELDS.items():
        value = fields[key]
        AXIS.write(
            made, key, [_number(field, one, last) for one in value] if field.shape else _number(field, value, last)
        )
    for key in _CLEARED:
        AXIS.write(made, key, 0)
    return made.view(np.uint8)[_PLACES]


def _number(field: Field, value: Any, last_ns: int) -> Any:
    if field.unit == "ns":
        # 0 would be none
        return 0 if value is None else (last_ns - value) or 1
    return inf if value == "inf" else value


def put_octets(columns: Columns, index: int, octets: Any) -> None:
    """Write them, between two ticks; commands that wait are dropped, but for causes of faults that are held."""
    columns.axis[index : index + 1].view(np.uint8)[_PLACES] = octets
    axis, image = columns.axis[index], columns.image[index]
    axis.profidrive.telegram_frames = image.frames
    own = axis.ethernetip
    own.targets_seen, own.starts_seen = own.settings.targets_set, own.settings.starts
    own.enables_seen = own.settings.enables
    commands, ring = axis.commands, axis.commands.settings.ring
    tail, head = int(commands.tail), int(commands.settings.head)
    waiting = [int(ring[(tail + number) % COMMANDS]) for number in range((head - tail) & 0xFFFFFFFF)]
    held = [command for command in waiting if command & 0xFF in {CMD_HOLD_FAULT, CMD_RELEASE_FAULT}]
    for number, command in enumerate(held, head - len(held)):
        ring[number % COMMANDS] = command
    commands.tail = (head - len(held)) & 0xFFFFFFFF
    # the reaction to a fault is measured from where it began
    columns.observed[index].fault_ns = axis.faults.since_ns if axis.faults.code[0] else 0
