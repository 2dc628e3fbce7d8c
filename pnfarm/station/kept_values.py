"""The format of the values in a drive's non-volatile memory that are the same on any bus, and how all are checked.

A memory in another format was written by another program, or by hand.  It is refused as a whole and left unchanged: a
drive that booted with half of it would overwrite the other half with its next save.  Unknown keys are kept unchanged.
"""

from __future__ import annotations

from collections.abc import Callable
from ipaddress import AddressValueError, IPv4Address
from typing import TYPE_CHECKING, Any, TypeAlias

from pnfarm.station.device import KeptValueError
from pnfarm.table.axis_codes import FAULT_SITUATIONS, FAULT_SLOTS
from pnfarm.vocabulary.quoting import shown

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["FAULTS", "Shape", "check_shapes", "drive_shape", "is_address", "is_number"]

_U32 = 0xFFFF_FFFF
#: Whether a value has the right format, and a description of that.
Shape: TypeAlias = tuple[Callable[[Any], bool], str]


def is_number(value: Any, high: int, low: int = 0) -> bool:
    """A whole number in these limits."""
    return type(value) is int and low <= value <= high


def is_address(value: Any) -> bool:
    """An IPv4 address as text."""
    try:
        return isinstance(value, str) and bool(IPv4Address(value))
    except AddressValueError:
        return False


def _is_raw(value: Any, octets: int) -> bool:
    """One raw number, or those of an array's elements."""
    numbers = value if isinstance(value, list) else [value]
    bits = 8 * octets
    return all(is_number(number, (1 << bits) - 1, -(1 << (bits - 1))) for number in numbers)


def drive_shape(octets: int) -> Shape:
    """``drive``: parameters and motion tasks; ``octets`` of the longest raw number."""

    def numbers(value: Any) -> bool:
        return isinstance(value, dict) and all(isinstance(k, str) and _is_raw(raw, octets) for k, raw in value.items())

    def fits(value: Any) -> bool:
        if not isinstance(value, dict) or not numbers(value.get("parameters")):
            return False
        tasks = value.get("motion_tasks", {})
        return (
            isinstance(value.get("model", ""), str)
            and isinstance(tasks, dict)
            and all(
                isinstance(number, str) and number.isascii() and number.isdigit() and numbers(task)
                for number, task in tasks.items()
            )
        )

    return fits, "`parameters`, numbers by PNU, and optionally `motion_tasks`"


#: ``faults``: the history.
FAULTS: Shape = (
    lambda value: (
        isinstance(value, list)
        and len(value) <= FAULT_SITUATIONS * FAULT_SLOTS
        and all(is_number(number, _U32) for number in value)
    ),
    f"up to {FAULT_SITUATIONS * FAULT_SLOTS} fault numbers",
)


def check_shapes(values: Mapping[str, Any], shapes: Mapping[str, Shape]) -> None:
    """Raises :class:`KeptValueError` that names the first key with a wrong value, and that value."""
    for key, value in values.items():
        shape = shapes.get(key)
        if shape is not None and not shape[0](value):
            raise KeptValueError(f"{key!r} is {shown(value)}, not {shape[1]}")
