"""A drive model: everything that is known about one product before a drive of it is switched on.

A model is immutable and shared by all drives of its kind.  Each value that can be doubted carries a :class:`Fact`: the
manual's section, or ``assumed`` with the reason.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

from pnfarm.drives.mapping import mapped_signals
from pnfarm.drives.parameter import Behaviour, Parameter, ParameterError, ParameterErrorNumber
from pnfarm.drives.telegram import Module, Submodule
from pnfarm.drives.word_bits import WordBits, bit_names
from pnfarm.errors import ConfigError
from pnfarm.table.axis import FAULT_WORDS, REACTION_COAST, REACTION_QUICK_STOP

if TYPE_CHECKING:
    from pnfarm.drives.consequences import Consequence
    from pnfarm.drives.factor_group import FactorGroup
    from pnfarm.drives.lamps import Lamps
    from pnfarm.drives.motor_kinds import MotorKind
    from pnfarm.drives.profiles.profidrive.pkw import ParameterWords
    from pnfarm.drives.telegram import Signal, Telegram

__all__ = [
    "COMMANDS",
    "CommunicationLoss",
    "DescriptionFile",
    "DiagnosisCoding",
    "Fact",
    "Fault",
    "FollowingError",
    "Identity",
    "Limits",
    "Model",
    "MotionTaskParameters",
    "ParameterAccess",
    "PositionUnits",
    "SignOfLife",
    "fault_label",
    "fault_number",
]

#: Send clocks that a description file can name for RT, in 31.25 us: 250 us to 4 ms.
SEND_CLOCKS = (8, 16, 32, 64, 128)
#: ``command:<name>`` of a model's ``parameters.csv``: what writing such a parameter does (:mod:`pnfarm.drives.store`).
COMMANDS = frozenset({
    "acknowledge", "set-position", "save", "load", "factory-values", "blink", "reboot", "refuse", "home", "enable",
    "disable", "service", "stop", "task-clear", "task-continue", "task-load", "task-move", "task-set",
})  # fmt: skip
#: Causes of the warnings that MELDW.6 and 7 tell of (HIWIN E1 manual 3.16).
MESSAGE_CAUSES = ("motor-overload-warning", "i2t-warning")
#: How a fault may be told as diagnosis (:class:`DiagnosisCoding`).
DIAGNOSIS_CODINGS = frozenset({"none", "channel", "extended", "manufacturer"})
#: A fault's number in two parts, error and location, is the error with the location above it.
LOCATION_SHIFT = 16
REACTIONS = {"coast": REACTION_COAST, "quick-stop": REACTION_QUICK_STOP}


@dataclass(frozen=True, slots=True)
class Fact:
    """Where a value comes from."""

    value: Any
    source: str
    note: str = ""
    unit: str = ""


@dataclass(frozen=True, slots=True)
class Identity:
    """What a drive says that it is (DCP, I&M0, PNU 964 and 975)."""

    vendor_id: int
    device_id: int
    station_type: str
    order_id: str
    hardware_revision: int
    software_prefix: str
    software_version: tuple[int, int, int]
    profile_id: int
    profile_specific_type: int
    drive_unit_type: int
    firmware_date: tuple[int, int]
    object_class: tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class Limits:
    """What the manual denies: cycle in ns, counts, octets.

    A model may leave out the last ones: ``max_cycle_ns`` 0 is no slowest cycle, ``alarms`` False is a drive that sends
    none, ``send_clocks`` (in 31.25 us) are all that a description file can name for RT, ``motion_tasks`` is how many
    a drive keeps, numbered from 0.
    """

    min_cycle_ns: int
    io_controllers: int
    ports: int
    max_parameters: int
    max_elements: int
    max_response: int
    max_cycle_ns: int = 0
    alarms: bool = False
    send_clocks: tuple[int, ...] = SEND_CLOCKS
    motion_tasks: int = 0


@dataclass(frozen=True, slots=True)
class ParameterAccess:
    """How base mode parameter access differs from drive to drive.

    * ``change_response_values``: a positive answer to a change has format 0 and no values behind its header.
    * ``multi_parameter``: a request may hold more than one parameter; else it is refused as a whole (0x23).
    * ``zero_elements``: one value may be asked for with 0 elements; the subindex then does not matter.
    * ``typed_formats``: values are sent in the format of their data type, not as byte, word and double word.
    * ``formats``: those that a change may use, empty for all that are known.
    * ``error_subindex``: an error is followed by the subindex where the profile tells it.
    * ``descriptions``: parameters describe themselves (attribute 0x20).
    * ``unknown_service_id``: response id for a request id that is not known, 0 for that id with bit 7 set.
    * ``saves_at_once``: what is written is permanent at once.
    * ``station_name``: the PNU of the station's name, 0 without such a parameter.
    * ``mapping_elements``: the PNUs with the elements of what PNU 915 and 916 map, empty without such parameters.
    """

    record_indexes: tuple[int, ...]
    axis: tuple[int, ...]
    change_response_values: bool
    multi_parameter: bool = True
    zero_elements: bool = False
    typed_formats: bool = False
    formats: tuple[int, ...] = ()
    error_subindex: bool = True
    descriptions: bool = True
    unknown_service_id: int = 0
    saves_at_once: bool = False
    mapping_elements: tuple[int, ...] = ()
    station_name: int = 0


@dataclass(frozen=True, slots=True)
class DescriptionFile:
    """What only the file for engineering tools says of a drive.

    ``date`` (yyyymmdd) is part of its name: a tool takes a file of the same name for the one that it has.
    """

    date: int
    family: str
    info_text: str


@dataclass(frozen=True, slots=True)
class CommunicationLoss:
    """The fault on lost cyclic data, and the parameters that govern it; 0 is a drive without such a parameter.

    A value of 0 of ``action_parameter`` is no fault.  Without ``stop_parameter``, ``on_stop`` says whether the fault is
    also raised when the controller goes to STOP.
    """

    fault: int
    action_parameter: int = 0
    stop_parameter: int = 0
    stop_bit: int = 0
    on_stop: bool = False


@dataclass(frozen=True, slots=True)
class SignOfLife:
    """Sign of life in STW2 and ZSW2: the fault that too many failures raise."""

    fault: int


@dataclass(frozen=True, slots=True)
class MotionTaskParameters:
    """The PNUs that a motion task is edited in: its number, and what it consists of."""

    number: int
    position: int
    velocity: int
    acceleration: int
    deceleration: int
    control: int
    next: int
    dwell: int

    @property
    def contents(self) -> tuple[int, ...]:
        """All but the number."""
        return (
            self.position, self.velocity, self.acceleration, self.deceleration, self.control, self.next, self.dwell,
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class PositionUnits:
    """The PNUs that parameters with the scale ``position`` follow: so many units to a revolution.

    The value of ``unit`` picks one of ``revolution``, units to a revolution, where 0 stands for ``numerator`` by
    ``denominator``; ``scaling`` divides what was picked.
    """

    scaling: int
    unit: int
    numerator: int
    denominator: int
    revolution: tuple[float, ...]

    @property
    def numbers(self) -> frozenset[int]:
        """All the PNUs."""
        return frozenset({self.scaling, self.unit, self.numerator, self.denominator})


@dataclass(frozen=True, slots=True)
class FollowingError:
    """Position mode: the fault that a following error beyond its limit raises."""

    fault: int


@dataclass(frozen=True, slots=True)
class DiagnosisCoding:
    """How a drive's own faults are told to its controller.

    The value of ``mode_parameter`` picks one of ``modes`` (:data:`DIAGNOSIS_CODINGS`; none beyond them) and the subslot
    of the same place in ``subslots``; ``user_structure`` is the USI of the maker's own form, ``user_fields`` say what
    its octets are, one after the other, with the length of the same place in ``user_octets``.
    """

    mode_parameter: int
    modes: tuple[str, ...]
    subslots: tuple[int, ...]
    user_structure: int
    user_fields: tuple[str, ...] = ()
    user_octets: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault or warning by its number (:func:`fault_number`).

    ``cause`` is what a fault kind asks for, empty if none raises it.
    """

    number: int
    name: str
    warning: bool
    reaction: int
    cause: str
    source: str
    note: str
    #: The word that PNU 945 and the signal FAULT_CODE show, 0 where the manual has none.
    word: int = 0

    @property
    def label(self) -> str:
        """The manual's way to write the number."""
        return fault_label(self.number)

    @property
    def code(self) -> int:
        """Number with its reaction, as the axis record and ``CMD_RAISE_FAULT`` take it."""
        return self.number | self.reaction << 24


def _is_number(text: str) -> bool:
    """Whether these are digits, and not more than a number of the drive's has."""
    return text.isascii() and text.isdigit() and len(text) <= 20


def fault_number(text: str) -> int:
    """``702`` or, in two parts, ``32-1`` (error 32, location 1) as one number; raises :class:`ValueError`."""
    error, dash, location = text.partition("-")
    if not dash:
        return int(text, 0)
    if not (error.isascii() and error.isdigit() and location.isascii() and location.isdigit()):
        raise ValueError(f"{text!r} is no fault number")
    if int(error) >= 1 << LOCATION_SHIFT or int(location) >= 1 << 8:
        raise ValueError(f"{text!r} is too large for a fault number")
    return int(error) | int(location) << LOCATION_SHIFT


def fault_label(number: int) -> str:
    """A fault's number as its manual writes it: in two parts if it has a location."""
    location = number >> LOCATION_SHIFT
    return f"{number & ((1 << LOCATION_SHIFT) - 1)}-{location}" if location else str(number)


@dataclass(frozen=True, slots=True)
class Model:
    """One product; see the module's head."""

    name: str
    aliases: tuple[str, ...]
    title: str
    maker: str
    bus: str
    profile: str
    manual: str
    edition: str
    firmware_version: str
    default_telegram: int
    identity: Identity
    limits: Limits
    access: ParameterAccess
    communication_loss: CommunicationLoss
    parameter_words: ParameterWords | None
    lamps: Lamps | None
    sign_of_life: SignOfLife | None
    following_error: FollowingError | None
    motion_tasks: MotionTaskParameters | None
    position_units: PositionUnits | None
    factor_group: FactorGroup | None
    consequences: tuple[Consequence, ...]
    #: Texts of an array's elements.
    parameter_texts: Mapping[int, tuple[str, ...]]
    description_file: DescriptionFile | None
    #: Faults that are reported as diagnosis: fault -> ChannelErrorType.
    diagnoses: Mapping[int, int]
    diagnosis_coding: DiagnosisCoding | None
    motor: Mapping[str, float]
    firmware: Mapping[str, float]
    dap: Module
    signals: Mapping[int, Signal]
    word_bits: tuple[WordBits, ...]
    telegrams: Mapping[int, Telegram]
    parameters: Mapping[int, Parameter]
    parameter_names: Mapping[str, int]
    axis_parameters: tuple[Parameter, ...]
    faults: Mapping[int, Fault]
    facts: Mapping[str, Fact]
    #: Motors that a farm file may choose instead of the usual one, which turns.
    motor_kinds: Mapping[str, MotorKind]
    #: The motor at hand, and of a linear one the way of a revolution of the axis record, mm; else 0.
    motor_kind: str = "rotary"
    pitch: float = 0.0

    # parameters

    def resolve(self, text: str | int) -> tuple[Parameter, int]:
        """The parameter and subindex that ``922``, ``"947.3"``, ``"DRV.OPMODE"`` or ``"VL.FB"`` names.

        A name that stands twice in the manual gives its first row; a name is also found without its ``_32``.
        Raises :class:`ParameterError` (impermissible parameter number).
        """
        wanted = str(text).strip()
        pnu, subindex = self.parameter_names.get(wanted.upper()), 0
        if pnu is None:
            number, _, index = wanted.partition(".")
            if _is_number(number) and (not index or _is_number(index)):
                pnu, subindex = int(number), int(index or 0)
            else:
                name, _, index = wanted.rpartition(".")
                if _is_number(index):
                    pnu, subindex = self.parameter_names.get(name.upper()), int(index)
        if pnu is None or pnu not in self.parameters:
            raise ParameterError(
                ParameterErrorNumber.IMPERMISSIBLE_PNU,
                detail=f"{self.name} has no parameter {wanted[:60]!r}; give a number or a name of its manual",
            )
        return self.parameters[pnu], subindex

    def canonical(self, parameter: Parameter) -> Parameter:
        """The parameter that an alias stands for, or itself."""
        return self.parameters[parameter.index] if parameter.behaviour is Behaviour.ALIAS else parameter

    # faults

    def fault(self, wanted: str | int) -> Fault:
        """The fault of this number, name, code or cause (``F702``, ``AL.FB1``, ``undervoltage``).

        Raises :class:`ConfigError` when there is none.
        """
        text = str(wanted).strip()
        number = text[1:] if text[:1] in {"F", "f", "n"} and text[1:2].isdigit() else text
        for fault in self.faults.values():
            if number == fault.label:
                return fault
        if _is_number(number) and int(number) in self.faults:
            return self.faults[int(number)]
        for fault in self.faults.values():
            if text.lower() in {fault.name.lower(), _code_in(fault.name), fault.cause} and text:
                return fault
        known = ", ".join(fault.label for fault in self.faults.values())
        raise ConfigError(f"{self.name} has no fault {text[:60]!r}; it has {known}, their names and causes")

    # telegrams

    def telegram_by_module(self, module_ident: int) -> Telegram | None:
        """The telegram whose module has this ident number, None if none has."""
        return next(
            (t for t in self.telegrams.values() if any(module.ident == module_ident for module in t.modules)), None
        )

    def signals_of(
        self, numbers: Sequence[int], *, setpoint: bool, elements: Sequence[int] = ()
    ) -> tuple[Signal | None, ...]:
        """What a free mapping makes of ``numbers`` (:func:`pnfarm.drives.mapping.mapped_signals`)."""
        return mapped_signals(self, numbers, setpoint=setpoint, elements=elements)

    def bit_names(self, word: str, telegram: int) -> tuple[str, ...]:
        """The names of a control or status word's bits in a telegram, bit 0 first; empty where no manual names any."""
        return bit_names(self.word_bits, word, telegram)

    # set-up

    def apply_motor(self, axis: Any) -> None:
        """Write motor and hardware of this model into an axis record (fields of writer ``station``)."""
        for field, value in self.motor.items():
            setattr(axis, field, value)
        for fault in self.faults.values():
            if fault.number < FAULT_WORDS:
                axis.fault_words[fault.number] = fault.word
            if fault.cause in MESSAGE_CAUSES:
                axis.message_warnings[MESSAGE_CAUSES.index(fault.cause)] = fault.number

    def with_identity(self, overrides: Mapping[str, Any]) -> Model:
        """This model under another identity; see :data:`OVERRIDES` for the keys.  Raises :class:`ConfigError`."""
        return override_identity(self, overrides) if overrides else self

    def source_of(self, what: str) -> Fact:
        """Where a value such as ``identity.device_id`` comes from; :class:`KeyError` for an unknown one."""
        return self.facts[what]


def _code_in(name: str) -> str:
    """The maker's own code that a fault's name begins with, such as ``al.fb1``; empty for none."""
    first = name.split(" ", 1)[0].lower()
    return first if "." in first else ""


#: Keys of the farm file's ``identity`` section.
OVERRIDES: Mapping[str, str] = {
    "vendor": "vendor id, 0..0xFFFF",
    "device": "device id, 0..0xFFFF",
    "order_number": "order number, up to 20 ASCII characters",
    "station_type": "DCP station type, up to 25 ASCII characters",
    "hardware_revision": "0..0xFFFF",
    "software_version": "such as V1.17.0",
    "profile_id": "0..0xFFFF",
    "profile_specific_type": "0..0xFFFF",
    "dap": "module ident of the device access point",
    "dap_submodules": "mapping: subslot -> submodule ident",
    "access_point": "submodule ident of the parameter access point",
    "telegrams": "mapping: telegram -> module ident, or {module: ident, submodule: ident}",
}


def _number(value: Any, where: str, maximum: int) -> int:
    try:
        number = int(value, 0) if isinstance(value, str) else value
    except ValueError:
        number = None
    if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number <= maximum:
        raise ConfigError(f"identity.{where}: {value!r} is not a number from 0 to 0x{maximum:X}")
    return number


def _text(value: Any, where: str, length: int) -> str:
    if not isinstance(value, str) or not value.isascii() or not value.isprintable() or not 0 < len(value) <= length:
        raise ConfigError(f"identity.{where}: {value!r} is not a text of 1 to {length} ASCII characters")
    return value


def _version(value: Any) -> tuple[str, tuple[int, int, int]]:
    text = _text(value, "software_version", 16)
    prefix, digits = (text[0], text[1:]) if text[0] in "VRPUT" else ("V", text)
    parts = digits.split(".")
    if len(parts) != 3 or not all(part.isdigit() and int(part) <= 255 for part in parts):
        raise ConfigError(
            f"identity.software_version: {value!r} is not like V1.17.0 (V, R, P, U or T and three numbers up to 255)"
        )
    major, minor, internal = (int(part) for part in parts)
    return prefix, (major, minor, internal)


def _mapping(value: Any, where: str) -> Mapping[Any, Any]:
    if not isinstance(value, Mapping):
        raise ConfigError(f"identity.{where}: {value!r} is not a mapping")
    return value


_IDENT = 0xFFFFFFFF
_Part = TypeVar("_Part", Module, Submodule)
#: Override -> field of Identity, for the plain numbers and texts.
_NUMBERS = {
    "vendor": "vendor_id",
    "device": "device_id",
    "hardware_revision": "hardware_revision",
    "profile_id": "profile_id",
    "profile_specific_type": "profile_specific_type",
}
_TEXTS = {"order_number": ("order_id", 20), "station_type": ("station_type", 25)}


def _from_farm_file(part: _Part, ident: int) -> _Part:
    return dataclasses.replace(part, ident=ident, source="farm file", note="")


def _with_ident(module: Module, subslot: int, ident: int, where: str) -> Module:
    if all(submodule.subslot != subslot for submodule in module.submodules):
        known = ", ".join(f"0x{submodule.subslot:X}" for submodule in module.submodules)
        raise ConfigError(f"identity.{where}: there is no subslot 0x{subslot:X}; there are {known}")
    submodules = tuple(_from_farm_file(s, ident) if s.subslot == subslot else s for s in module.submodules)
    return dataclasses.replace(module, submodules=submodules)


def _telegram_subslot(module: Module) -> int:
    return max(submodule.subslot for submodule in module.submodules)


def override_identity(model: Model, overrides: Mapping[str, Any]) -> Model:
    """See :meth:`Model.with_identity`."""
    for key in overrides:
        if key not in OVERRIDES:
            raise ConfigError(f"identity.{key}: unknown; there are {', '.join(OVERRIDES)}")
    changes: dict[str, Any] = {}
    for key, field in _NUMBERS.items():
        if key in overrides:
            changes[field] = _number(overrides[key], key, 0xFFFF)
    for key, (field, length) in _TEXTS.items():
        if key in overrides:
            changes[field] = _text(overrides[key], key, length)
    if "software_version" in overrides:
        changes["software_prefix"], changes["software_version"] = _version(overrides["software_version"])

    dap = model.dap
    if "dap" in overrides:
        dap = _from_farm_file(dap, _number(overrides["dap"], "dap", _IDENT))
    for subslot, ident in _mapping(overrides.get("dap_submodules", {}), "dap_submodules").items():
        where = f"dap_submodules.{subslot}"
        dap = _with_ident(dap, _number(subslot, where, 0xFFFF), _number(ident, where, _IDENT), where)

    telegrams = dict(model.telegrams)
    if "access_point" in overrides:
        ident = _number(overrides["access_point"], "access_point", _IDENT)
        for number, telegram in telegrams.items():
            module, *others = (
                _with_ident(m, min(s.subslot for s in m.submodules), ident, "access_point") for m in telegram.modules
            )
            telegrams[number] = dataclasses.replace(telegram, module=module, others=tuple(others))
    for key, wanted in _mapping(overrides.get("telegrams", {}), "telegrams").items():
        where = f"telegrams.{key}"
        number = _number(key, where, 0xFFFF)
        if number not in telegrams:
            raise ConfigError(
                f"identity.{where}: {model.name} has no telegram {number}; it has {', '.join(map(str, telegrams))}"
            )
        parts = wanted if isinstance(wanted, Mapping) else {"module": wanted}
        if not parts.keys() <= {"module", "submodule"}:
            raise ConfigError(f"identity.{where}: {dict(parts)!r} may hold module and submodule only")
        module = telegrams[number].module
        if "module" in parts:
            module = _from_farm_file(module, _number(parts["module"], f"{where}.module", _IDENT))
        if "submodule" in parts:
            module = _with_ident(
                module, _telegram_subslot(module), _number(parts["submodule"], f"{where}.submodule", _IDENT), where
            )
        telegrams[number] = dataclasses.replace(telegrams[number], module=module)
    idents = [module.ident for telegram in telegrams.values() for module in telegram.modules]
    if len(set(idents)) != len(idents):
        raise ConfigError(
            "identity.telegrams: two modules have the same module ident; a controller could not tell them apart"
        )
    return dataclasses.replace(
        model, identity=dataclasses.replace(model.identity, **changes), dap=dap, telegrams=telegrams
    )


def submodule_json(submodule: Submodule) -> dict[str, Any]:
    """A submodule as ``pnfarm models MODEL --format json`` shows it."""
    return {
        "slot": submodule.slot,
        "subslot": submodule.subslot,
        "ident": submodule.ident,
        "api": submodule.api,
        "input_bytes": submodule.input_bytes,
        "output_bytes": submodule.output_bytes,
        "name": submodule.name,
        "source": submodule.source,
        "note": submodule.note,
    }
