"""What a drive on PROFIBUS keeps in its non-volatile memory."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.station.kept_values import FAULTS, Shape, check_shapes, drive_shape

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["check_kept"]

_SHAPES: Mapping[str, Shape] = {
    "address_locked": (lambda value: isinstance(value, bool), "true or false"),
    "faults": FAULTS,
    "drive": drive_shape(octets=4),
}


def check_kept(values: Mapping[str, Any]) -> None:
    """Raises :class:`KeptValueError` that names the first key with a wrong value, and that value."""
    check_shapes(values, _SHAPES)
