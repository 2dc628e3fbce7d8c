"""A drive model: all data of a product on one bus.

A model is immutable and shared by all drives of its kind.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pnfarm.drives.description.numbering import Numbering, read_number
from pnfarm.drives.description.parts import MESSAGE_CAUSES, SWITCH_CAUSES
from pnfarm.drives.parameters.parameter import Backing, Parameter, ParameterError, ParameterErrorNumber
from pnfarm.drives.profiles.cip.part import CIP
from pnfarm.errors import ConfigError
from pnfarm.firmware.axis import AXIS
from pnfarm.table.axis_codes import FAULT_WORDS, FIRMWARE_ETHERNETIP, FIRMWARE_PROFIDRIVE
from pnfarm.vocabulary.quoting import did_you_mean

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.drives.description.lamps import Lamps
    from pnfarm.drives.description.parts import (
        AddressMode,
        BehaviourSet,
        CommunicationLoss,
        ControlLimits,
        DescriptionFile,
        DiagnosisCoding,
        Effect,
        Fact,
        FactorGroup,
        Fault,
        FollowingError,
        Limits,
        MotionTaskParameters,
        MotorKind,
        ParameterAccess,
        Point,
        PositionUnits,
    )
    from pnfarm.drives.description.realism import Realism
    from pnfarm.drives.parameters.consequences import Consequence
    from pnfarm.drives.profiles.cip.part import Cip
    from pnfarm.drives.profiles.profidrive.part import Profidrive
    from pnfarm.drives.telegrams.telegram import Module

__all__ = ["Model"]


def _is_number(text: str) -> bool:
    """Whether the text is all digits, and not longer than the drive's numbers."""
    return text.isascii() and text.isdigit() and len(text) <= 20


@dataclass(frozen=True, slots=True)
class Model:
    """A product on a bus; see the module's docstring."""

    name: str
    aliases: tuple[str, ...]
    title: str
    maker: str
    bus: str
    profile: str
    manual: str
    edition: str
    firmware_version: str
    limits: Limits
    access: ParameterAccess
    communication_loss: CommunicationLoss
    address_mode: AddressMode | None
    lamps: Lamps | None
    following_error: FollowingError | None
    motion_tasks: MotionTaskParameters | None
    position_units: PositionUnits | None
    factor_group: FactorGroup | None
    control_limits: ControlLimits | None
    consequences: tuple[Consequence, ...]
    #: Texts of an array's elements.
    parameter_texts: Mapping[int, tuple[str, ...]]
    description_file: DescriptionFile | None
    #: Faults that are reported as diagnosis: fault -> ChannelErrorType.
    diagnoses: Mapping[int, int]
    diagnosis_coding: DiagnosisCoding | None
    realism: Realism
    motor: Mapping[str, float]
    firmware: Mapping[str, float]
    #: The module in slot 0 of a PROFINET device.
    dap: Module
    profidrive: Profidrive
    cip: Cip
    #: Data that only the model's bus reads: the section named after the bus.
    bus_facts: Mapping[str, Fact]
    parameters: Mapping[int, Parameter]
    parameter_names: Mapping[str, int]
    #: Names, in upper case, under which a parameter can only be read.
    read_only_names: frozenset[str]
    axis_parameters: tuple[Parameter, ...]
    faults: Mapping[int, Fault]
    facts: Mapping[str, Fact]
    #: Motors that a farm file may choose instead of the usual, rotary one.
    motor_kinds: Mapping[str, MotorKind]
    #: How the maker writes the numbers of parameters.
    numbering: Numbering = field(default_factory=Numbering)
    #: PNU -> its effect, where that differs from the derived one.
    effects: Mapping[int, Effect] = field(default_factory=dict)
    #: Points that the manual leaves open, and the readings that a farm file chose; all others have their defaults.
    behaviour: tuple[Point, ...] = ()
    readings: Mapping[str, str] = field(default_factory=dict)
    #: What makers' drives do, by the name of the set.
    behaviour_sets: Mapping[str, BehaviourSet] = field(default_factory=dict)
    #: Rows that are not parameters with these readings.
    absent: Mapping[int, Parameter] = field(default_factory=dict)
    #: Travel of a linear motor in one revolution of the axis record, mm; 0 for a rotary motor.
    pitch: float = 0.0

    def __hash__(self) -> int:
        # its mappings have no hash
        return hash(self.name)

    @property
    def front(self) -> int:
        """The front of its axis: ``axis.front``."""
        return FIRMWARE_ETHERNETIP if self.profile == CIP else FIRMWARE_PROFIDRIVE

    # parameters

    def resolve(self, text: str | int) -> tuple[Parameter, int]:
        """The parameter and subindex that ``922``, ``"947.3"``, ``"0x2317"``, ``"DRV.OPMODE"`` or ``"VL.FB"`` names.

        A name that the manual uses twice gives its first row; a name is also found without its ``_32``.
        Raises :class:`ParameterError` (impermissible parameter number).
        """
        wanted = str(text).strip()
        pnu, subindex = self.parameter_names.get(wanted.upper()), 0
        if pnu is None:
            number, _, index = wanted.partition(".")
            if (found := read_number(number)) is not None and (not index or _is_number(index)):
                pnu, subindex = found, int(index or 0)
            else:
                name, _, index = wanted.rpartition(".")
                if _is_number(index):
                    pnu, subindex = self.parameter_names.get(name.upper()), int(index)
        if pnu is None or pnu not in self.parameters:
            hint = did_you_mean(wanted, self.parameter_names) or "; give a number or a name of its manual"
            raise ParameterError(
                ParameterErrorNumber.IMPERMISSIBLE_PNU, detail=f"{self.name} has no parameter {wanted[:60]!r}{hint}"
            )
        return self.parameters[pnu], subindex

    def writable(self, text: str | int) -> bool:
        """Whether the parameter of :meth:`resolve` can be written, by this number or under this name."""
        wanted = str(text).strip().upper()
        name, _, index = wanted.rpartition(".")
        read_only = wanted in self.read_only_names or (_is_number(index) and name in self.read_only_names)
        return not read_only and self.resolve(text)[0].writable

    def canonical(self, parameter: Parameter) -> Parameter:
        """The parameter that an alias stands for, or itself."""
        return self.parameters[parameter.index] if parameter.backing is Backing.ALIAS else parameter

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

    @property
    def fault_actions(self) -> Mapping[int, int]:
        """The parameters that enable a fault: PNU -> the fault's number."""
        return {fault.action: fault.number for fault in self.faults.values() if fault.action}

    # set-up

    def apply_motor(self, axis: Any) -> None:
        """Write motor and hardware of this model into an axis record (fields of writer ``station``)."""
        for column, value in self.motor.items():
            AXIS.write(axis, column, value)
        for fault in self.faults.values():
            if fault.number < FAULT_WORDS:
                axis.profidrive.settings.fault_words[fault.number] = fault.word
                axis.profidrive.settings.namur_bits[fault.number] = 1 << fault.namur if fault.namur else 0
            if fault.cause in SWITCH_CAUSES:
                axis.warnings.settings.switch[SWITCH_CAUSES.index(fault.cause)] = fault.number
            if fault.cause in MESSAGE_CAUSES:
                axis.warnings.settings.thermal[MESSAGE_CAUSES.index(fault.cause)] = fault.number


def _code_in(name: str) -> str:
    """The maker's own code that a fault's name begins with, such as ``al.fb1``; empty for none."""
    first = name.split(" ", 1)[0].lower()
    return first if "." in first else ""
