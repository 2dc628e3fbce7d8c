"""IOCRBlockReq and IOCRBlockRes: one cyclic channel and where each datum lies in its frame
(IEC 61158-6-10, IODConnectReq)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from pnfarm.protocols.profinet.wire.block import VERSION_1_0, BlockType, RawBlock, check_type, emit_raw_block
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET
from pnfarm.wire.octets import Reader, Writer

__all__ = [
    "ETHERTYPE_PROFINET",
    "FRAME_ID_ASSIGN",
    "FRAME_SEND_OFFSET_ANY",
    "IOCR_TAG_HEADER",
    "MULTICAST_MAC_NONE",
    "FrameSlot",
    "IocrApi",
    "IocrBlockReq",
    "IocrBlockRes",
    "IocrType",
    "RtClass",
    "emit_iocr_block_req",
    "emit_iocr_block_res",
    "parse_iocr_block_req",
    "parse_iocr_block_res",
]

#: FrameID of an output CR in a request: the device is to choose.
FRAME_ID_ASSIGN = 0xFFFF
#: FrameSendOffset: best effort.
FRAME_SEND_OFFSET_ANY = 0xFFFFFFFF
#: IOCRTagHeader: user priority 6 << 13 | VLAN identifier 0.
IOCR_TAG_HEADER = 0xC000
MULTICAST_MAC_NONE = bytes(6)


class IocrType(IntEnum):
    """Coding of the field IOCRType."""

    INPUT = 1
    OUTPUT = 2
    MULTICAST_PROVIDER = 3
    MULTICAST_CONSUMER = 4


class RtClass(IntEnum):
    """IOCRProperties.RTClass, bits 0 to 3.

    The standard renamed the classes: what legacy start-up calls class 1 (frame ids from 0xC000) and
    class 2 (from 0x8000) are both unsynchronised; advanced start-up allows class 2 and up only.
    """

    CLASS_1 = 1
    CLASS_2 = 2
    CLASS_3 = 3
    UDP = 4


@dataclass(frozen=True, slots=True)
class FrameSlot:
    """An IODataObject or an IOCS: ``frame_offset`` counts octets from the start of the C_SDU."""

    slot: int
    subslot: int
    frame_offset: int


@dataclass(frozen=True, slots=True)
class IocrApi:
    api: int
    data_objects: tuple[FrameSlot, ...] = ()
    iocs: tuple[FrameSlot, ...] = ()


@dataclass(frozen=True, slots=True)
class IocrBlockReq:
    """0x0102.  ``send_clock_factor`` counts 31.25 us; ``data_length`` is the C_SDU's, in octets."""

    iocr_type: int
    iocr_reference: int
    properties: int
    data_length: int
    frame_id: int
    send_clock_factor: int
    reduction_ratio: int
    apis: tuple[IocrApi, ...]
    phase: int = 1
    sequence: int = 0
    frame_send_offset: int = FRAME_SEND_OFFSET_ANY
    watchdog_factor: int = 3
    data_hold_factor: int = 3
    lt: int = ETHERTYPE_PROFINET
    tag_header: int = IOCR_TAG_HEADER
    multicast_mac: bytes = MULTICAST_MAC_NONE
    version: int = VERSION_1_0

    @property
    def rt_class(self) -> int:
        return self.properties & 0x0F


def _read_slots(reader: Reader) -> tuple[FrameSlot, ...]:
    return tuple(FrameSlot(reader.u16(), reader.u16(), reader.u16()) for _ in range(reader.u16()))


def _write_slots(writer: Writer, slots: tuple[FrameSlot, ...]) -> None:
    writer.u16(len(slots))
    for entry in slots:
        writer.u16(entry.slot).u16(entry.subslot).u16(entry.frame_offset)


def parse_iocr_block_req(block: RawBlock) -> IocrBlockReq:
    r = check_type(block, BlockType.IOCR_REQ)
    iocr_type, reference, lt, properties, data_length, frame_id = r.u16(), r.u16(), r.u16(), r.u32(), r.u16(), r.u16()
    send_clock, reduction, phase, sequence = r.u16(), r.u16(), r.u16(), r.u16()
    send_offset, watchdog, data_hold, tag_header = r.u32(), r.u16(), r.u16(), r.u16()
    multicast_mac = r.bytes(6)
    apis = tuple(IocrApi(r.u32(), _read_slots(r), _read_slots(r)) for _ in range(r.u16()))
    r.expect_end()
    return IocrBlockReq(
        iocr_type=iocr_type,
        iocr_reference=reference,
        properties=properties,
        data_length=data_length,
        frame_id=frame_id,
        send_clock_factor=send_clock,
        reduction_ratio=reduction,
        apis=apis,
        phase=phase,
        sequence=sequence,
        frame_send_offset=send_offset,
        watchdog_factor=watchdog,
        data_hold_factor=data_hold,
        lt=lt,
        tag_header=tag_header,
        multicast_mac=multicast_mac,
        version=block.version,
    )


def emit_iocr_block_req(value: IocrBlockReq) -> bytes:
    w = Writer().u16(value.iocr_type).u16(value.iocr_reference).u16(value.lt).u32(value.properties)
    w.u16(value.data_length).u16(value.frame_id).u16(value.send_clock_factor).u16(value.reduction_ratio)
    w.u16(value.phase).u16(value.sequence).u32(value.frame_send_offset).u16(value.watchdog_factor)
    w.u16(value.data_hold_factor).u16(value.tag_header).bytes(value.multicast_mac).u16(len(value.apis))
    for api in value.apis:
        w.u32(api.api)
        _write_slots(w, api.data_objects)
        _write_slots(w, api.iocs)
    return emit_raw_block(RawBlock(BlockType.IOCR_REQ, w.getvalue(), value.version))


@dataclass(frozen=True, slots=True)
class IocrBlockRes:
    """0x8102: the frame id that the CR really has."""

    iocr_type: int
    iocr_reference: int
    frame_id: int
    version: int = VERSION_1_0


def parse_iocr_block_res(block: RawBlock) -> IocrBlockRes:
    r = check_type(block, BlockType.IOCR_RES)
    value = IocrBlockRes(r.u16(), r.u16(), r.u16(), block.version)
    r.expect_end()
    return value


def emit_iocr_block_res(value: IocrBlockRes) -> bytes:
    w = Writer().u16(value.iocr_type).u16(value.iocr_reference).u16(value.frame_id)
    return emit_raw_block(RawBlock(BlockType.IOCR_RES, w.getvalue(), value.version))
