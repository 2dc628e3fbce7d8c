"""Values that a user gives for parameters, converted to raw numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.drives.parameters.factor_group import float_bits
from pnfarm.drives.parameters.parameter import Form

if TYPE_CHECKING:
    from pnfarm.drives.parameters.parameter import Parameter

__all__ = ["raw_number"]


def raw_number(parameter: Parameter, value: float | str | bool) -> int | None:
    """The raw number for a number of the farm file, None if it does not fit.

    Whole numbers are raw; a number with a decimal point is the value of a float parameter.
    """
    if isinstance(value, int):
        return int(value)
    if isinstance(value, float) and parameter.form is Form.FLOAT:
        return float_bits(value)
    return None
