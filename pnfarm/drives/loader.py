"""From a model's folder to a :class:`~pnfarm.drives.model.Model`.

The folder holds ``model.toml``, ``parameters.csv``, ``telegrams.toml`` and ``faults.csv``.  Every mistake in them is a
:class:`~pnfarm.errors.ConfigError` that names file, row and field.
"""

from __future__ import annotations

import csv
import re
import tomllib
from dataclasses import replace
from datetime import datetime
from typing import TYPE_CHECKING, Any

from pnfarm.drives.computed import COMPUTED
from pnfarm.drives.model import (
    COMMANDS,
    DIAGNOSIS_CODINGS,
    REACTIONS,
    CommunicationLoss,
    DescriptionFile,
    DiagnosisCoding,
    Fact,
    Fault,
    Identity,
    Limits,
    Model,
    ParameterAccess,
    SignOfLife,
    fault_label,
    fault_number,
)
from pnfarm.drives.parameter import Behaviour, Parameter, ParameterType
from pnfarm.drives.telegram import MappingError, Module, Signal, Submodule, Telegram, signal_codes
from pnfarm.drives.word_bits import WordBits, read_bits
from pnfarm.errors import ConfigError
from pnfarm.table.axis import AXIS, FAULT_WORDS
from pnfarm.table.signals import ACTUAL_SLOTS, SETPOINT_SLOTS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

__all__ = ["load_model", "read_toml"]

_TYPES = {
    "Command": ParameterType.COMMAND,
    "Byte": ParameterType.BYTE,
    "Word": ParameterType.WORD,
    "DWord": ParameterType.DWORD,
}
#: Scales that are no plain factor: 2 to the minus n; times the axis's acceleration step; positions by PN.POSSCALE and
#: UNIT.PROTARY.
#: A number followed by ``/n`` is divided by the raw number: a ramp given as a time.
_NAMED_SCALES = {"2^-n", "acceleration", "position"}
_COLUMNS = (
    "pnu", "name", "type", "signed", "elements", "access", "min", "max", "default", "unit", "scale", "behaviour", "nv",
    "source", "values_source", "note",
)  # fmt: skip
#: A column that a file may have behind these: ``power-on`` for what takes effect with the next power cycle.
_EFFECTIVE = "effective"
_FIELD = re.compile(r"(\w+)(?:\[(\d+)\])?")


def read_toml(path: Path) -> dict[str, Any]:
    """A TOML file; :class:`ConfigError` with its name if it cannot be read."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as exc:
        raise ConfigError(f"{path}: {exc}") from exc


def _rows(path: Path) -> Iterator[tuple[str, dict[str, str]]]:
    """The rows of a CSV file with a place for error messages."""
    try:
        with path.open(encoding="utf-8", newline="") as file:
            for row in (reader := csv.DictReader(file)):
                where = f"{path}, line {reader.line_num}"
                if None in row or None in row.values():
                    raise ConfigError(f"{where}: {len(reader.fieldnames or ())} columns are wanted")
                yield where, row
    except OSError as exc:
        raise ConfigError(f"{path}: {exc}") from exc


def _integer(text: str, where: str, field: str, default: int | None = None) -> int:
    if not text and default is not None:
        return default
    try:
        return int(text, 0)
    except ValueError:
        raise ConfigError(f"{where}, {field}: {text!r} is not a number") from None


def _get(table: Mapping[str, Any], key: str, where: str) -> Any:
    try:
        return table[key]
    except KeyError:
        raise ConfigError(f"{where}, {key}: missing") from None


# parameters.csv


def _choices(scale: str, maximum: int, where: str) -> tuple[float, ...]:
    """The values of a scale such as ``1|0|1``, one for each raw number."""
    if "|" not in scale:
        return ()
    try:
        choices = tuple(float(text) for text in scale.split("|"))
    except ValueError:
        raise ConfigError(f"{where}, scale: {scale!r} has something that is no number between its bars") from None
    if len(choices) != maximum + 1:
        raise ConfigError(f"{where}, scale: {scale!r} must have a value for each of 0..{maximum}")
    return choices


def _factor(scale: str, where: str) -> float:
    if scale in _NAMED_SCALES or not scale or "|" in scale:
        return 1.0
    numerator, _, denominator = scale.partition("/")
    try:
        factor = float(numerator) / (1.0 if denominator == "n" else float(denominator or 1))
    except (ValueError, ZeroDivisionError):
        raise ConfigError(
            f"{where}, scale: {scale!r} is not a number, a fraction or one of {', '.join(sorted(_NAMED_SCALES))}"
        ) from None
    return factor


def _behaviour(text: str, where: str, *, writable: bool) -> tuple[Behaviour, str, int]:
    """Kind, argument and index of a behaviour such as ``field:jog_velocity[1]``."""
    kind_name, _, argument = text.partition(":")
    try:
        kind = Behaviour[kind_name.upper()]
    except KeyError:
        raise ConfigError(
            f"{where}, behaviour: {kind_name!r} is none of {', '.join(b.name.lower() for b in Behaviour)}"
        ) from None
    if kind is Behaviour.ALIAS:
        return kind, "", _integer(argument, where, "behaviour")
    if kind is Behaviour.FIELD:
        match = _FIELD.fullmatch(argument)
        field = AXIS.fields.get(match[1]) if match else None
        if match is None or field is None:
            raise ConfigError(f"{where}, behaviour: the axis has no field {argument!r}")
        index = int(match[2]) if match[2] else -1
        if (index >= 0) != bool(field.shape) or (field.shape and index >= field.shape[0]):
            raise ConfigError(f"{where}, behaviour: {argument!r} does not fit the field's shape {field.shape}")
        if writable and field.writer != "parameter":
            raise ConfigError(f"{where}, behaviour: {argument!r} is written by {field.writer}, not by a parameter")
        return kind, field.name, index
    if kind is Behaviour.SIGNAL:
        direction, _, name = argument.partition(".")
        slots = {"received": SETPOINT_SLOTS, "sent": ACTUAL_SLOTS}.get(direction, {})
        if name not in slots:
            raise ConfigError(
                f"{where}, behaviour: {argument!r} is neither received.<set point> nor sent.<actual value>"
            )
        return kind, direction, slots[name]
    index = 0
    if kind is Behaviour.COMPUTED:
        name, _, number = argument.rpartition("-")
        if number.isdigit():
            argument, index = name, int(number)
    known = {Behaviour.COMPUTED: set(COMPUTED), Behaviour.COMMAND: COMMANDS}.get(kind, {""})
    if argument not in known:
        raise ConfigError(
            f"{where}, behaviour: {text!r} is unknown; after the colon stands one of {', '.join(sorted(known))}"
        )
    return kind, argument, index


def _parameter(row: Mapping[str, str], where: str) -> Parameter:
    for field in ("signed", "nv"):
        if row[field] not in {"0", "1"}:
            raise ConfigError(f"{where}, {field}: {row[field]!r} is neither 0 nor 1")
    if row["type"] not in _TYPES:
        raise ConfigError(f"{where}, type: {row['type']!r} is none of {', '.join(_TYPES)}")
    if row["access"] not in {"r", "rw", "w"}:
        raise ConfigError(f"{where}, access: {row['access']!r} is none of r, rw, w")
    for field in ("name", "source", "values_source"):
        if not row[field]:
            raise ConfigError(f"{where}, {field}: empty")
    if row["values_source"] == "assumed" and not row["note"] and row["behaviour"] == "stored":
        raise ConfigError(f"{where}, note: an assumed value needs its reason")
    kind = _TYPES[row["type"]]
    signed = row["signed"] == "1"
    bits = 8 * kind.octets
    lowest, highest = (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) if signed else (0, (1 << bits) - 1)
    minimum = _integer(row["min"], where, "min", lowest)
    maximum = _integer(row["max"], where, "max", highest)
    elements = _integer(row["elements"], where, "elements", 0)
    usual = min(max(0, minimum), maximum)
    defaults = tuple(_integer(text, where, "default") for text in row["default"].split()) or (usual,)
    default = defaults[0]
    if len(defaults) > max(elements, 1) or not all(minimum <= value <= maximum for value in defaults[1:]):
        raise ConfigError(
            f"{where}, default: {row['default']!r} does not fit {minimum}..{maximum}, {elements} elements"
        )
    if not lowest <= minimum <= default <= maximum <= highest:
        raise ConfigError(
            f"{where}, min, default, max: {minimum}, {default}, {maximum} do not rise within {lowest}..{highest}"
        )
    pnu = _integer(row["pnu"], where, "pnu")
    if not 1 <= pnu <= 0xFFFF:
        raise ConfigError(f"{where}, pnu: {pnu} is not within 1..65535")
    if row.get(_EFFECTIVE, "") not in {"", "power-on"}:
        raise ConfigError(f"{where}, effective: {row[_EFFECTIVE]!r} is neither empty nor power-on")
    writable = "w" in row["access"]
    behaviour, argument, index = _behaviour(row["behaviour"], where, writable=writable)
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
        factor=_factor(row["scale"], where),
        behaviour=behaviour,
        argument=argument,
        index=index,
        nonvolatile=row["nv"] == "1",
        source=row["source"],
        values_source=row["values_source"],
        note=row["note"],
        after_power_on=row.get(_EFFECTIVE, "") == "power-on",
        defaults=defaults + (usual,) * (elements - len(defaults)) if behaviour is Behaviour.STORED and elements else (),
        choices=_choices(row["scale"], maximum, where),
    )


def _parameters(path: Path) -> dict[int, Parameter]:
    parameters: dict[int, Parameter] = {}
    for where, row in _rows(path):
        if not parameters and tuple(row) not in {_COLUMNS, (*_COLUMNS, _EFFECTIVE)}:
            raise ConfigError(f"{path}, line 1: the columns must be {', '.join(_COLUMNS)}")
        parameter = _parameter(row, where)
        if parameter.pnu in parameters:
            raise ConfigError(f"{where}, pnu: {parameter.pnu} stands twice")
        parameters[parameter.pnu] = parameter
    for parameter in parameters.values():
        if parameter.behaviour is Behaviour.ALIAS:
            target = parameters.get(parameter.index)
            if target is None or target.behaviour is Behaviour.ALIAS:
                raise ConfigError(
                    f"{path}, PNU {parameter.pnu}, behaviour: alias of {parameter.index}, no parameter of its own"
                )
    return dict(sorted(parameters.items()))


def _names(parameters: Mapping[int, Parameter], extra: Mapping[str, Any], prefix: str, path: Path) -> dict[str, int]:
    """Upper-case names to PNU: the first row of a name, then names without ``_32``, then names without a row.

    With a ``prefix`` the numbers behind it are names too, in four digits or without zeros in front (P-0925, P-925).
    """
    names: dict[str, int] = {}
    for parameter in parameters.values():
        names.setdefault(parameter.name.upper(), parameter.pnu)
    for name, pnu in list(names.items()):
        if name.endswith("_32"):
            names.setdefault(name[:-3], pnu)
    for name, entry in extra.items():
        pnu = _get(entry, "pnu", f"{path}, parameter_names.{name}")
        if pnu not in parameters:
            raise ConfigError(f"{path}, parameter_names.{name}: there is no parameter {pnu}")
        names.setdefault(name.upper(), pnu)
    if prefix:
        for pnu in parameters:
            names.setdefault(f"{prefix}{pnu:04}".upper(), pnu)
            names.setdefault(f"{prefix}{pnu}".upper(), pnu)
    return names


# telegrams.toml


def _signal(table: Mapping[str, Any], where: str) -> Signal:
    name, direction = _get(table, "name", where), _get(table, "direction", where)
    if direction not in {"setpoint", "actual"}:
        raise ConfigError(f"{where}, direction: {direction!r} is neither setpoint nor actual")
    setpoint = direction == "setpoint"
    if name not in (SETPOINT_SLOTS if setpoint else ACTUAL_SLOTS):
        raise ConfigError(f"{where}, name: the process image has no {direction} {name!r}")
    if _get(table, "bits", where) not in {16, 32}:
        raise ConfigError(f"{where}, bits: {table['bits']!r} is neither 16 nor 32")
    return Signal(
        number=_get(table, "number", where),
        name=name,
        bits=table["bits"],
        setpoint=setpoint,
        drive_signal=table.get("drive_signal", ""),
        source=_get(table, "source", where),
        note=table.get("note", ""),
    )


def _telegram(
    table: Mapping[str, Any], where: str, signals: Mapping[str, Signal], layout: Mapping[str, Any]
) -> Telegram:
    words: dict[str, tuple[Signal | None, ...]] = {}
    codes: dict[str, tuple[int, ...]] = {}
    for direction in ("output", "input"):
        names = _get(table, direction, where)
        unknown = [name for name in names if name != "-" and name not in signals]
        if unknown:
            raise ConfigError(f"{where}, {direction}: there is no signal {unknown[0]!r}")
        words[direction] = tuple(None if name == "-" else signals[name] for name in names)
        try:
            codes[direction] = signal_codes(words[direction], setpoint=direction == "output")
        except MappingError as exc:
            raise ConfigError(f"{where}, {direction}: {exc}") from exc
    known = layout["telegram"]
    data = Submodule(
        slot=layout["slot"],
        subslot=known["subslot"],
        ident=_get(table, "submodule_ident", where),
        api=layout["api"],
        input_bytes=2 * len(words["input"]),
        output_bytes=2 * len(words["output"]),
        name=_get(table, "name", where),
        source=known["source"],
        note=known["note"],
    )
    ident, source = _get(table, "module_ident", where), _get(table, "ident_source", where)
    return Telegram(
        number=_get(table, "number", where),
        name=_get(table, "name", where),
        free_mapping=_get(table, "free_mapping", where),
        output=words["output"],
        input=words["input"],
        output_words=codes["output"],
        input_words=codes["input"],
        module=Module(ident, (_access_point(layout), data), source),
        source=_get(table, "source", where),
        note=table.get("note", ""),
        others=tuple(
            _other_module(other, data, layout, f"{where}, other_modules {index}")
            for index, other in enumerate(table.get("other_modules", ()), 1)
        ),
        parameter_words=table.get("parameter_words", 0),
        settings=_settings(table, where),
        opmode=table.get("opmode"),
        pulses_enabled=table.get("pulses_enabled"),
    )


def _access_point(layout: Mapping[str, Any]) -> Submodule:
    point = layout["access_point"]
    return Submodule(
        slot=layout["slot"],
        subslot=point["subslot"],
        ident=point["ident"],
        api=layout["api"],
        input_bytes=0,
        output_bytes=0,
        name="Parameter access point",
        source=point["source"],
        note=point["note"],
    )


def _other_module(table: Mapping[str, Any], data: Submodule, layout: Mapping[str, Any], where: str) -> Module:
    """Another module of a telegram: as its first one, under another ident and name."""
    name, source = _get(table, "name", where), _get(table, "source", where)
    note = table.get("note", "")
    if source == "assumed" and not note:
        raise ConfigError(f"{where}, note: an assumed value needs its reason")
    submodules = tuple(replace(submodule, source=source, note=note) for submodule in (_access_point(layout), data))
    return Module(_get(table, "ident", where), submodules, source, note, name, _settings(table, where))


def _settings(table: Mapping[str, Any], where: str) -> dict[int, int]:
    """What plugging a module sets: PNU -> raw number; the parameters are looked for when all are known."""
    return {
        _integer(str(pnu), where, "settings"): _integer(str(value), where, f"settings.{pnu}")
        for pnu, value in table.get("settings", {}).items()
    }


def _check_settings(telegrams: Mapping[int, Telegram], parameters: Mapping[int, Parameter], path: Path) -> None:
    for telegram in telegrams.values():
        for settings in (telegram.settings, *(module.settings for module in telegram.modules)):
            for pnu, value in settings.items():
                parameter = parameters.get(pnu)
                if parameter is None or parameter.behaviour not in {Behaviour.STORED, Behaviour.FIELD}:
                    raise ConfigError(
                        f"{path}, telegram {telegram.number}, settings: no parameter {pnu} that is stored"
                    )
                if not parameter.minimum <= value <= parameter.maximum:
                    raise ConfigError(
                        f"{path}, telegram {telegram.number}, settings.{pnu}: {value} is not within "
                        f"{parameter.minimum}..{parameter.maximum}"
                    )


def _telegrams(
    path: Path, layout: Mapping[str, Any]
) -> tuple[dict[int, Signal], dict[int, Telegram], tuple[WordBits, ...]]:
    data = read_toml(path)
    signals: dict[int, Signal] = {}
    for index, table in enumerate(data.get("signal", ()), 1):
        signal = _signal(table, f"{path}, signal {index}")
        if signal.number in signals:
            raise ConfigError(f"{path}, signal {index}, number: {signal.number} stands twice")
        signals[signal.number] = signal
    by_name = {signal.name: signal for signal in signals.values()}
    telegrams: dict[int, Telegram] = {}
    for index, table in enumerate(data.get("telegram", ()), 1):
        telegram = _telegram(table, f"{path}, telegram {index}", by_name, layout)
        if telegram.number in telegrams:
            raise ConfigError(f"{path}, telegram {index}, number: {telegram.number} stands twice")
        if telegram.opmode not in {None, 0, 1, 2}:
            raise ConfigError(f"{path}, telegram {index}, opmode: {telegram.opmode!r} is none of 0, 1, 2")
        if telegram.pulses_enabled is not None and telegram.pulses_enabled not in range(12):
            raise ConfigError(
                f"{path}, telegram {index}, pulses_enabled: {telegram.pulses_enabled!r} is not within 0..11"
            )
        telegrams[telegram.number] = telegram
    idents = [module.ident for telegram in telegrams.values() for module in telegram.modules]
    twice = next((ident for ident in idents if idents.count(ident) > 1), None)
    if twice is not None:
        raise ConfigError(f"{path}: the module ident 0x{twice:X} stands twice")
    return signals, telegrams, read_bits(data.get("bits", ()), str(path), by_name, telegrams)


# faults.csv


def _fault_number(text: str, where: str, field: str) -> int:
    try:
        return fault_number(text)
    except ValueError:
        raise ConfigError(f"{where}, {field}: {text!r} is not a number, nor two such as 32-1") from None


def _faults(path: Path) -> dict[int, Fault]:
    faults: dict[int, Fault] = {}
    for where, row in _rows(path):
        number = _fault_number(row["number"], where, "number")
        if row["kind"] not in {"fault", "warning"}:
            raise ConfigError(f"{where}, kind: {row['kind']!r} is neither fault nor warning")
        warning = row["kind"] == "warning"
        if row["reaction"] not in ({""} if warning else REACTIONS):
            raise ConfigError(
                f"{where}, reaction: {row['reaction']!r} is none of {', '.join(REACTIONS)} (none for a warning)"
            )
        if number in faults or not 0 < number < 1 << 24:
            raise ConfigError(f"{where}, number: {number} stands twice or is not within 1..{(1 << 24) - 1}")
        if not row["source"] or (row["source"] == "assumed" and not row["note"]):
            raise ConfigError(f"{where}, source: a fault needs its source, an assumed one its reason")
        reaction = REACTIONS.get(row["reaction"], 0)
        word = _integer(row.get("word", ""), where, "word", 0)
        if not 0 <= word <= 0xFFFF or (word and number >= FAULT_WORDS):
            raise ConfigError(f"{where}, word: {word} does not fit in 16 bits, or its fault is above {FAULT_WORDS - 1}")
        faults[number] = Fault(number, row["name"], warning, reaction, row["cause"], row["source"], row["note"], word)
    return faults


# model.toml


def _facts(data: Mapping[str, Any], section: str, path: Path) -> dict[str, Fact]:
    facts: dict[str, Fact] = {}
    for key, entry in _get(data, section, str(path)).items():
        where = f"{path}, {section}.{key}"
        value, source = _get(entry, "value", where), _get(entry, "source", where)
        note = entry.get("note", "")
        if source == "assumed" and not note:
            raise ConfigError(f"{where}, note: an assumed value needs its reason")
        facts[key] = Fact(tuple(value) if isinstance(value, list) else value, source, note, entry.get("unit", ""))
    return facts


def _build(kind: Any, facts: Mapping[str, Fact], where: str) -> Any:
    try:
        return kind(**{key: fact.value for key, fact in facts.items()})
    except TypeError as exc:
        raise ConfigError(f"{where}: {exc}") from exc


def _limits(facts: Mapping[str, Fact], where: str) -> Limits:
    limits: Limits = _build(Limits, facts, where)
    if type(limits.alarms) is not bool:
        raise ConfigError(f"{where}.alarms: {limits.alarms!r} is neither true nor false")
    if limits.max_cycle_ns and limits.max_cycle_ns < limits.min_cycle_ns:
        raise ConfigError(f"{where}.max_cycle_ns: {limits.max_cycle_ns} is below min_cycle_ns, {limits.min_cycle_ns}")
    return limits


def _description_file(facts: Mapping[str, Fact] | None, where: str) -> DescriptionFile | None:
    if facts is None:
        return None
    file: DescriptionFile = _build(DescriptionFile, facts, where)
    try:
        datetime.strptime(str(file.date), "%Y%m%d")  # noqa: DTZ007  # a day, in no time zone
    except ValueError:
        raise ConfigError(f"{where}.date: {file.date!r} is no day such as 20261121") from None
    for key in ("family", "info_text"):
        if not isinstance(getattr(file, key), str) or not getattr(file, key):
            raise ConfigError(f"{where}.{key}: {getattr(file, key)!r} is no text")
    return file


def _communication_loss(
    facts: Mapping[str, Fact], faults: Mapping[int, Fault], parameters: Mapping[int, Parameter], where: str
) -> CommunicationLoss:
    loss: CommunicationLoss = _build(CommunicationLoss, facts, where)
    loss = replace(loss, fault=_fault_number(str(loss.fault), where, "fault"))
    if loss.fault not in faults or {loss.action_parameter, loss.stop_parameter} - parameters.keys() - {0}:
        raise ConfigError(f"{where}: names a fault or a parameter that is not there")
    if type(loss.on_stop) is not bool or (loss.stop_parameter and "on_stop" in facts):
        raise ConfigError(f"{where}.on_stop: true or false, of a drive without stop_parameter")
    return loss


def _sign_of_life(facts: Mapping[str, Fact] | None, faults: Mapping[int, Fault], where: str) -> SignOfLife | None:
    if facts is None:
        return None
    life: SignOfLife = _build(SignOfLife, facts, where)
    life = replace(life, fault=_fault_number(str(life.fault), where, "fault"))
    if life.fault not in faults:
        raise ConfigError(f"{where}.fault: there is no fault {fault_label(life.fault)}")
    return life


def _diagnoses(facts: Mapping[str, Fact], faults: Mapping[int, Fault], limits: Limits, where: str) -> dict[int, int]:
    """Fault -> ChannelErrorType; of those that are a maker's or a profile's own (IEC 61158-6-10, ChannelErrorType)."""
    found: dict[int, int] = {}
    for key, fact in facts.items():
        number = _fault_number(key, where, key)
        if number not in faults:
            raise ConfigError(f"{where}.{key}: there is no fault {number}")
        if not isinstance(fact.value, int) or not (0x0100 <= fact.value <= 0x7FFF or 0x9000 <= fact.value <= 0x9FFF):
            raise ConfigError(f"{where}.{key}: {fact.value!r} is not within 0x0100..0x7FFF and 0x9000..0x9FFF")
        found[number] = fact.value
    if found and not limits.alarms:
        raise ConfigError(f"{where}: a drive without alarms reports no diagnosis; it needs limits.alarms")
    return found


def _diagnosis_coding(
    facts: Mapping[str, Fact] | None, parameters: Mapping[int, Parameter], where: str
) -> DiagnosisCoding | None:
    if facts is None:
        return None
    coding: DiagnosisCoding = _build(DiagnosisCoding, facts, where)
    if coding.mode_parameter not in parameters:
        raise ConfigError(f"{where}.mode_parameter: there is no parameter {coding.mode_parameter}")
    unknown = set(coding.modes) - DIAGNOSIS_CODINGS
    if unknown or len(coding.modes) != len(coding.subslots):
        allowed = ", ".join(sorted(DIAGNOSIS_CODINGS))
        raise ConfigError(f"{where}.modes: each is one of {allowed}, and each has its place in subslots")
    if not 1 <= coding.user_structure <= 0x7FFF:
        raise ConfigError(f"{where}.user_structure: {coding.user_structure} is not within 1..0x7FFF")
    return coding


def _axis_values(facts: Mapping[str, Fact], writer: str, where: str) -> dict[str, float]:
    for key in facts:
        field = AXIS.fields.get(key)
        if field is None or field.writer != writer:
            raise ConfigError(f"{where}.{key}: the axis has no such field that the {writer} writes")
    return {key: fact.value for key, fact in facts.items()}


def _axis_parameters(parameters: Mapping[int, Parameter]) -> tuple[Parameter, ...]:
    """Those that write the axis record; those in acceleration steps behind the one that sets the step."""
    found = [p for p in parameters.values() if p.behaviour is Behaviour.FIELD and p.writable]
    return tuple(sorted(found, key=lambda p: p.scale == "acceleration"))


def load_model(folder: Path) -> Model:
    """Read and check a model's folder."""
    path = folder / "model.toml"
    data = read_toml(path)
    sections = {
        section: _facts(data, section, path)
        for section in (
            "identity",
            "limits",
            "parameter_access",
            "communication_loss",
            "motor",
            "firmware",
        )
    }
    sections |= {
        key: _facts(data, key, path)
        for key in ("description_file", "diagnosis", "diagnosis_coding", "sign_of_life")
        if key in data
    }
    parameters = _parameters(folder / "parameters.csv")
    signals, telegrams, bits = _telegrams(folder / "telegrams.toml", _get(data, "telegram_module", str(path)))
    faults = _faults(folder / "faults.csv")
    dap = _get(data, "dap", str(path))
    try:
        submodules = tuple(Submodule(input_bytes=0, output_bytes=0, **entry) for entry in dap["submodules"])
        dap_module = Module(
            dap["module_ident"]["value"], submodules, dap["module_ident"]["source"], dap["module_ident"]["note"]
        )
    except (KeyError, TypeError) as exc:
        raise ConfigError(f"{path}, dap: {exc}") from exc
    limits = _limits(sections["limits"], f"{path}, limits")
    _check_settings(telegrams, parameters, path)
    loss = _communication_loss(sections["communication_loss"], faults, parameters, f"{path}, communication_loss")
    life = _sign_of_life(sections.get("sign_of_life"), faults, f"{path}, sign_of_life")
    if _get(data, "default_telegram", str(path)) not in telegrams:
        raise ConfigError(f"{path}, default_telegram: there is no telegram {data['default_telegram']}")
    texts = {
        key: _get(data, key, str(path))
        for key in ("name", "title", "maker", "bus", "profile", "manual", "edition", "firmware_version")
    }
    return Model(
        **texts,
        aliases=tuple(data.get("aliases", ())),
        default_telegram=data["default_telegram"],
        identity=_build(Identity, sections["identity"], f"{path}, identity"),
        limits=limits,
        access=_build(ParameterAccess, sections["parameter_access"], f"{path}, parameter_access"),
        communication_loss=loss,
        sign_of_life=life,
        description_file=_description_file(sections.get("description_file"), f"{path}, description_file"),
        diagnoses=_diagnoses(sections.get("diagnosis", {}), faults, limits, f"{path}, diagnosis"),
        diagnosis_coding=_diagnosis_coding(sections.get("diagnosis_coding"), parameters, f"{path}, diagnosis_coding"),
        motor=_axis_values(sections["motor"], "station", f"{path}, motor"),
        firmware=_axis_values(sections["firmware"], "parameter", f"{path}, firmware"),
        dap=dap_module,
        signals=signals,
        word_bits=bits,
        telegrams=telegrams,
        parameters=parameters,
        parameter_names=_names(parameters, data.get("parameter_names", {}), data.get("parameter_prefix", ""), path),
        axis_parameters=_axis_parameters(parameters),
        faults=faults,
        facts={f"{section}.{key}": fact for section, facts in sections.items() for key, fact in facts.items()},
    )
