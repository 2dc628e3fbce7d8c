"""Section Params of an electronic data sheet: each instance of the Parameter object (CIP volume 1, 7-3.6.4)."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Final

from pnfarm.buses.ethernetip.device.objects.values import POSITION_UNITS, PROFILE_UNITS, wire_number
from pnfarm.drives.profiles.cip.part import Scaling
from pnfarm.protocols.enip.eds.text import EdsEntry, EdsString
from pnfarm.protocols.enip.wire.epath import emit_epath, logical_path

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.drives.description.model import Model
    from pnfarm.drives.parameters.parameter import Parameter
    from pnfarm.drives.profiles.cip.part import CipInstance
    from pnfarm.protocols.enip.eds.text import EdsField

__all__ = ["parameter_entries"]

_PARAMETER, _VALUE = 0x0F, 1
# Bits of the descriptor: the value is scaled; it is only read.
_SCALED, _READ_ONLY = 0x0004, 0x0010
_HIGHEST_FACTOR: Final = 0xFFFF


def parameter_entries(model: Model) -> Iterator[EdsEntry]:
    """One for each instance, under its number."""
    position, profile = (model.resolve(name)[0].default for name in (POSITION_UNITS, PROFILE_UNITS))
    for row in sorted(model.cip.instances.values(), key=lambda row: row.number):
        parameter = model.parameters[row.number]
        if row.scaling is Scaling.POSITION:
            fields = _fields(row, parameter, position, round(parameter.default * _counts(model)))
        else:
            fields = _fields(row, parameter, profile, parameter.default)
        yield EdsEntry(f"Param{row.number}", tuple(fields))


def _counts(model: Model) -> float:
    """Feedback counts to one unit in which the model has the defaults of positions."""
    units = model.position_units
    return units.revolution[0] / units.default if units is not None else 1.0


def _fields(row: CipInstance, parameter: Parameter, units: int, default: int) -> list[EdsField]:
    path = emit_epath(logical_path(_PARAMETER, row.number, _VALUE))
    factor = _factor(row, parameter)
    descriptor = (_READ_ONLY if not parameter.writable else 0) | (_SCALED if factor is not None else 0)
    raws = (parameter.minimum, parameter.maximum, default)
    values = [str(wire_number(row, parameter, raw, units)) for raw in raws]
    scaling: list[EdsField] = ["", "", "", ""]
    if factor is not None:
        scaling = [str(factor.numerator), str(factor.denominator), "1", "0"]
    return [
        "0",
        str(len(path)),
        EdsString(path.hex(" ").upper()),
        f"0x{descriptor:04X}",
        f"0x{row.type_code:02X}",
        str(row.size),
        EdsString(row.name),
        EdsString(_unit(row, parameter)),
        EdsString(_help(row)),
        *values,
        *scaling,
        "",
        "",
        "",
        "",
        str(_decimals(factor)),
    ]


def _unit(row: CipInstance, parameter: Parameter) -> str:
    """Positions, speeds and ramps are in units that the user sets."""
    if row.scaling is Scaling.POSITION:
        return POSITION_UNITS
    if row.scaling.profile:
        return PROFILE_UNITS
    return parameter.unit.encode("ascii", "replace").decode()


def _factor(row: CipInstance, parameter: Parameter) -> Fraction | None:
    """What a number on the wire is worth in its unit; None for 1, and for what a file cannot say."""
    if row.scaling not in {Scaling.INTEGER, Scaling.FLOAT}:
        return None
    factor = Fraction(parameter.standardisation).limit_denominator(_HIGHEST_FACTOR)
    if factor in {0, 1} or factor.numerator > _HIGHEST_FACTOR or float(factor) != parameter.standardisation:
        return None
    return factor


def _decimals(factor: Fraction | None) -> int:
    """Digits after the point: those of a decimal fraction."""
    digits = 0
    while factor is not None and factor.denominator != 1 and digits < 9:
        factor *= 10
        digits += 1
    return digits


def _help(row: CipInstance) -> str:
    texts = []
    if row.scaling is Scaling.COMMAND:
        texts.append("command: write 1")
    if row.source == "assumed":
        texts.append("assumed")
    return ", ".join(texts)
