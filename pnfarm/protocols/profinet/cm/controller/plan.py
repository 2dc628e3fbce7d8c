"""A controller's plan for an AR.

An :class:`ArPlan` holds everything for the Connect request and the start-up after it; it is plain data,
without wire format.  :mod:`frames` decides where all data lie in the frames.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from pnfarm.protocols.profinet.wire.cm.connect import (
    STARTUP_ADVANCED,
    STARTUP_LEGACY,
    AlarmCrBlockReq,
    ArProperties,
    ArType,
)
from pnfarm.protocols.profinet.wire.cm.expected import SubmoduleProperties, SubmoduleType
from pnfarm.protocols.profinet.wire.cm.iocr import RtClass
from pnfarm.protocols.profinet.wire.rpc.pdu import object_uuid

if TYPE_CHECKING:
    from collections.abc import Iterable
    from uuid import UUID

    from pnfarm.protocols.profinet.wire.alarms.texts import DiagnosisTexts

__all__ = ["APPLICATION_READY_NS", "MAX_SLOT", "ArPlan", "Clock", "ParameterRecord", "PlannedSubmodule", "ordered"]

#: SendClockFactor and ReductionRatio.
Clock = tuple[int, int]

MAX_SLOT = 0x7FFF


@dataclass(frozen=True, slots=True)
class PlannedSubmodule:
    """One submodule that the controller expects, with the module it sits in.

    ``properties`` adds bits to SubmoduleProperties; bits 0 and 1 follow from the lengths (octets).  ``clock`` is that
    of the CRs with its data, None: the AR's.
    """

    api: int
    slot: int
    module_ident: int
    subslot: int
    submodule_ident: int
    input_bytes: int = 0
    output_bytes: int = 0
    properties: int = 0
    clock: Clock | None = None

    @property
    def wire_properties(self) -> int:
        """SubmoduleProperties as they go into the ExpectedSubmoduleBlockReq."""
        has_input = SubmoduleType.INPUT if self.input_bytes else SubmoduleType.NO_IO
        has_output = SubmoduleType.OUTPUT if self.output_bytes else SubmoduleType.NO_IO
        return self.properties | has_input | has_output

    @property
    def provides_input(self) -> bool:
        """It has a place among the data of the input frame: it has inputs, or no data at all."""
        return bool(self.input_bytes) or not self.output_bytes

    @property
    def discards_ioxs(self) -> bool:
        """It has no status octets."""
        return bool(self.properties & SubmoduleProperties.DISCARD_IOXS)

    @property
    def where(self) -> str:
        return f"slot {self.slot} subslot 0x{self.subslot:04X}"


@dataclass(frozen=True, slots=True)
class ParameterRecord:
    """A record written before PrmEnd."""

    api: int
    slot: int
    subslot: int
    index: int
    data: bytes


APPLICATION_READY_NS = 20_000_000_000
_ALARM_CR = AlarmCrBlockReq(local_alarm_reference=1)


@dataclass(frozen=True, slots=True)
class ArPlan:
    """One application relation as its initiator requests it.

    Factors are in the standard's units: ``send_clock_factor`` in 31.25 us, ``activity_timeout_factor`` in 100 ms.
    ``watchdog_factor`` is also the data hold factor, as the standard requires if a device knows only one of them.  The
    defaults are those of the captured controllers.
    """

    # Identity
    vendor_id: int
    device_id: int
    instance: int
    controller_name: str
    controller_mac: bytes
    controller_object_uuid: UUID
    ar_uuid: UUID
    session_key: int
    submodules: tuple[PlannedSubmodule, ...]
    # Start-up
    ar_type: int = ArType.IOCAR_SINGLE
    #: A supervisor may take submodules over; the AR continues with the others until it gives them back.
    takeover_allowed: bool = False
    #: Records alone: an AR without cyclic data, alarms and submodules of its own (a supervisor's, ``ArType.IOSAR``).
    device_access: bool = False
    startup: Literal["legacy", "advanced"] = "legacy"
    activity_timeout_factor: int = 600
    #: Longest time from the end of parametrisation to ApplicationReady; a GSDML file may name another.
    application_ready_ns: int = APPLICATION_READY_NS
    records: tuple[ParameterRecord, ...] = ()
    multiple_write: bool = False
    #: Octets of one MultipleWrite's record; what does not fit goes into a further one.
    multiple_write_octets: int = 1200
    # Cyclic data
    send_clock_factor: int = 32
    reduction_ratio: int = 1
    phase: int = 1
    watchdog_factor: int = 3
    rt_class: int = RtClass.CLASS_2
    input_frame_id: int = 0x8000
    #: The most CRs of each direction; the frame ids of further ones follow that of the first.
    input_crs: int = 1
    output_crs: int = 1
    alarm_cr: AlarmCrBlockReq = _ALARM_CR
    #: The device's own texts for its diagnoses, if its description is available.
    texts: DiagnosisTexts | None = None

    @property
    def sorted_submodules(self) -> tuple[PlannedSubmodule, ...]:
        """In the order in which requests and frames have them: by API, slot and subslot."""
        return ordered(self.submodules)

    @property
    def ar_properties(self) -> int:
        """ARProperties: State = Active, ParametrizationServer = CM initiator, and what the plan adds to them."""
        properties = STARTUP_ADVANCED if self.startup == "advanced" else STARTUP_LEGACY
        if self.takeover_allowed:
            properties |= ArProperties.SUPERVISOR_TAKEOVER_ALLOWED
        if self.device_access:
            properties |= ArProperties.DEVICE_ACCESS
        return properties

    @property
    def device_object_uuid(self) -> UUID:
        """Object UUID that every call to the device carries."""
        return object_uuid(self.instance, self.device_id, self.vendor_id)


def ordered(submodules: Iterable[PlannedSubmodule]) -> tuple[PlannedSubmodule, ...]:
    return tuple(sorted(submodules, key=lambda s: (s.api, s.slot, s.subslot)))
