"""What a station on PROFIBUS keeps in its non-volatile memory."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.profibus.config.drive import HIGHEST_ADDRESS
from pnfarm.station.kept_values import FAULTS, Shape, check_shapes, drive_shape, is_number

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["DEVICE", "DRIVE", "check_kept"]

DRIVE: Mapping[str, Shape] = {"faults": FAULTS, "drive": drive_shape(octets=4)}
#: A device's address, once Set_Slave_Add gave it one.
DEVICE: Mapping[str, Shape] = {
    "address": (lambda value: is_number(value, HIGHEST_ADDRESS), f"a station address from 0 to {HIGHEST_ADDRESS}")
}
_ANY: Mapping[str, Shape] = {"address_locked": (lambda value: isinstance(value, bool), "true or false")}


def check_kept(values: Mapping[str, Any], own: Mapping[str, Shape]) -> None:
    """Raises :class:`KeptValueError` that names the first key with a wrong value, and that value."""
    check_shapes(values, {**_ANY, **own})
