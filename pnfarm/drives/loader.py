"""From a model's folder to a :class:`~pnfarm.drives.model.Model`.

The folder holds ``model.toml``, ``parameters.csv``, ``telegrams.toml`` and ``faults.csv``, and may hold
``behaviour.toml``.  Every mistake in them is a :class:`~pnfarm.errors.ConfigError` that names file, row and field.
"""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime
from typing import TYPE_CHECKING, Any, TypeVar

from pnfarm.drives.behaviour import read_behaviour, with_behaviour
from pnfarm.drives.consequences import read_consequences
from pnfarm.drives.control_limits import check_control_limits
from pnfarm.drives.effects import check_effects
from pnfarm.drives.factor_group import check_factor_group
from pnfarm.drives.lamps import Lamps
from pnfarm.drives.model import Model
from pnfarm.drives.model_files import integer, read_toml, required, rows
from pnfarm.drives.model_parts import (
    DIAGNOSIS_CODINGS,
    REACTIONS,
    SEND_CLOCKS,
    AddressMode,
    CommunicationLoss,
    ControlLimits,
    DescriptionFile,
    DiagnosisCoding,
    Fact,
    FactorGroup,
    Fault,
    FollowingError,
    Identity,
    Limits,
    MotionTaskParameters,
    ParameterAccess,
    PositionUnits,
    SignOfLife,
    fault_label,
    fault_number,
)
from pnfarm.drives.motor_kinds import read_motor_kinds
from pnfarm.drives.numbering import Numbering, check_numbering
from pnfarm.drives.parameter import Backing
from pnfarm.drives.parameter_rows import axis_parameters, parameter_names, read_only_names, read_parameters
from pnfarm.drives.profiles.profidrive.pkw import PARAMETER_TASKS, ParameterWords
from pnfarm.drives.realism import read_realism
from pnfarm.drives.telegram import Module, Submodule
from pnfarm.drives.telegram_tables import check_settings, read_telegrams
from pnfarm.errors import ConfigError
from pnfarm.table.axis import AXIS, FAULT_ACTIONS, FAULT_WORDS, MOTION_TASKS

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from pnfarm.drives.parameter import Parameter
    from pnfarm.drives.telegram import Signal, Telegram

__all__ = ["load_model"]

_Watched = TypeVar("_Watched", SignOfLife, FollowingError)


# faults.csv


def _fault_number(text: str, where: str, field: str) -> int:
    try:
        return fault_number(text)
    except ValueError:
        raise ConfigError(f"{where}, {field}: {text!r} is not a number, nor two such as 32-1") from None


def _fault_action(row: Mapping[str, str], parameters: Mapping[int, Parameter], where: str) -> int:
    """The PNU of the parameter that says whether a fault is raised, 0 for none."""
    action = integer(row.get("action", ""), where, "action", 0)
    parameter = parameters.get(action)
    if action and (parameter is None or parameter.backing is not Backing.STORED or parameter.elements):
        raise ConfigError(f"{where}, action: {action} is no plain parameter that is stored")
    if action and row["kind"] == "warning":
        raise ConfigError(f"{where}, action: of a fault, not of a warning")
    return action


def _faults(path: Path, parameters: Mapping[int, Parameter]) -> dict[int, Fault]:
    faults: dict[int, Fault] = {}
    for where, row in rows(path):
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
        word = integer(row.get("word", ""), where, "word", 0)
        if not 0 <= word <= 0xFFFF or (word and number >= FAULT_WORDS):
            raise ConfigError(f"{where}, word: {word} does not fit in 16 bits, or its fault is above {FAULT_WORDS - 1}")
        faults[number] = Fault(
            number, row["name"], warning, reaction, row["cause"], row["source"], row["note"], word,
            _fault_action(row, parameters, where),
        )  # fmt: skip
    if sum(fault.action > 0 for fault in faults.values()) > FAULT_ACTIONS:
        raise ConfigError(f"{path}, action: more than {FAULT_ACTIONS} faults have one")
    return faults


# model.toml


def _facts(data: Mapping[str, Any], section: str, path: Path) -> dict[str, Fact]:
    facts: dict[str, Fact] = {}
    for key, entry in required(data, section, str(path)).items():
        where = f"{path}, {section}.{key}"
        value, source = required(entry, "value", where), required(entry, "source", where)
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
    if not limits.send_clocks or set(limits.send_clocks) - set(SEND_CLOCKS):
        raise ConfigError(f"{where}.send_clocks: {list(limits.send_clocks)} are not some of {list(SEND_CLOCKS)}")
    if limits.max_cycle_ns and limits.max_cycle_ns < limits.min_cycle_ns:
        raise ConfigError(f"{where}.max_cycle_ns: {limits.max_cycle_ns} is below min_cycle_ns, {limits.min_cycle_ns}")
    if not 0 <= limits.motion_tasks <= MOTION_TASKS:
        raise ConfigError(f"{where}.motion_tasks: {limits.motion_tasks} is not within 0..{MOTION_TASKS}")
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


def _raising(
    kind: type[_Watched], facts: Mapping[str, Fact] | None, faults: Mapping[int, Fault], where: str
) -> _Watched | None:
    """Something that a drive watches, and the fault that it raises."""
    if facts is None:
        return None
    watched: _Watched = _build(kind, facts, where)
    watched = replace(watched, fault=_fault_number(str(watched.fault), where, "fault"))
    if watched.fault not in faults:
        raise ConfigError(f"{where}.fault: there is no fault {fault_label(watched.fault)}")
    return watched


def _motion_tasks(
    facts: Mapping[str, Fact] | None, parameters: Mapping[int, Parameter], where: str
) -> MotionTaskParameters | None:
    """Of a drive that keeps motion tasks: plain stored parameters, each once."""
    if facts is None:
        return None
    numbers: MotionTaskParameters = _build(MotionTaskParameters, facts, where)
    for pnu in (numbers.number, *numbers.contents):
        parameter = parameters.get(pnu)
        if parameter is None or parameter.backing is not Backing.STORED or parameter.elements:
            raise ConfigError(f"{where}: {pnu} is no plain parameter that is stored")
    for pnu in (numbers.number, numbers.next):
        if parameters[pnu].maximum >= MOTION_TASKS:
            raise ConfigError(f"{where}: PNU {pnu} goes beyond task {MOTION_TASKS - 1}")
    return numbers


def _position_units(
    facts: Mapping[str, Fact] | None, parameters: Mapping[int, Parameter], where: str
) -> PositionUnits | None:
    """Of a drive whose positions come in units to be chosen: plain stored parameters, and a value for each unit."""
    if facts is None:
        scaled = next((parameter.pnu for parameter in parameters.values() if parameter.scale == "position"), None)
        if scaled is not None:
            raise ConfigError(f"{where}: missing, but PNU {scaled} has the scale position")
        return None
    units: PositionUnits = _build(PositionUnits, facts, where)
    for pnu in sorted(units.numbers):
        parameter = parameters.get(pnu)
        if parameter is None or parameter.backing is not Backing.STORED or parameter.elements:
            raise ConfigError(f"{where}: {pnu} is no plain parameter that is stored")
    for key, number in (("default", units.default), ("multiple", units.multiple)):
        if not isinstance(number, int | float) or number <= 0.0:
            raise ConfigError(f"{where}.{key}: {number!r} is no number above 0")
    if parameters[units.unit].maximum >= len(units.revolution):
        raise ConfigError(f"{where}.revolution: PNU {units.unit} goes to {parameters[units.unit].maximum}")
    for pnu in (units.scaling, units.numerator, units.denominator):
        if parameters[pnu].minimum < 1:
            raise ConfigError(f"{where}: PNU {pnu} may be {parameters[pnu].minimum}, which divides nothing")
    return units


def _parameter_words(
    facts: Mapping[str, Fact] | None, telegrams: Iterable[Telegram], where: str
) -> ParameterWords | None:
    if facts is None:
        if any(telegram.parameter_words for telegram in telegrams):
            raise ConfigError(f"{where}: missing, and a telegram has a parameter channel")
        return None
    words: ParameterWords = _build(ParameterWords, facts, where)
    unknown = set(words.tasks) - PARAMETER_TASKS if isinstance(words.tasks, tuple) else True
    if unknown or len(words.tasks) > 16:
        raise ConfigError(f"{where}.tasks: each of at most 16 is one of {', '.join(sorted(PARAMETER_TASKS))}")
    for key, fact in facts.items():
        if key != "tasks" and fact.value not in range(1, 16):
            raise ConfigError(f"{where}.{key}: {fact.value!r} is no response identifier from 1 to 15")
    return words


def _access(
    facts: Mapping[str, Fact], parameters: Mapping[int, Parameter], signals: Mapping[int, Signal], path: Path
) -> ParameterAccess:
    """How parameters are reached, and whether those that it names, and that signals show, are there."""
    where = f"{path}, parameter_access"
    access: ParameterAccess = _build(ParameterAccess, facts, where)
    name = parameters.get(access.station_name)
    if access.station_name and (name is None or not name.text or not name.defaults):
        raise ConfigError(f"{where}.station_name: {access.station_name} is no String with a default")
    for key in ("disabled_only", "absent"):
        if unknown := set(getattr(access, key)) - parameters.keys():
            raise ConfigError(f"{where}.{key}: there is no parameter {min(unknown)}")
    elements = [parameters.get(pnu) for pnu in access.mapping_elements]
    if elements and (len(elements) != 2 or any(p is None or not p.elements for p in elements)):
        raise ConfigError(f"{where}.mapping_elements: {list(access.mapping_elements)} are not two arrays")
    for signal in signals.values():
        shown = parameters.get(signal.number)
        if signal.stored and (
            shown is None or shown.backing not in {Backing.STORED, Backing.FIELD} or 8 * shown.octets != signal.bits
        ):
            raise ConfigError(
                f"{path.parent / 'telegrams.toml'}, signal {signal.number}: no stored parameter of its length"
            )
        if signal.shown_as and signal.shown_as not in parameters:
            raise ConfigError(
                f"{path.parent / 'telegrams.toml'}, signal {signal.number}, shown_as: no parameter {signal.shown_as}"
            )
    return access


def _address_mode(
    facts: Mapping[str, Fact] | None, parameters: Mapping[int, Parameter], where: str
) -> AddressMode | None:
    if facts is None:
        return None
    mode: AddressMode = _build(AddressMode, facts, where)
    parameter = parameters.get(mode.parameter)
    if parameter is None or parameter.backing is not Backing.STORED or not parameter.nonvolatile or parameter.elements:
        raise ConfigError(f"{where}.parameter: {mode.parameter} is no plain parameter that is stored for good")
    if not isinstance(mode.dcp, int) or not parameter.allows(mode.dcp):
        raise ConfigError(f"{where}.dcp: {mode.dcp!r} is no value of {parameter.name}")
    return mode


def _lamps(facts: Mapping[str, Fact] | None, where: str) -> Lamps | None:
    if facts is None:
        return None
    lengths = {len(fact.value) if isinstance(fact.value, tuple) else 0 for fact in facts.values()}
    if 0 in lengths or len(lengths) > 1:
        raise ConfigError(f"{where}: each state has as many entries as there are names")
    lamps: Lamps = _build(Lamps, facts, where)
    return lamps


def _factor_group(
    facts: Mapping[str, Fact] | None, parameters: Mapping[int, Parameter], where: str
) -> FactorGroup | None:
    return None if facts is None else check_factor_group(_build(FactorGroup, facts, where), parameters, where)


def _control_limits(
    facts: Mapping[str, Fact] | None, parameters: Mapping[int, Parameter], where: str
) -> ControlLimits | None:
    return None if facts is None else check_control_limits(_build(ControlLimits, facts, where), parameters, where)


def _parameter_texts(
    facts: Mapping[str, Fact], parameters: Mapping[int, Parameter], where: str
) -> dict[int, tuple[str, ...]]:
    """PNU -> a text for each element of an array."""
    found: dict[int, tuple[str, ...]] = {}
    for key, fact in facts.items():
        parameter = parameters.get(integer(key, where, "pnu"))
        if parameter is None or len(fact.value) != parameter.elements:
            raise ConfigError(f"{where}: {key} is no array, or not of {len(fact.value)} elements")
        found[parameter.pnu] = fact.value
    return found


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
    if len(coding.user_fields) != len(coding.user_octets) or set(coding.user_octets) - {1, 2, 4}:
        raise ConfigError(f"{where}.user_fields: each has its 1, 2 or 4 octets in user_octets")
    return coding


def _axis_values(facts: Mapping[str, Fact], writer: str, where: str) -> dict[str, float]:
    for key in facts:
        field = AXIS.fields.get(key)
        if field is None or field.writer != writer:
            raise ConfigError(f"{where}.{key}: the axis has no such field that the {writer} writes")
    return {key: fact.value for key, fact in facts.items()}


def _nearest(folder: Path, name: str) -> Path:
    """The file of this name in the model's folder, or else in its bus's or its product's."""
    return next((path for place in (folder, *folder.parents[:2]) if (path := place / name).exists()), folder / name)


def load_model(folder: Path) -> Model:
    """Read and check a model's folder, and what it shares with other models of its bus and its product."""
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
        for key in (
            "address_mode",
            "control_limits",
            "description_file",
            "diagnosis",
            "diagnosis_coding",
            "effects",
            "factor_group",
            "following_error",
            "lamps",
            "motion_tasks",
            "numbering",
            "parameter_texts",
            "position_units",
            "parameter_words",
            "realism",
            "sign_of_life",
        )
        if key in data
    }
    motors = {
        kind: {part: _facts(table, part, path) for part in table} for kind, table in data.get("motors", {}).items()
    }
    parameters = read_parameters(_nearest(folder, "parameters.csv"))
    signals, telegrams, bits = read_telegrams(
        _nearest(folder, "telegrams.toml"), required(data, "telegram_module", str(path))
    )
    faults = _faults(_nearest(folder, "faults.csv"), parameters)
    dap = required(data, "dap", str(path))
    try:
        submodules = tuple(Submodule(input_bytes=0, output_bytes=0, **entry) for entry in dap["submodules"])
        dap_module = Module(
            dap["module_ident"]["value"], submodules, dap["module_ident"]["source"], dap["module_ident"].get("note", "")
        )
    except (KeyError, TypeError) as exc:
        raise ConfigError(f"{path}, dap: {exc}") from exc
    where = f"{path}, numbering"
    numbering = check_numbering(_build(Numbering, sections.get("numbering", {}), where), where)
    names = parameter_names(parameters, data.get("parameter_names", {}), numbering, path)
    limits = _limits(sections["limits"], f"{path}, limits")
    check_settings(telegrams, parameters, path)
    loss = _communication_loss(sections["communication_loss"], faults, parameters, f"{path}, communication_loss")
    life = _raising(SignOfLife, sections.get("sign_of_life"), faults, f"{path}, sign_of_life")
    error = _raising(FollowingError, sections.get("following_error"), faults, f"{path}, following_error")

    def section_value(section: str, key: str, value: Any, where: str) -> Any:
        """What a section's key is when it has this value; whatever checks the section checks it, too."""
        facts = sections.get(section, {}) | {key: Fact(value, "behaviour")}
        if section == "communication_loss":
            return getattr(_communication_loss(facts, faults, parameters, where), key)
        if section == "parameter_access":
            return getattr(_access(facts, parameters, signals, path), key)
        return getattr(_position_units(facts, parameters, where), key)

    if required(data, "default_telegram", str(path)) not in telegrams:
        raise ConfigError(f"{path}, default_telegram: there is no telegram {data['default_telegram']}")
    texts = {
        key: required(data, key, str(path))
        for key in ("name", "title", "maker", "bus", "profile", "manual", "edition", "firmware_version")
    }
    motor_kinds = read_motor_kinds(motors, parameters, f"{path}, motors")
    written = {parameter.argument for parameter in axis_parameters(parameters)}
    fixed = written.union(sections["firmware"], *(kind.firmware for kind in motor_kinds.values()))
    described = Model(
        **texts,
        aliases=tuple(data.get("aliases", ())),
        default_telegram=data["default_telegram"],
        identity=_build(Identity, sections["identity"], f"{path}, identity"),
        limits=limits,
        access=_access(sections["parameter_access"], parameters, signals, path),
        communication_loss=loss,
        parameter_words=_parameter_words(
            sections.get("parameter_words"), telegrams.values(), f"{path}, parameter_words"
        ),
        address_mode=_address_mode(sections.get("address_mode"), parameters, f"{path}, address_mode"),
        lamps=_lamps(sections.get("lamps"), f"{path}, lamps"),
        sign_of_life=life,
        following_error=error,
        motion_tasks=_motion_tasks(sections.get("motion_tasks"), parameters, f"{path}, motion_tasks"),
        position_units=_position_units(sections.get("position_units"), parameters, f"{path}, position_units"),
        control_limits=_control_limits(sections.get("control_limits"), parameters, f"{path}, control_limits"),
        factor_group=_factor_group(sections.get("factor_group"), parameters, f"{path}, factor_group"),
        parameter_texts=_parameter_texts(sections.get("parameter_texts", {}), parameters, f"{path}, parameter_texts"),
        consequences=read_consequences(data.get("consequence", ()), parameters, str(path)),
        description_file=_description_file(sections.get("description_file"), f"{path}, description_file"),
        diagnoses=_diagnoses(sections.get("diagnosis", {}), faults, limits, f"{path}, diagnosis"),
        diagnosis_coding=_diagnosis_coding(sections.get("diagnosis_coding"), parameters, f"{path}, diagnosis_coding"),
        realism=read_realism(sections.get("realism"), f"{path}, realism"),
        motor=_axis_values(sections["motor"], "station", f"{path}, motor"),
        firmware=_axis_values(sections["firmware"], "parameter", f"{path}, firmware"),
        dap=dap_module,
        signals=signals,
        word_bits=bits,
        telegrams=telegrams,
        parameters=parameters,
        parameter_names=names,
        numbering=numbering,
        read_only_names=read_only_names(data.get("parameter_names", {})),
        axis_parameters=axis_parameters(parameters),
        faults=faults,
        facts={f"{section}.{key}": fact for section, facts in sections.items() for key, fact in facts.items()}
        | {
            f"motors.{kind}.{part}.{key}": fact
            for kind, parts in motors.items()
            for part, facts in parts.items()
            for key, fact in facts.items()
        },
        motor_kinds=motor_kinds,
        behaviour=read_behaviour(_nearest(folder, "behaviour.toml"), parameters, fixed, section_value),
    )
    effects = check_effects(described, sections.get("effects", {}), f"{path}, effects")
    return with_behaviour(replace(described, effects=effects), {})
