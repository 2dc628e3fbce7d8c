"""CheckAPDU: whether this device can accept a Connect request (IEC 61158-6-10, CMDEV and the tables of
permitted values of ARBlockReq, IOCRBlockReq, ExpectedSubmoduleBlockReq, AlarmCRBlockReq, ARRPCBlockReq.)

Each check names the faulty field by ErrorCode1 (the block) and ErrorCode2 (the field).  What this device does not do
is refused where the standard allows it: multicast CRs, RT class 3 and RT over UDP, companion ARs, external parameter
servers, reduced lengths.

Some values that captured controllers send are accepted as real devices do, though the standard's tables allow refusing
them: a VLAN id in the tag headers (the frames then carry it), an expected submodule that is in no IOCR, a
WatchdogFactor of any value (of older editions; only DataHoldFactor applies), a frame id for the output CR outside
of its RT class (the device chooses one).
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, NoReturn

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.cm.ar import LayoutError, compute_layouts, expected_submodules
from pnfarm.protocols.profinet.description import MAX_REDUCTION
from pnfarm.protocols.profinet.errors import (
    AlarmCrField,
    ArField,
    ArRpcField,
    CmrpcError,
    ConnectFault,
    ErrorCode,
    ExpectedField,
    IocrField,
    pnio_error,
)
from pnfarm.protocols.profinet.wire.any_block import parse_block
from pnfarm.protocols.profinet.wire.block import VERSION_1_0, BlockType, split_blocks
from pnfarm.protocols.profinet.wire.cm.connect import (
    CM_INITIATOR_OBJECT_UUID_PREFIX,
    AlarmCrBlockReq,
    ArBlockReq,
    ArProperties,
    ArRpcBlockReq,
    ArType,
    ArVendorBlockReq,
)
from pnfarm.protocols.profinet.wire.cm.expected import (
    DataDirection,
    ExpectedSubmoduleBlockReq,
    SubmoduleProperties,
    SubmoduleType,
)
from pnfarm.protocols.profinet.wire.cm.iocr import (
    ETHERTYPE_PROFINET,
    FRAME_SEND_OFFSET_ANY,
    MAX_C_SDU,
    MIN_C_SDU,
    IocrBlockReq,
    IocrType,
    RtClass,
)
from pnfarm.protocols.profinet.wire.frame_id import RT_UDP_UNICAST, RTC1_UNICAST
from pnfarm.protocols.profinet.wire.records.iod import NIL_UUID
from pnfarm.wire.rtc import SEND_CLOCK_FACTORS, SEND_CLOCK_NS

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.protocols.profinet.cm.ar import IocrLayout
    from pnfarm.protocols.profinet.description import DeviceDescription, ModuleDescription
    from pnfarm.protocols.profinet.wire.block import RawBlock
    from pnfarm.protocols.profinet.wire.cm.expected import ExpectedApi, ExpectedSubmodule
    from pnfarm.protocols.profinet.wire.rpc.pdu import PnioStatus

__all__ = ["FRAME_ID_RANGES", "ConnectRequest", "RefusedError", "check_connect", "check_plugged", "parse_connect"]

#: Unicast frame ids by RT class (IEC 61158-6-10, FrameID).
FRAME_ID_RANGES: dict[int, range] = {RtClass.CLASS_1: RT_UDP_UNICAST, RtClass.CLASS_2: RTC1_UNICAST}

#: DataHoldFactor, greatest value.
_MAX_FACTOR = 0x1E00
#: The data hold time of RT class 1 and 2 is at most 1.92 s.
_MAX_HOLD_NS = 1_920_000_000
_MAX_FRAME_SEND_OFFSET = 0x003D0900
#: IOCRProperties: bits 4 to 10 and 24 to 31 are reserved.  Those between are ignored: bit 11 was about media
#: redundancy in older editions, and the standard lets the rest be anything.
_IOCR_RESERVED = 0xFF00_07F0
_MAX_NAME = 240
#: Why RT class 3 is refused, and what helps.  Its frames pass a port only while both ends of the cable run synchronised
#: (RTC3PSM, RTClass3_PortStatus in LLDP), so that none of them would come from a controller.
_IRT = "the frames of IRT need ports that are synchronised in hardware; choose RT for this device in the project"

#: ErrorCode1 by the type of a block that does not parse or is of another version.
_FAULTS: dict[int, ConnectFault] = {
    BlockType.AR_REQ: ConnectFault.AR_BLOCK,
    BlockType.IOCR_REQ: ConnectFault.IOCR_BLOCK,
    BlockType.EXPECTED_SUBMODULE_REQ: ConnectFault.EXPECTED_SUBMODULE_BLOCK,
    BlockType.ALARM_CR_REQ: ConnectFault.ALARM_CR_BLOCK,
    BlockType.AR_RPC_REQ: ConnectFault.AR_RPC_BLOCK,
    BlockType.AR_VENDOR_REQ: ConnectFault.AR_VENDOR_BLOCK,
}


class RefusedError(DecodeError):
    """A call that is answered with ``status``."""

    def __init__(self, status: PnioStatus, detail: str) -> None:
        super().__init__("refused", detail)
        self.status = status


def _refuse(code1: int, code2: int, detail: str) -> NoReturn:
    raise RefusedError(pnio_error(ErrorCode.CONNECT, code1, code2), detail)


@dataclass(slots=True)
class ConnectRequest:
    """The blocks of one Connect request, by kind."""

    ar: ArBlockReq
    iocrs: list[IocrBlockReq]
    expected: list[ExpectedApi]
    alarm_crs: list[AlarmCrBlockReq]
    rpc: ArRpcBlockReq | None
    vendor: list[ArVendorBlockReq]
    #: ARFSUDataAdjust of an ARFSUBlock: the block after its two octets of padding.
    fsu_adjust: bytes = b""


def _version_check(raw: RawBlock, fault: int) -> None:
    if raw.version_high != VERSION_1_0 >> 8:
        _refuse(fault, ArField.BLOCK_VERSION_HIGH, f"block 0x{raw.block_type:04X} of version {raw.version_high}.x")
    if raw.version != VERSION_1_0:
        _refuse(fault, ArField.BLOCK_VERSION_LOW, f"block 0x{raw.block_type:04X} of version 1.{raw.version_low}")


def _typed(raw: RawBlock) -> object:
    fault = _FAULTS.get(raw.block_type)
    if fault is None:
        _refuse(ConnectFault.CMRPC, CmrpcError.UNKNOWN_BLOCKS, f"block 0x{raw.block_type:04X} is not part of a Connect")
    _version_check(raw, fault)
    try:
        return parse_block(raw)
    except DecodeError as exc:
        _refuse(fault, ArField.BLOCK_LENGTH, f"block 0x{raw.block_type:04X}: {exc}")


def parse_connect(
    payload: bytes, description: DeviceDescription, judge: Callable[[ArBlockReq], object] | None = None
) -> ConnectRequest:
    """Raises :class:`RefusedError` when the blocks cannot be read, or are others than a Connect's.

    The AR itself is checked here, before the other blocks: an AR type that the device does not have may bring
    blocks that it does not know.  Then ``judge`` may refuse the AR, which saves the work of parsing the rest.
    """
    try:
        raws = split_blocks(payload)
    except DecodeError as exc:
        _refuse(ConnectFault.CMRPC, CmrpcError.ARGS_LENGTH_INVALID, str(exc))
    if not raws or raws[0].block_type != BlockType.AR_REQ:
        _refuse(ConnectFault.AR_BLOCK, ArField.BLOCK_TYPE, "ARBlockReq must come first")
    first = _typed(raws[0])
    assert isinstance(first, ArBlockReq)
    _check_ar(first, description)
    if judge is not None:
        judge(first)
    request = ConnectRequest(first, [], [], [], None, [])
    for raw in raws[1:]:
        if raw.block_type == BlockType.AR_FSU_REQ:
            # it requests nothing of the device
            request.fsu_adjust = raw.body[2:]
            continue
        match _typed(raw):
            case IocrBlockReq() as iocr:
                request.iocrs.append(iocr)
            case ExpectedSubmoduleBlockReq() as block:
                if not block.apis:
                    _refuse(ConnectFault.EXPECTED_SUBMODULE_BLOCK, ExpectedField.NUMBER_OF_APIS, "NumberOfAPIs is 0")
                request.expected.extend(block.apis)
            case AlarmCrBlockReq() as alarm:
                request.alarm_crs.append(alarm)
            case ArRpcBlockReq() as rpc:
                request.rpc = rpc
            case ArVendorBlockReq() as vendor:
                request.vendor.append(vendor)
            case _:
                _refuse(ConnectFault.AR_BLOCK, ArField.BLOCK_TYPE, "a second ARBlockReq")
    return request


def _check_ar(ar: ArBlockReq, description: DeviceDescription) -> None:
    def refuse(field: ArField, detail: str) -> NoReturn:
        _refuse(ConnectFault.AR_BLOCK, field, detail)

    p = ar.properties
    if ar.ar_type not in {ArType.IOCAR_SINGLE, ArType.IOSAR}:
        why = f": {_IRT}" if ar.ar_type == ArType.IOCAR_SINGLE_RT_CLASS_3 else ""
        refuse(ArField.AR_TYPE, f"ARType 0x{ar.ar_type:04X} is not supported{why}")
    if ar.supervisor and not description.limits.max_supervisor_ars:
        refuse(ArField.AR_TYPE, "a supervisor's AR is supported for device access only")
    if ar.ar_uuid == NIL_UUID:
        refuse(ArField.AR_UUID, "ARUUID is nil")
    if ar.initiator_mac[0] & 1 or not any(ar.initiator_mac):
        refuse(ArField.CM_INITIATOR_MAC, "CMInitiatorMacAdd is not a unicast address")
    if not ar.initiator_object_uuid.bytes.startswith(CM_INITIATOR_OBJECT_UUID_PREFIX):
        refuse(
            ArField.CM_INITIATOR_OBJECT_UUID,
            f"CMInitiatorObjectUUID {ar.initiator_object_uuid} is not PROFINET's",
        )
    if p & ArProperties.STATE_MASK != ArProperties.STATE_ACTIVE:
        refuse(ArField.AR_PROPERTIES, "ARProperties.State is not Active")
    if not p & ArProperties.PARAMETRIZATION_BY_INITIATOR:
        refuse(ArField.AR_PROPERTIES, "an external parameter server is not supported")
    if ar.device_access and ar.ar_type != ArType.IOSAR:
        refuse(ArField.AR_PROPERTIES, "device access belongs to a supervisor's AR")
    if p & (ArProperties.COMPANION_AR_MASK | ArProperties.ACKNOWLEDGE_COMPANION_AR):
        refuse(ArField.AR_PROPERTIES, "companion ARs are not supported")
    if not 1 <= ar.activity_timeout_factor <= 1000:
        refuse(ArField.ACTIVITY_TIMEOUT_FACTOR, f"CMInitiatorActivityTimeoutFactor {ar.activity_timeout_factor}")
    if not 1 <= len(ar.station_name) <= _MAX_NAME:
        refuse(ArField.STATION_NAME_LENGTH, f"StationNameLength {len(ar.station_name)}")
    if any(not 0x20 <= octet <= 0x7E for octet in ar.station_name):
        refuse(ArField.STATION_NAME, "CMInitiatorStationName holds octets that cannot be read")


def _check_iocr(iocr: IocrBlockReq, description: DeviceDescription, *, advanced: bool) -> None:
    def refuse(field: IocrField, detail: str) -> NoReturn:
        _refuse(ConnectFault.IOCR_BLOCK, field, f"IOCR {iocr.iocr_reference}: {detail}")

    if iocr.iocr_type not in {IocrType.INPUT, IocrType.OUTPUT}:
        refuse(IocrField.IOCR_TYPE, f"IOCRType {iocr.iocr_type} is not supported")
    if iocr.lt != ETHERTYPE_PROFINET:
        refuse(IocrField.LT, f"LT 0x{iocr.lt:04X}")
    # advanced start-up no longer has the legacy class 1
    classes = {RtClass.CLASS_2} if advanced else {RtClass.CLASS_1, RtClass.CLASS_2}
    if iocr.rt_class not in classes:
        why = f": {_IRT}" if iocr.rt_class == RtClass.CLASS_3 else ""
        refuse(IocrField.IOCR_PROPERTIES, f"RT class {iocr.rt_class} is not supported{why}")
    if iocr.properties & _IOCR_RESERVED:
        refuse(IocrField.IOCR_PROPERTIES, f"IOCRProperties 0x{iocr.properties:08X} has reserved bits")
    if not MIN_C_SDU <= iocr.data_length <= MAX_C_SDU:
        refuse(IocrField.DATA_LENGTH, f"DataLength {iocr.data_length} is not within {MIN_C_SDU} to {MAX_C_SDU}")
    if iocr.iocr_type == IocrType.INPUT and iocr.frame_id not in FRAME_ID_RANGES[iocr.rt_class]:
        refuse(IocrField.FRAME_ID, f"FrameID 0x{iocr.frame_id:04X} is not of RT class {iocr.rt_class}")
    _check_timing(iocr, description)
    if iocr.tag_header >> 13 != 6:
        refuse(IocrField.IOCR_TAG_HEADER, f"IOCRTagHeader 0x{iocr.tag_header:04X}")
    if not iocr.apis:
        refuse(IocrField.NUMBER_OF_APIS, "NumberOfAPIs is 0")


def _check_timing(iocr: IocrBlockReq, description: DeviceDescription) -> None:
    def refuse(field: IocrField, detail: str) -> NoReturn:
        _refuse(ConnectFault.IOCR_BLOCK, field, f"IOCR {iocr.iocr_reference}: {detail}")

    clock, ratio = iocr.send_clock_factor, iocr.reduction_ratio
    cycle_ns = clock * ratio * SEND_CLOCK_NS
    if clock not in SEND_CLOCK_FACTORS or clock not in description.send_clocks:
        refuse(IocrField.SEND_CLOCK_FACTOR, f"SendClockFactor {clock} is not supported")
    if (
        not 1 <= ratio <= MAX_REDUCTION
        or ratio not in description.reduction_ratios
        or (ratio >= MAX_REDUCTION // 2 and clock > 64)
        or (ratio == MAX_REDUCTION and clock > 32)
    ):
        refuse(IocrField.REDUCTION_RATIO, f"ReductionRatio {ratio} at SendClockFactor {clock}")
    if cycle_ns < description.min_cycle_ns:
        refuse(
            IocrField.REDUCTION_RATIO,
            f"a cycle of {cycle_ns / 1e6:g} ms is shorter than the device's {description.min_cycle_ns / 1e6:g} ms",
        )
    if 0 < description.max_cycle_ns < cycle_ns:
        refuse(
            IocrField.REDUCTION_RATIO,
            f"a cycle of {cycle_ns / 1e6:g} ms is longer than the device's {description.max_cycle_ns / 1e6:g} ms",
        )
    if not 1 <= iocr.phase <= ratio:
        refuse(IocrField.PHASE, f"Phase {iocr.phase} at ReductionRatio {ratio}")
    if iocr.frame_send_offset != FRAME_SEND_OFFSET_ANY and (
        iocr.frame_send_offset >= clock * SEND_CLOCK_NS or iocr.frame_send_offset >= _MAX_FRAME_SEND_OFFSET
    ):
        refuse(IocrField.FRAME_SEND_OFFSET, f"FrameSendOffset {iocr.frame_send_offset} ns")
    if not 1 <= iocr.data_hold_factor <= _MAX_FACTOR or cycle_ns * iocr.data_hold_factor > _MAX_HOLD_NS:
        refuse(
            IocrField.DATA_HOLD_FACTOR, f"DataHoldFactor {iocr.data_hold_factor} at a cycle of {cycle_ns / 1e6:g} ms"
        )


#: The directions that a submodule's data descriptions must have, by its type.
_DIRECTIONS = {
    SubmoduleType.NO_IO: [DataDirection.INPUT],
    SubmoduleType.INPUT: [DataDirection.INPUT],
    SubmoduleType.OUTPUT: [DataDirection.OUTPUT],
    SubmoduleType.INPUT_OUTPUT: [DataDirection.INPUT, DataDirection.OUTPUT],
}


def _check_submodule(api: int, sub: ExpectedSubmodule) -> None:
    def refuse(field: ExpectedField, detail: str) -> NoReturn:
        _refuse(ConnectFault.EXPECTED_SUBMODULE_BLOCK, field, f"subslot 0x{sub.subslot:04X}: {detail}")

    kind = SubmoduleType(sub.type)
    if sub.subslot > 0x9FFF:
        refuse(ExpectedField.SUBSLOT, "SubslotNumber is out of range")
    if sub.subslot >= 0x8000 and api:
        refuse(ExpectedField.SUBSLOT, f"interface and port submodules belong to API 0, not 0x{api:X}")
    if kind == SubmoduleType.OUTPUT and sub.properties & SubmoduleProperties.SHARED_INPUT:
        refuse(ExpectedField.SUBMODULE_PROPERTIES, "shared input without inputs")
    if sub.properties & SubmoduleProperties.REDUCE_INPUT_LENGTH and kind & SubmoduleType.INPUT:
        refuse(ExpectedField.SUBMODULE_PROPERTIES, "reduced input length is not supported")
    if sub.properties & SubmoduleProperties.REDUCE_OUTPUT_LENGTH and kind & SubmoduleType.OUTPUT:
        refuse(ExpectedField.SUBMODULE_PROPERTIES, "reduced output length is not supported")
    if sorted(d.direction for d in sub.data) != _DIRECTIONS[kind]:
        refuse(ExpectedField.DATA_DESCRIPTION, "DataDescription does not fit the submodule's type")
    for data in sub.data:
        if data.data_length > MAX_C_SDU - 1 or (kind == SubmoduleType.NO_IO and data.data_length):
            refuse(ExpectedField.SUBMODULE_DATA_LENGTH, f"SubmoduleDataLength {data.data_length}")
        if sub.discards_ioxs:
            # the frames have no status octets: their lengths mean nothing
            continue
        if data.iops_length != 1:
            refuse(ExpectedField.LENGTH_IOPS, f"LengthIOPS {data.iops_length}")
        if data.iocs_length != 1:
            refuse(ExpectedField.LENGTH_IOCS, f"LengthIOCS {data.iocs_length}")


def _check_expected(request: ConnectRequest) -> None:
    def refuse(field: ExpectedField, detail: str) -> NoReturn:
        _refuse(ConnectFault.EXPECTED_SUBMODULE_BLOCK, field, detail)

    if not request.expected:
        refuse(ExpectedField.NUMBER_OF_APIS, "no module is expected")
    for (api, slot), count in Counter((e.api, e.slot) for e in request.expected).items():
        if count > 1:
            refuse(ExpectedField.SLOT, f"slot {slot} is twice in API 0x{api:X}")
    for entry in request.expected:
        if entry.slot > 0x7FFF:
            refuse(ExpectedField.SLOT, f"SlotNumber 0x{entry.slot:04X} is out of range")
        if not entry.module_ident:
            refuse(ExpectedField.MODULE_IDENT, f"slot {entry.slot}: ModuleIdentNumber is 0")
        if not entry.submodules:
            refuse(ExpectedField.NUMBER_OF_SUBMODULES, f"slot {entry.slot}: NumberOfSubmodules is 0")
        for subslot, count in Counter(s.subslot for s in entry.submodules).items():
            if count > 1:
                refuse(ExpectedField.SUBSLOT, f"slot {entry.slot}: subslot 0x{subslot:04X} appears twice")
        for sub in entry.submodules:
            _check_submodule(entry.api, sub)


def check_plugged(request: ConnectRequest, modules: Mapping[int, ModuleDescription | None]) -> None:
    """Submodules with the right idents must have the expected lengths; idents themselves may differ.

    ``modules`` will be in the slots.
    """
    for entry in request.expected:
        module = modules.get(entry.slot)
        if module is None or module.module_ident != entry.module_ident:
            continue
        for sub in entry.submodules:
            real = module.submodule(sub.subslot)
            if real is None or real.api != entry.api or real.submodule_ident != sub.submodule_ident:
                continue
            lengths = sub.length(DataDirection.INPUT), sub.length(DataDirection.OUTPUT)
            if lengths != (real.input_bytes, real.output_bytes):
                _refuse(
                    ConnectFault.EXPECTED_SUBMODULE_BLOCK,
                    ExpectedField.SUBMODULE_DATA_LENGTH,
                    f"slot {entry.slot} subslot 0x{sub.subslot:04X}: {lengths[0]} octets in and {lengths[1]} out are "
                    f"expected, the submodule has {real.input_bytes} and {real.output_bytes}",
                )


def _check_alarm_cr(alarm: AlarmCrBlockReq) -> None:
    def refuse(field: AlarmCrField, detail: str) -> NoReturn:
        _refuse(ConnectFault.ALARM_CR_BLOCK, field, detail)

    if alarm.alarm_cr_type != 1:
        refuse(AlarmCrField.ALARM_CR_TYPE, f"AlarmCRType {alarm.alarm_cr_type}")
    if alarm.lt != ETHERTYPE_PROFINET:
        refuse(AlarmCrField.LT, f"LT 0x{alarm.lt:04X}")
    if alarm.properties & 0x02:
        refuse(AlarmCrField.ALARM_CR_PROPERTIES, "alarms over UDP are not supported")
    if not 1 <= alarm.rta_timeout_factor <= 100:
        refuse(AlarmCrField.RTA_TIMEOUT_FACTOR, f"RTATimeoutFactor {alarm.rta_timeout_factor}")
    if not 3 <= alarm.rta_retries <= 15:
        refuse(AlarmCrField.RTA_RETRIES, f"RTARetries {alarm.rta_retries}")
    if not 200 <= alarm.max_alarm_data_length <= 1432:
        refuse(AlarmCrField.MAX_ALARM_DATA_LENGTH, f"MaxAlarmDataLength {alarm.max_alarm_data_length}")
    if alarm.tag_header_high >> 13 != 6:
        refuse(AlarmCrField.TAG_HEADER_HIGH, f"AlarmCRTagHeaderHigh 0x{alarm.tag_header_high:04X}")
    if alarm.tag_header_low >> 13 != 5:
        refuse(AlarmCrField.TAG_HEADER_LOW, f"AlarmCRTagHeaderLow 0x{alarm.tag_header_low:04X}")


def _check_crs(request: ConnectRequest, description: DeviceDescription) -> tuple[IocrLayout, ...]:
    advanced = bool(request.ar.properties & ArProperties.STARTUP_MODE_ADVANCED)
    # before they are counted: a CR given twice is not a lack of resources
    for reference, count in Counter(iocr.iocr_reference for iocr in request.iocrs).items():
        if count > 1:
            _refuse(ConnectFault.IOCR_BLOCK, IocrField.IOCR_REFERENCE, f"IOCRReference {reference} twice")
    most = {IocrType.INPUT: description.limits.max_input_crs, IocrType.OUTPUT: description.limits.max_output_crs}
    _check_number("IOCRs", len(request.iocrs), sum(most.values()))
    frame_ids: set[int] = set()
    for iocr in request.iocrs:
        _check_iocr(iocr, description, advanced=advanced)
        if iocr.iocr_type == IocrType.INPUT and iocr.frame_id in frame_ids:
            _refuse(ConnectFault.IOCR_BLOCK, IocrField.FRAME_ID, f"FrameID 0x{iocr.frame_id:04X} twice")
        if iocr.iocr_type == IocrType.INPUT:
            frame_ids.add(iocr.frame_id)
    if {iocr.iocr_type for iocr in request.iocrs} != {IocrType.INPUT, IocrType.OUTPUT}:
        _refuse(ConnectFault.CMRPC, CmrpcError.IOCR_MISSING, "an input and an output CR are needed")
    for kind, limit in most.items():
        _check_number(f"{kind.name.lower()} CRs", sum(iocr.iocr_type == kind for iocr in request.iocrs), limit)
    _check_expected(request)
    expected = expected_submodules(request.expected)
    try:
        return compute_layouts(request.iocrs, expected)
    except LayoutError as exc:
        _refuse(ConnectFault.IOCR_BLOCK, exc.field, exc.detail)


def _check_number(what: str, count: int, most: int) -> None:
    if count > most:
        detail = f"{count} {what}, {most} are the most"
        _refuse(ConnectFault.CMRPC, CmrpcError.OUT_OF_PROVIDER_CONSUMER_ALARM_RESOURCES, detail)


def check_connect(request: ConnectRequest, description: DeviceDescription) -> tuple[IocrLayout, ...]:
    """The layouts of the CRs, frame ids still as requested; empty for an acyclic AR.

    Raises :class:`RefusedError` with the standard's code for the first faulty field, in the standard's order:
    IOCRs and their number, expected submodules, offsets, alarm CR, AR RPC.
    """
    if request.ar.device_access:
        if request.iocrs or request.expected or request.alarm_crs:
            _refuse(ConnectFault.CMRPC, CmrpcError.UNKNOWN_BLOCKS, "device access has no CR")
        layouts: tuple[IocrLayout, ...] = ()
    else:
        layouts = _check_crs(request, description)
        if len(request.alarm_crs) != 1:
            _refuse(
                ConnectFault.CMRPC, CmrpcError.WRONG_ALARM_CR_BLOCK_COUNT, f"{len(request.alarm_crs)} AlarmCRBlockReq"
            )
        _check_alarm_cr(request.alarm_crs[0])
    if request.rpc is not None and request.rpc.server_port < 0x0400:
        _refuse(
            ConnectFault.AR_RPC_BLOCK,
            ArRpcField.INITIATOR_RPC_SERVER_PORT,
            f"InitiatorRPCServerPort {request.rpc.server_port}",
        )
    return layouts
