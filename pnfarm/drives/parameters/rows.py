"""A model's ``parameters.csv``, its product's and its bus's: one row per parameter, with their checks."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from pnfarm.drives.description.files import integer, rows
from pnfarm.drives.description.parts import COMMANDS
from pnfarm.drives.parameters.computed import COMPUTED
from pnfarm.drives.parameters.numbers import ParameterNumbers
from pnfarm.drives.parameters.parameter import FLOAT_HIGHEST, Backing, Form, Parameter, ParameterType
from pnfarm.errors import ConfigError
from pnfarm.firmware.axis import AXIS
from pnfarm.table.signals import ACTUAL_SLOTS, SETPOINT_SLOTS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from pnfarm.drives.description.files import ModelFiles
    from pnfarm.drives.description.numbering import Numbering

__all__ = ["PER_PITCH", "axis_parameters", "parameter_names", "read_only_names", "read_parameters"]

_TYPES = {
    "Command": ParameterType.COMMAND,
    "Byte": ParameterType.BYTE,
    "Word": ParameterType.WORD,
    "DWord": ParameterType.DWORD,
    "QWord": ParameterType.QWORD,
    "Float": ParameterType.DWORD,
    "String": ParameterType.BYTE,
}
_FORMS = {"Float": Form.FLOAT, "String": Form.TEXT}
#: Scales that are not a plain factor: 2 to the minus n; times the axis's acceleration step; positions by the section
#: ``position_units``.
#: ``jog/n`` and ``reference/n`` are ramp times in ms, to or from the first jogging velocity, or from the
#: velocity reference value; ``rated-torque`` is a percentage of it.
#: ``torque-constant`` and ``-torque-constant`` are thousandths of an ampere times the motor's torque constant; the
#: default of such a parameter means the limit of motor and drive.
#: ``velocity`` is times the unit of NSOLL_A; with ``float32`` the raw number is the bits of a float.
#: The factor before ``*`` gives the value in the parameter's unit; the one after it converts that to the axis's field.
#: A number followed by ``/n`` is divided by that value: a rate given for a time.
_NAMED_SCALES = {
    "-torque-constant", "2^-n", "acceleration", "float32", "jog/n", "position", "rated-torque", "reference/n",
    "torque-constant", "velocity",
}  # fmt: skip
#: After a factor: divided by the pitch of the linear motor in use, so that the factor is given in mm.
PER_PITCH = "/pitch"
FLOAT = "float32"
TIMES = "*"
PER_VALUE = "/n"
#: First column: the product's name of the parameter, to which the bus gives a number, or the number on the bus.
_ID, _PNU = "id", "pnu"
#: Second one; a product may leave it out where the name is the id.
_NAME = "name"
_NAMES = {_ID: ((), (_NAME,)), _PNU: ((_NAME,),)}
_COLUMNS = (
    "type", "signed", "elements", "access", "min", "max", "default", "unit", "scale", "backed_by", "nv",
    "source", "values_source", "note",
)  # fmt: skip
#: An optional column after these: ``power-on`` for what takes effect with the next power cycle.
_EFFECTIVE = "effective"
#: An optional column after that one: the motor that a parameter is for.
_MOTOR = "motor"
_MORE = (_EFFECTIVE, _MOTOR)
#: Columns: ``pnu``, ``id``, and any of ``parameters.csv`` whose cell, unless empty, applies on this bus.
NUMBERS_FILE = "numbers.csv"
#: A row and its place.
Row = tuple[str, dict[str, str]]
_FIELD = re.compile(r"([\w.]+)(?:\[(\d+)\])?")


def _choices(scale: str, maximum: int, where: str) -> tuple[float, ...]:
    """The values of a scale such as ``1|0|1``, one for each raw number."""
    if "|" not in scale:
        return ()
    try:
        choices = tuple(float(text) for text in scale.split("|"))
    except ValueError:
        raise ConfigError(f"{where}, scale: {scale!r} must have numbers between its bars") from None
    if len(choices) != maximum + 1:
        raise ConfigError(f"{where}, scale: {scale!r} must have a value for each of 0..{maximum}")
    return choices


def _fraction(text: str) -> float:
    numerator, _, denominator = text.partition("/")
    return float(numerator) / float(denominator or 1)


def _factors(scale: str, where: str) -> tuple[float, float]:
    """The factors from the raw number to the value in the unit, and to the axis's field."""
    if scale in _NAMED_SCALES or not scale or "|" in scale:
        return 1.0, 1.0
    first, times, second = scale.removesuffix(PER_PITCH).partition(TIMES)
    try:
        if first == FLOAT:
            return 1.0, _fraction(second)
        if not scale.endswith(PER_VALUE):
            factor = _fraction(first)
            return factor, factor * _fraction(second if times else "1")
        factor = _fraction(first) if times else 1.0
        return factor, _fraction((second if times else first).removesuffix(PER_VALUE)) / factor
    except (ValueError, ZeroDivisionError):
        raise ConfigError(
            f"{where}, scale: {scale!r} is not a number, a fraction, two of them with * between or one of "
            f"{', '.join(sorted(_NAMED_SCALES))}"
        ) from None


def _backing(
    text: str, where: str, numbers: ParameterNumbers, *, writable: bool, elements: int
) -> tuple[Backing, str, int]:
    """Kind, argument and index of what backs a row, such as ``field:jog.velocity[1]``; an array fills a whole field."""
    kind_name, _, argument = text.partition(":")
    try:
        kind = Backing[kind_name.upper()]
    except KeyError:
        raise ConfigError(
            f"{where}, backed_by: {kind_name!r} is not one of {', '.join(b.name.lower() for b in Backing)}"
        ) from None
    if kind is Backing.ALIAS:
        return kind, "", numbers.of(argument, f"{where}, backed_by")
    if kind is Backing.FIELD:
        match = _FIELD.fullmatch(argument)
        field = AXIS.fields.get(match[1]) if match else None
        if match is None or field is None:
            raise ConfigError(f"{where}, backed_by: the axis has no field {argument!r}")
        index = int(match[2]) if match[2] else -1
        whole = bool(elements) and index < 0 and field.shape == (elements,)
        if not whole and (elements or (index >= 0) != bool(field.shape) or (field.shape and index >= field.shape[0])):
            raise ConfigError(f"{where}, backed_by: {argument!r} does not fit the field's shape {field.shape}")
        if writable and field.writer != "parameter":
            raise ConfigError(f"{where}, backed_by: {argument!r} is written by {field.writer}, not by a parameter")
        return kind, match[1], index
    if kind is Backing.SIGNAL:
        direction, _, name = argument.partition(".")
        slots = {"received": SETPOINT_SLOTS, "sent": ACTUAL_SLOTS}.get(direction, {})
        if name not in slots:
            raise ConfigError(
                f"{where}, backed_by: {argument!r} is neither received.<set point> nor sent.<actual value>"
            )
        return kind, direction, slots[name]
    index = 0
    if kind is Backing.COMPUTED:
        name, _, number = argument.rpartition("-")
        if number.isdigit():
            argument, index = name, int(number)
    known = {Backing.COMPUTED: set(COMPUTED), Backing.COMMAND: COMMANDS}.get(kind, {""})
    if argument not in known:
        raise ConfigError(
            f"{where}, backed_by: {text!r} is unknown; allowed after the colon: {', '.join(sorted(known))}"
        )
    return kind, argument, index


def _parameter(pnu: int, row: Mapping[str, str], where: str, numbers: ParameterNumbers) -> Parameter:
    for field in ("signed", "nv"):
        if row[field] not in {"0", "1"}:
            raise ConfigError(f"{where}, {field}: {row[field]!r} is neither 0 nor 1")
    if row["type"] not in _TYPES:
        raise ConfigError(f"{where}, type: {row['type']!r} is not one of {', '.join(_TYPES)}")
    if row["access"] not in {"r", "rw", "w"}:
        raise ConfigError(f"{where}, access: {row['access']!r} is not one of r, rw, w")
    for field in ("name", "source", "values_source"):
        if not row[field]:
            raise ConfigError(f"{where}, {field}: empty")
    if row["values_source"] == "assumed" and not row["note"] and row["backed_by"] == "stored":
        raise ConfigError(f"{where}, note: an assumed value needs its reason")
    kind = _TYPES[row["type"]]
    signed = row["signed"] == "1"
    if row["type"] in _FORMS and (signed or (row["type"] == "String") > bool(row["elements"])):
        raise ConfigError(f"{where}, type: {row['type']} has no sign, and a String as many elements as characters")
    bits = 8 * kind.octets
    lowest, highest = (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) if signed else (0, (1 << bits) - 1)
    if row["type"] == "Float":
        highest = FLOAT_HIGHEST
    minimum = integer(row["min"], where, "min", lowest)
    *others, last = row["max"].split("|")
    maximum = integer(last, where, "max", highest)
    only = frozenset(integer(text, where, "max") for text in (*others, last)) if others else frozenset()
    elements = integer(row["elements"], where, "elements", 0)
    usual = min(max(0, minimum), maximum)
    defaults = tuple(integer(text, where, "default") for text in row["default"].split()) or (usual,)
    default = defaults[0]
    if len(defaults) > max(elements, 1) or not all(minimum <= value <= maximum for value in defaults[1:]):
        raise ConfigError(
            f"{where}, default: {row['default']!r} does not fit {minimum}..{maximum}, {elements} elements"
        )
    if only and not (min(only) >= minimum and max(only) == maximum and default in only):
        raise ConfigError(f"{where}, max: {row['max']!r} must ascend from {minimum} on and have the default {default}")
    if not lowest <= minimum <= default <= maximum <= highest:
        raise ConfigError(
            f"{where}, min, default, max: {minimum}, {default}, {maximum} must ascend within {lowest}..{highest}"
        )
    if not 1 <= pnu <= 0xFFFF:
        raise ConfigError(f"{where}, pnu: {pnu} is not within 1..65535")
    if row.get(_EFFECTIVE, "") not in {"", "power-on"}:
        raise ConfigError(f"{where}, effective: {row[_EFFECTIVE]!r} is neither empty nor power-on")
    if row.get(_MOTOR, "") not in {"", "rotary", "linear"}:
        raise ConfigError(f"{where}, motor: {row[_MOTOR]!r} is neither empty nor rotary nor linear")
    if row["scale"].endswith(PER_PITCH) and row.get(_MOTOR) != "linear":
        raise ConfigError(f"{where}, scale: {row['scale']!r} needs the motor linear")
    standardisation, factor = _factors(row["scale"], where)
    writable = "w" in row["access"]
    backing, argument, index = _backing(row["backed_by"], where, numbers, writable=writable, elements=elements)
    return Parameter(
        pnu=pnu,
        name=row["name"],
        type=kind,
        signed=signed,
        elements=elements,
        readable="r" in row["access"],
        writable=writable,
        minimum=minimum,
        maximum=maximum,
        default=default,
        unit=row["unit"],
        scale=row["scale"],
        factor=factor,
        standardisation=standardisation,
        backing=backing,
        argument=argument,
        index=index,
        nonvolatile=row["nv"] == "1",
        source=row["source"],
        values_source=row["values_source"],
        note=row["note"],
        after_power_on=row.get(_EFFECTIVE, "") == "power-on",
        defaults=(
            defaults + (usual,) * (elements - len(defaults))
            if elements and (row["default"] or backing in {Backing.STORED, Backing.FIELD})
            else ()
        ),
        choices=_choices(row["scale"], maximum, where),
        only=only,
        motor=row.get(_MOTOR, ""),
        form=_FORMS.get(row["type"], Form.INTEGER),
    )


def read_parameters(files: ModelFiles, numbering: Numbering) -> tuple[dict[int, Parameter], ParameterNumbers]:
    """Every parameter by its number, rising, and the numbers of those that the product's files name."""
    own: dict[str, Row] = {}
    found: dict[int, Row] = {}
    numbers: dict[str, int] = {}
    for path in files.wanted("parameters.csv"):
        _add_rows(path, own, found, by_name=bool(numbering.prefix or files.named(NUMBERS_FILE)))
    for number, name, (where, row) in _numbered_rows(files, own, numbering):
        if number in found:
            raise ConfigError(f"{where}, pnu: {number} is given twice")
        found[number] = where, row
        numbers.setdefault(name, number)
    known = ParameterNumbers(numbers)
    parameters = {number: _parameter(number, row, where, known) for number, (where, row) in sorted(found.items())}
    for parameter in parameters.values():
        if parameter.backing is Backing.ALIAS:
            target = parameters.get(parameter.index)
            if target is None or target.backing is Backing.ALIAS:
                where = found[parameter.pnu][0]
                raise ConfigError(f"{where}, backed_by: alias of {parameter.index}, which is not a parameter itself")
    return parameters, known


def _add_rows(
    path: Path,
    own: dict[str, Row],
    found: dict[int, Row],
    *,
    by_name: bool,
) -> None:
    """The rows of one file: those with an ``id`` await their number, those with a ``pnu`` have it.

    Without ``by_name`` nothing gives numbers to the former, and they are not read.
    """
    here: set[str | int] = set()
    for where, row in rows(path):
        first, *others = row
        if not here and (
            first not in {_ID, _PNU}
            or tuple(others)
            not in {(*names, *_COLUMNS, *more) for names in _NAMES[first] for more in ((), _MORE[:1], _MORE)}
        ):
            raise ConfigError(f"{path}, line 1: the columns must be {_ID} or {_PNU}, {_NAME}, {', '.join(_COLUMNS)}")
        if first == _ID and not by_name:
            return
        key = row[_ID] if first == _ID else integer(row[_PNU], where, _PNU)
        if key in here:
            raise ConfigError(f"{where}, {first}: {key} is given twice")
        here.add(key)
        if isinstance(key, str):
            own[key] = where, {_NAME: key} | row
        else:
            found[key] = where, row


def _numbered_rows(files: ModelFiles, own: Mapping[str, Row], numbering: Numbering) -> Iterator[tuple[int, str, Row]]:
    """Each number with the parameter's name and its row in the product's ``parameters.csv``."""
    lists = files.named(NUMBERS_FILE)
    if not lists and numbering.prefix:
        for name, (where, row) in own.items():
            number = numbering.number(name)
            if number is None:
                raise ConfigError(f"{where}, id: {name!r} is not written as the section numbering says")
            yield number, name, (where, row)
    for path in lists:
        for where, given in rows(path):
            number, name = integer(given.pop("pnu", ""), where, "pnu"), given.pop("id", "")
            if name not in own:
                raise ConfigError(f"{where}, id: no parameters.csv has {name!r}")
            place, row = own[name]
            changed = {column: cell for column, cell in given.items() if cell}
            if unknown := changed.keys() - row.keys():
                raise ConfigError(f"{where}, {min(unknown)}: not a column of parameters.csv")
            yield number, name, (f"{place}, changed by {where}", row | changed) if changed else (place, row)


def parameter_names(
    parameters: Mapping[int, Parameter],
    extra: Mapping[str, Any],
    numbering: Numbering,
    place: Callable[[str, str], str],
) -> dict[str, int]:
    """Upper-case names to PNU: the first row of a name, then names without ``_32``, then names without a row.

    The numbers as the maker writes them are names too, with and without zeros in front (P-0925, P-925).
    """
    names: dict[str, int] = {}
    for parameter in parameters.values():
        names.setdefault(parameter.name.upper(), parameter.pnu)
    for name, pnu in list(names.items()):
        if name.endswith("_32"):
            names.setdefault(name[:-3], pnu)
    for name, entry in extra.items():
        pnu = entry.get("pnu")
        if pnu not in parameters:
            raise ConfigError(f"{place('parameter_names', name)}, pnu: there is no parameter {pnu}")
        names.setdefault(name.upper(), pnu)
    if numbering.prefix:
        for pnu in parameters:
            for name in numbering.names(pnu):
                names.setdefault(name.upper(), pnu)
    return names


def read_only_names(extra: Mapping[str, Any]) -> frozenset[str]:
    """Upper-case names under which a parameter can only be read, though it may be written by its number."""
    return frozenset(name.upper() for name, entry in extra.items() if entry.get("read_only", False))


def axis_parameters(parameters: Mapping[int, Parameter], *, linear: bool = False) -> tuple[Parameter, ...]:
    """The parameters that write the axis record with this motor; one whose scale another sets comes after it."""
    found = [p for p in parameters.values() if p.backing is Backing.FIELD and p.writable and p.is_for(linear=linear)]
    return tuple(sorted(found, key=lambda p: p.scale in {"acceleration", "jog/n", "reference/n"}))
