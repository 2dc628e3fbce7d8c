"""Values that a user gives for parameters, as the drive takes them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.drives.factor_group import float_bits
from pnfarm.drives.parameter import Form

if TYPE_CHECKING:
    from pnfarm.drives.parameter import Parameter

__all__ = ["raw_number"]


def raw_number(parameter: Parameter, value: float | str | bool) -> int | None:
    """What a number of the farm file is to the drive, None for one that it cannot hold.

    Whole numbers are raw; a number with a point is that of a float parameter itself.
    """
    if isinstance(value, int):
        return int(value)
    if isinstance(value, float) and parameter.form is Form.FLOAT:
        return float_bits(value)
    return None
