"""The application relation and the layout of its frames; shared by the device's and the controller's machine.

:func:`compute_layout` turns an IOCRBlockReq and the expected submodules into an :class:`IocrLayout`: the positions
for filling or reading a frame.  The offsets are the controller's and are honoured as given; they are
checked against the frame's length and against each other.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.errors import IocrField
from pnfarm.protocols.profinet.wire.cm.connect import ArProperties
from pnfarm.protocols.profinet.wire.cm.expected import DataDirection, SubmoduleType
from pnfarm.protocols.profinet.wire.cm.iocr import IOCR_TAG_HEADER, IocrType
from pnfarm.wire.rtc import SEND_CLOCK_NS
from pnfarm.wire.value import value_class

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from ipaddress import IPv4Address
    from uuid import UUID

    from pnfarm.protocols.profinet.wire.cm.connect import AlarmCrBlockReq, ArBlockReq
    from pnfarm.protocols.profinet.wire.cm.expected import (
        ArInfo,
        ExpectedApi,
        ExpectedSubmodule,
        ModuleDiffBlock,
    )
    from pnfarm.protocols.profinet.wire.cm.iocr import IocrBlockReq

__all__ = [
    "Ar",
    "CmdevState",
    "DataPlace",
    "ExpectedKey",
    "IocrLayout",
    "IocsPlace",
    "LayoutError",
    "compute_layout",
    "compute_layouts",
    "expected_submodules",
]

#: (api, slot, subslot).
ExpectedKey = tuple[int, int, int]


class CmdevState(StrEnum):
    """States of CMDEV (IEC 61158-6-10, CMDEV protocol machine)."""

    W_CIND = "W_CIND"
    W_CRES = "W_CRES"
    W_SUCNF = "W_SUCNF"
    W_PEIND = "W_PEIND"
    W_PERES = "W_PERES"
    W_ARDY = "W_ARDY"
    W_ARDYCNF = "W_ARDYCNF"
    WDATA = "WDATA"
    DATA = "DATA"
    ABORT = "ABORT"


class LayoutError(DecodeError):
    """An impossible frame layout; ``field`` is the faulty field of the IOCRBlockReq."""

    def __init__(self, fault: IocrField, detail: str) -> None:
        super().__init__("bad-layout", detail)
        self.field = fault


@value_class
class DataPlace:
    """Data of one submodule in the C_SDU: octets from its start.

    The IOPS octet follows the data; None for a submodule whose status octets are discarded.
    """

    api: int
    slot: int
    subslot: int
    data_offset: int
    data_length: int
    iops_offset: int | None


@value_class
class IocsPlace:
    """Consumer status octet of one submodule in the C_SDU; None for one whose status octets are discarded."""

    api: int
    slot: int
    subslot: int
    iocs_offset: int | None


@value_class
class IocrLayout:
    """One cyclic channel.

    ``data_length`` is that of the C_SDU, in octets: between the frame id and the cycle counter.
    ``frame_send_offset`` is in nanoseconds, 0xFFFFFFFF for "any".  ``tag_header`` is the VLAN tag of its frames:
    priority << 13 | VLAN id.
    """

    iocr_type: int
    iocr_reference: int
    frame_id: int
    data_length: int
    send_clock_factor: int
    reduction_ratio: int
    phase: int
    frame_send_offset: int
    watchdog_factor: int
    data_hold_factor: int
    data: tuple[DataPlace, ...]
    iocs: tuple[IocsPlace, ...]
    properties: int
    tag_header: int = IOCR_TAG_HEADER

    @property
    def is_input(self) -> bool:
        """Sent by the device."""
        return self.iocr_type == IocrType.INPUT

    @property
    def cycle_ns(self) -> int:
        """Time between two frames."""
        return SEND_CLOCK_NS * self.send_clock_factor * self.reduction_ratio

    @property
    def data_hold_ns(self) -> int:
        """The consumer's timeout without a valid frame."""
        return self.cycle_ns * self.data_hold_factor

    def data_of(self, slot: int, subslot: int) -> DataPlace | None:
        return next((d for d in self.data if d.slot == slot and d.subslot == subslot), None)


@dataclass(slots=True)
class Ar:
    """One application relation.  ``key`` is this machine's own number for it, never used twice.

    ``source_mac`` is the Ethernet address that its Connect came from, where that is known.

    ``iocrs`` hold the frame ids as agreed.  Alarm references: ``local`` is the device's, ``remote`` the initiator's.
    """

    key: int
    request: ArBlockReq
    peer_ip: IPv4Address
    state: CmdevState
    source_mac: bytes | None = None
    iocrs: tuple[IocrLayout, ...] = ()
    expected: tuple[ExpectedApi, ...] = ()
    alarm_cr: AlarmCrBlockReq | None = None
    local_alarm_reference: int = 0
    module_diff: ModuleDiffBlock | None = None
    #: Expected submodules that this AR owns, and the owners of the others.
    owned: set[ExpectedKey] = field(default_factory=set)
    locked: dict[ExpectedKey, ArInfo] = field(default_factory=dict)
    #: Owned ones that were plugged or released since, and wait for their parameters.
    pending: set[ExpectedKey] = field(default_factory=set)
    #: ARFSUDataAdjust of the Connect request.
    fsu_adjust: bytes = b""
    #: UDP port of the initiator's RPC server, when an ARRPCBlock named one.
    initiator_rpc_port: int | None = None
    #: Output CRs (by IOCRReference) on which valid data have arrived.
    data_seen: set[int] = field(default_factory=set)

    @property
    def uuid(self) -> UUID:
        return self.request.ar_uuid

    @property
    def ar_type(self) -> int:
        return self.request.ar_type

    @property
    def session_key(self) -> int:
        return self.request.session_key

    @property
    def properties(self) -> int:
        return self.request.properties

    @property
    def advanced_startup(self) -> bool:
        return bool(self.request.properties & ArProperties.STARTUP_MODE_ADVANCED)

    @property
    def device_access(self) -> bool:
        return self.request.device_access

    @property
    def supervisor(self) -> bool:
        return self.request.supervisor

    @property
    def takeover_allowed(self) -> bool:
        """The controller allows a supervisor to take its submodules over."""
        return bool(self.request.properties & ArProperties.SUPERVISOR_TAKEOVER_ALLOWED)

    @property
    def initiator_mac(self) -> bytes:
        return self.request.initiator_mac

    @property
    def initiator_name(self) -> str:
        return self.request.station_name.decode("latin-1")

    @property
    def activity_timeout_ns(self) -> int:
        """CMInitiatorActivityTimeoutFactor counts 100 ms."""
        return self.request.activity_timeout_factor * 100_000_000

    @property
    def remote_alarm_reference(self) -> int:
        return self.alarm_cr.local_alarm_reference if self.alarm_cr else 0

    @property
    def output_crs(self) -> tuple[IocrLayout, ...]:
        return tuple(c for c in self.iocrs if not c.is_input)


def expected_submodules(apis: Iterable[ExpectedApi]) -> dict[ExpectedKey, ExpectedSubmodule]:
    """Every expected submodule by its place."""
    return {(a.api, a.slot, s.subslot): s for a in apis for s in a.submodules}


class _Frame:
    """Occupied octets of a C_SDU."""

    def __init__(self, length: int) -> None:
        self._taken = bytearray(length)

    def take(self, offset: int, length: int, fault: IocrField, what: str) -> None:
        if not length:
            # an item of length 0 occupies nothing, whatever its offset
            return
        end = offset + length
        if end > len(self._taken):
            raise LayoutError(fault, f"{what} ends at octet {end} of {len(self._taken)}")
        if any(self._taken[offset:end]):
            raise LayoutError(fault, f"{what} overlaps another datum at octet {offset}")
        self._taken[offset:end] = b"\x01" * length


#: IOCR type -> types of submodules with data in that CR, types with their IOCS in it.
_DATA_TYPES = {
    IocrType.INPUT: (SubmoduleType.NO_IO, SubmoduleType.INPUT, SubmoduleType.INPUT_OUTPUT),
    IocrType.OUTPUT: (SubmoduleType.OUTPUT, SubmoduleType.INPUT_OUTPUT),
}
_IOCS_TYPES = {
    IocrType.INPUT: (SubmoduleType.OUTPUT, SubmoduleType.INPUT_OUTPUT),
    IocrType.OUTPUT: (SubmoduleType.NO_IO, SubmoduleType.INPUT, SubmoduleType.INPUT_OUTPUT),
}


def _find(
    expected: Mapping[ExpectedKey, ExpectedSubmodule],
    key: ExpectedKey,
    types: tuple[SubmoduleType, ...],
    slot_fault: IocrField,
    subslot_fault: IocrField,
) -> ExpectedSubmodule:
    api, slot, subslot = key
    found = expected.get(key)
    if found is None:
        if not any(a == api and s == slot for a, s, _ in expected):
            raise LayoutError(slot_fault, f"slot {slot} is not among the expected ones")
        raise LayoutError(subslot_fault, f"slot {slot} subslot 0x{subslot:04X} is not among the expected ones")
    if found.type not in types:
        raise LayoutError(subslot_fault, f"slot {slot} subslot 0x{subslot:04X} has no data or status in this direction")
    return found


def compute_layout(
    iocr: IocrBlockReq, expected: Mapping[ExpectedKey, ExpectedSubmodule], frame_id: int | None = None
) -> IocrLayout:
    """The layout that ``iocr`` requests; ``frame_id`` replaces the requested one.

    A submodule with DiscardIOXS has no status octets: one without data occupies no octet, and its offsets are
    ignored (captured controllers give 0 for all of them).
    Raises :class:`LayoutError` naming the faulty field: an API, slot or subslot that is not expected, twice there
    or not of this direction, a datum outside of the frame or over another one.
    """
    try:
        kind = IocrType(iocr.iocr_type)
        data_types, iocs_types, direction = _DATA_TYPES[kind], _IOCS_TYPES[kind], DataDirection(kind)
    except (KeyError, ValueError):
        raise LayoutError(IocrField.IOCR_TYPE, f"IOCRType {iocr.iocr_type} is neither input nor output") from None
    apis = {api for api, _, _ in expected}
    frame = _Frame(iocr.data_length)
    data: dict[ExpectedKey, DataPlace] = {}
    iocs: dict[ExpectedKey, IocsPlace] = {}
    for api in iocr.apis:
        if api.api not in apis:
            raise LayoutError(IocrField.API, f"API 0x{api.api:X} is not among the expected ones")
        if not api.data_objects and not api.iocs:
            raise LayoutError(IocrField.NUMBER_OF_IO_DATA_OBJECTS, f"API 0x{api.api:X} lists nothing")
        for entry in api.data_objects:
            key = (api.api, entry.slot, entry.subslot)
            if key in data:
                raise LayoutError(IocrField.DATA_SUBSLOT, f"slot {entry.slot} subslot 0x{entry.subslot:04X} twice")
            sub = _find(expected, key, data_types, IocrField.DATA_SLOT, IocrField.DATA_SUBSLOT)
            length = sub.length(direction)
            status = 0 if sub.discards_ioxs else 1
            frame.take(entry.frame_offset, length + status, IocrField.DATA_FRAME_OFFSET, "IODataObject")
            data[key] = DataPlace(*key, entry.frame_offset, length, entry.frame_offset + length if status else None)
        for entry in api.iocs:
            key = (api.api, entry.slot, entry.subslot)
            if key in iocs:
                raise LayoutError(IocrField.IOCS_SUBSLOT, f"slot {entry.slot} subslot 0x{entry.subslot:04X} twice")
            sub = _find(expected, key, iocs_types, IocrField.IOCS_SLOT, IocrField.IOCS_SUBSLOT)
            if sub.discards_ioxs:
                iocs[key] = IocsPlace(*key, None)
                continue
            frame.take(entry.frame_offset, 1, IocrField.IOCS_FRAME_OFFSET, "IOCS")
            iocs[key] = IocsPlace(*key, entry.frame_offset)
    return IocrLayout(
        iocr_type=iocr.iocr_type,
        iocr_reference=iocr.iocr_reference,
        frame_id=iocr.frame_id if frame_id is None else frame_id,
        data_length=iocr.data_length,
        send_clock_factor=iocr.send_clock_factor,
        reduction_ratio=iocr.reduction_ratio,
        phase=iocr.phase,
        frame_send_offset=iocr.frame_send_offset,
        watchdog_factor=iocr.watchdog_factor,
        data_hold_factor=iocr.data_hold_factor,
        data=tuple(data.values()),
        iocs=tuple(iocs.values()),
        properties=iocr.properties,
        tag_header=iocr.tag_header,
    )


def compute_layouts(
    iocrs: Iterable[IocrBlockReq], expected: Mapping[ExpectedKey, ExpectedSubmodule]
) -> tuple[IocrLayout, ...]:
    """The layouts of all CRs of an AR: each submodule has its data, and its consumer status, in one of a direction.

    Raises :class:`LayoutError` as :func:`compute_layout` does.
    """
    layouts = tuple(compute_layout(iocr, expected) for iocr in iocrs)
    taken: set[tuple[object, ...]] = set()
    for layout in layouts:
        for fault, what, places in (
            (IocrField.DATA_SUBSLOT, "data", layout.data),
            (IocrField.IOCS_SUBSLOT, "IOCS", layout.iocs),
        ):
            for place in places:
                key = (fault, layout.iocr_type, place.api, place.slot, place.subslot)
                if key in taken:
                    where = f"slot {place.slot} subslot 0x{place.subslot:04X}"
                    raise LayoutError(fault, f"{where} has its {what} in two CRs of this direction")
                taken.add(key)
    return layouts
