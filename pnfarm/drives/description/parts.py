"""The parts of a drive model: identity, limits, faults and the like, as plain data.

Each value that needs a source carries a :class:`Fact`: the manual's section, or ``assumed`` with the reason.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, Any

from pnfarm.table.axis_codes import REACTION_COAST, REACTION_QUICK_STOP

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = [
    "COMMANDS",
    "DIAGNOSIS_CODINGS",
    "MESSAGE_CAUSES",
    "NO_IDENTITY",
    "REACTIONS",
    "SEND_CLOCKS",
    "SWITCH_CAUSES",
    "AddressMode",
    "BehaviourSet",
    "CommunicationLoss",
    "ControlLimits",
    "DescriptionFile",
    "DiagnosisCoding",
    "Effect",
    "Fact",
    "FactorGroup",
    "Fault",
    "FollowingError",
    "Identity",
    "Limits",
    "MakersFault",
    "MotionTaskParameters",
    "MotorKind",
    "ParameterAccess",
    "Point",
    "PositionUnits",
    "Reading",
    "SignOfLife",
    "fault_label",
    "fault_number",
]

#: Send clocks that a description file can name for RT, in 31.25 us: 250 us to 4 ms.
SEND_CLOCKS = (8, 16, 32, 64, 128)
#: ``command:<name>`` of a model's ``parameters.csv``: what writing such a parameter does
#: (:mod:`pnfarm.drives.parameters.store`).
COMMANDS = frozenset({
    "acknowledge", "set-position", "save", "load", "factory-values", "blink", "reboot", "refuse", "home", "enable",
    "disable", "service", "stop", "task-clear", "task-continue", "task-load", "task-move", "task-set",
})  # fmt: skip
#: Causes of the warnings that MELDW.6 and 7 report (HIWIN E1 manual 3.16).
MESSAGE_CAUSES = ("motor-overload-warning", "i2t-warning")
#: Causes of the warnings that a drive shows on its limit switches, the low and the high one.
SWITCH_CAUSES = ("limit-switch-negative", "limit-switch-positive")
#: Formats of a fault as diagnosis (:class:`DiagnosisCoding`).
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
    """The identity that a PROFIdrive drive reports (DCP, I&M0, PNU 964 and 975)."""

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


#: For a drive without PROFIdrive.
NO_IDENTITY = Identity(0, 0, "", "", 0, "V", (0, 0, 0), 0, 0, 0, (0, 0), (0, 0, 0))


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits that the manual states: cycle in ns, counts, octets.

    ``max_cycle_ns`` 0: no limit; ``motion_tasks`` is how many a drive keeps, numbered from 0; ``axes``: most axes on
    one connection.

    Of base mode parameter access: ``max_parameters`` and ``max_elements`` of a request, ``max_response`` octets.  Of
    PROFINET: ``io_controllers``, ``ports``, ``alarms`` (False is a drive that sends none), ``send_clocks`` (in
    31.25 us; all that a description file can name for RT when left out).  0 if the drive lacks the function.
    """

    min_cycle_ns: int
    io_controllers: int = 0
    ports: int = 0
    max_parameters: int = 0
    max_elements: int = 0
    max_response: int = 0
    max_cycle_ns: int = 0
    alarms: bool = False
    send_clocks: tuple[int, ...] = SEND_CLOCKS
    motion_tasks: int = 0
    axes: int = 1


@dataclass(frozen=True, slots=True)
class ParameterAccess:
    """How access to parameters, base mode parameter access above all, differs from drive to drive.

    * ``change_response_values``: a positive answer to a change has format 0 and no values after its header.
    * ``multi_parameter``: a request may hold more than one parameter; else it is refused as a whole (0x23).
    * ``zero_elements``: one value may be requested with 0 elements; the subindex is then ignored.
    * ``typed_formats``: values are sent in the format of their data type, not as byte, word and double word.
    * ``formats``: those that a change request may use, empty for all known ones.
    * ``error_subindex``: an error is followed by the subindex where the profile defines it.
    * ``descriptions``: parameters describe themselves (attribute 0x20).
    * ``unknown_service_id``: response id for an unknown request id, 0 for that id with bit 7 set.
    * ``saves_at_once``: written values are permanent at once.
    * ``disabled_only``: PNUs that are written only while the power stage is off.
    * ``absent``: PNUs of the model's rows that the drive does not have.
    * ``station_name``: the PNU of the station's name, 0 without such a parameter.
    * ``mapping_elements``: the PNUs with the elements of what PNU 915 and 916 map, empty without such parameters.
    * ``mapping_by_entry``: PNU 915 and 916 accept an incomplete list, in which half double words are ignored;
      a signal may be listed twice: it is sent twice, and of a set point the first one applies.
    """

    record_indexes: tuple[int, ...] = ()
    axis: tuple[int, ...] = ()
    change_response_values: bool = False
    multi_parameter: bool = True
    zero_elements: bool = False
    typed_formats: bool = False
    formats: tuple[int, ...] = ()
    error_subindex: bool = True
    descriptions: bool = True
    unknown_service_id: int = 0
    saves_at_once: bool = False
    mapping_elements: tuple[int, ...] = ()
    mapping_by_entry: bool = False
    disabled_only: tuple[int, ...] = ()
    absent: tuple[int, ...] = ()
    station_name: int = 0


@dataclass(frozen=True, slots=True)
class DescriptionFile:
    """Data of a drive that only the file for engineering tools contains.

    ``date`` (yyyymmdd) is part of its name: a tool treats a file of the same name as the one that it already has.
    """

    date: int
    family: str
    info_text: str


@dataclass(frozen=True, slots=True)
class CommunicationLoss:
    """The fault on lost cyclic data, and the parameters that control it; 0 for a drive without such a parameter.

    Where the value of ``action_parameter`` is 0, no fault is raised; a fault with an ``action`` of its own needs no
    such parameter.  Without ``stop_parameter``, ``on_stop`` says whether the fault is also raised when the controller
    goes to STOP.
    """

    fault: int
    action_parameter: int = 0
    stop_parameter: int = 0
    stop_bit: int = 0
    on_stop: bool = False


@dataclass(frozen=True, slots=True)
class AddressMode:
    """The PNU that selects the source of the drive's address, and its value once DCP has set one."""

    parameter: int
    dcp: int


@dataclass(frozen=True, slots=True)
class SignOfLife:
    """Sign of life in STW2 and ZSW2: the fault that too many failures raise."""

    fault: int


@dataclass(frozen=True, slots=True)
class MotionTaskParameters:
    """The PNUs for editing a motion task: its number, and its values."""

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
        """All except the number."""
        return (
            self.position, self.velocity, self.acceleration, self.deceleration, self.control, self.next, self.dwell,
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class PositionUnits:
    """The PNUs that determine the scale ``position``: units per revolution; 0 for a drive without such a parameter.

    The value of ``unit`` selects one of ``revolution``, units per revolution, where 0 means ``numerator`` by
    ``denominator``; ``multiple`` multiplies the selected one, ``scaling`` divides it.  The defaults of such parameters
    count ``default`` units per revolution.
    """

    revolution: tuple[float, ...]
    default: float
    scaling: int = 0
    unit: int = 0
    numerator: int = 0
    denominator: int = 0
    multiple: float = 1.0

    @property
    def numbers(self) -> frozenset[int]:
        return frozenset({self.scaling, self.unit, self.numerator, self.denominator} - {0})


@dataclass(frozen=True, slots=True)
class FactorGroup:
    """The PNUs of the factors."""

    numerator: int
    denominator: int
    speed: int
    acceleration: int
    torque: int

    @property
    def numbers(self) -> frozenset[int]:
        return frozenset({self.numerator, self.denominator, self.speed, self.acceleration, self.torque})


@dataclass(frozen=True, slots=True)
class ControlLimits:
    """The PNUs of limits in percent, and of the nominal values that they are percentages of."""

    nominal_speed: int
    speed: int
    speed_positive: int
    speed_negative: int
    nominal_torque: int
    torque: int
    torque_positive: int
    torque_negative: int
    torque_scale: int

    @property
    def numbers(self) -> frozenset[int]:
        return frozenset(astuple(self))


@dataclass(frozen=True, slots=True)
class MotorKind:
    """Differences of this motor: fields of the axis record in its own units, and defaults of parameters by PNU.

    ``pitch`` is the travel of one revolution in mm, 0 for a rotary motor.
    """

    pitch: float = 0.0
    motor: Mapping[str, float] = field(default_factory=dict)
    firmware: Mapping[str, float] = field(default_factory=dict)
    defaults: Mapping[int, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class FollowingError:
    """Position mode: the fault that a following error beyond its limit raises."""

    fault: int


@dataclass(frozen=True, slots=True)
class DiagnosisCoding:
    """How a drive's own faults are reported to its controller.

    The value of ``mode_parameter`` selects one of ``modes`` (:data:`DIAGNOSIS_CODINGS`; beyond them, no diagnosis) and
    the subslot at the same index of ``subslots``; ``user_structure`` is the USI of the maker's own format,
    ``user_fields`` its fields in order, each with the length at the same index of ``user_octets``.
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

    ``cause`` is the name by which fault kinds select it, empty if none raises it.  ``action`` is the PNU of the
    parameter that enables it, 0 for one that is always enabled.
    """

    number: int
    name: str
    warning: bool
    reaction: int
    cause: str
    source: str
    note: str
    #: The code in PNU 945 and the signal FAULT_CODE, 0 where the manual has none.
    word: int = 0
    action: int = 0
    #: Its bit of MELD_NAMUR, 0 for that of other faults.
    namur: int = 0

    @property
    def label(self) -> str:
        """The number as the manual writes it."""
        return fault_label(self.number)

    @property
    def code(self) -> int:
        """Number with its reaction, as the axis record and ``CMD_RAISE_FAULT`` take it."""
        return self.number | self.reaction << 24


class Effect(Enum):
    """The effect of a parameter; ``acts`` where writing it, or its value, changes what the drive does."""

    ACTS = "acts"
    LIVE = "live"  # it reads a state of the drive
    KEPT = "kept"  # it is stored and read back, and has no effect
    CONSTANT = "constant"  # its value is constant


@dataclass(frozen=True, slots=True)
class Reading:
    """One interpretation of a manual; ``does`` says what a drive with this reading does."""

    name: str
    does: str
    firmware: Mapping[str, float] = field(default_factory=dict)
    defaults: Mapping[int, int] = field(default_factory=dict)
    #: (section, key) -> value as the model has it.
    model: Mapping[tuple[str, str], Any] = field(default_factory=dict)

    @property
    def keys(self) -> frozenset[object]:
        """Everything that it sets."""
        return frozenset((*self.firmware, *self.defaults, *self.model))

    @property
    def values(self) -> tuple[Mapping[Any, Any], ...]:
        """The values that differ between readings."""
        return self.firmware, self.defaults, self.model


@dataclass(frozen=True, slots=True)
class Point:
    """A point that a manual leaves open; ``source`` is its section, ``reason`` the reason for the default."""

    name: str
    about: str
    readings: Mapping[str, Reading]
    default: str
    reason: str
    source: str


@dataclass(frozen=True, slots=True)
class MakersFault:
    """One of the model's faults as the maker has it.

    ``reaction`` (``REACTION_*``) and ``diagnosis`` (a ChannelErrorType) are None where the model's stay.
    """

    fault: int
    code: int
    name: str
    source: str
    reaction: int | None = None
    diagnosis: int | None = None


@dataclass(frozen=True, slots=True)
class BehaviourSet:
    """A set: ``readings`` by point, each with its source; ``sources`` in full by the short names in these."""

    name: str
    title: str
    gaps: str
    sources: Mapping[str, str] = field(default_factory=dict)
    readings: Mapping[str, Fact] = field(default_factory=dict)
    faults: tuple[MakersFault, ...] = ()


def fault_number(text: str) -> int:
    """``702`` or, in two parts, ``32-1`` (error 32, location 1) as one number; raises :class:`ValueError`."""
    error, dash, location = text.partition("-")
    if not dash:
        return int(text, 0)
    if not (error.isascii() and error.isdigit() and location.isascii() and location.isdigit()):
        raise ValueError(f"{text!r} is not a fault number")
    if int(error) >= 1 << LOCATION_SHIFT or int(location) >= 1 << 8:
        raise ValueError(f"{text!r} is too large for a fault number")
    return int(error) | int(location) << LOCATION_SHIFT


def fault_label(number: int) -> str:
    """A fault's number as its manual writes it: in two parts if it has a location."""
    location = number >> LOCATION_SHIFT
    return f"{number & ((1 << LOCATION_SHIFT) - 1)}-{location}" if location else str(number)
