"""Blocks of the Connect service but for the IOCR and the expected submodules: AR, alarm CR, parameter
server, multicast CR, AR RPC, AR server, AR vendor (IEC 61158-6-10, IODConnectReq and IODConnectRes)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.wire.block import (
    VERSION_1_0,
    BlockType,
    RawBlock,
    check_type,
    emit_raw_block,
    expect_padding,
    read_uuid,
    write_uuid,
)
from pnfarm.wire.octets import Reader, Writer

if TYPE_CHECKING:
    from uuid import UUID

__all__ = [
    "ALARM_TAG_HEADER_HIGH",
    "ALARM_TAG_HEADER_LOW",
    "CM_INITIATOR_OBJECT_UUID_PREFIX",
    "STARTUP_ADVANCED",
    "STARTUP_LEGACY",
    "AlarmCrBlockReq",
    "AlarmCrBlockRes",
    "ArBlockReq",
    "ArBlockRes",
    "ArProperties",
    "ArRpcBlockReq",
    "ArRpcBlockRes",
    "ArServerBlock",
    "ArType",
    "ArVendorBlockReq",
    "ArVendorBlockRes",
    "McrBlockReq",
    "PrmServerBlockReq",
    "PrmServerBlockRes",
    "emit_alarm_cr_block_req",
    "emit_alarm_cr_block_res",
    "emit_ar_block_req",
    "emit_ar_block_res",
    "emit_ar_rpc_block_req",
    "emit_ar_rpc_block_res",
    "emit_ar_server_block",
    "emit_ar_vendor_block_req",
    "emit_ar_vendor_block_res",
    "emit_mcr_block_req",
    "emit_prm_server_block_req",
    "emit_prm_server_block_res",
    "parse_alarm_cr_block_req",
    "parse_alarm_cr_block_res",
    "parse_ar_block_req",
    "parse_ar_block_res",
    "parse_ar_rpc_block_req",
    "parse_ar_rpc_block_res",
    "parse_ar_server_block",
    "parse_ar_vendor_block_req",
    "parse_ar_vendor_block_res",
    "parse_mcr_block_req",
    "parse_prm_server_block_req",
    "parse_prm_server_block_res",
]


class ArType(IntEnum):
    """Coding of the field ARType."""

    IOCAR_SINGLE = 0x0001
    IOSAR = 0x0006
    IOCAR_SINGLE_RT_CLASS_3 = 0x0010
    IOCAR_SR = 0x0020


class ArProperties:
    """Bits of the field ARProperties (u32)."""

    STATE_MASK = 0x00000007
    STATE_ACTIVE = 0x00000001
    SUPERVISOR_TAKEOVER_ALLOWED = 1 << 3
    #: 1: the CM initiator parametrises; 0: an external parameter server does.
    PARAMETRIZATION_BY_INITIATOR = 1 << 4
    DEVICE_ACCESS = 1 << 8
    COMPANION_AR_MASK = 3 << 9
    ACKNOWLEDGE_COMPANION_AR = 1 << 11
    COMBINED_OBJECT_CONTAINER = 1 << 29
    STARTUP_MODE_ADVANCED = 1 << 30
    PULL_MODULE_ALARM_ALLOWED = 1 << 31


#: The two start-ups seen in the captures of real controllers.
STARTUP_LEGACY = 0x00000011
STARTUP_ADVANCED = 0x40000011

#: First ten octets of every CMInitiatorObjectUUID; instance, device and vendor follow.
CM_INITIATOR_OBJECT_UUID_PREFIX = bytes.fromhex("dea000006c9711d18271")

#: AlarmCRTagHeaderHigh / Low: user priority << 13 | VLAN identifier 0.
ALARM_TAG_HEADER_HIGH = 0xC000
ALARM_TAG_HEADER_LOW = 0xA000


def _read_name(reader: Reader) -> bytes:
    return reader.bytes(reader.u16())


@dataclass(frozen=True, slots=True)
class ArBlockReq:
    """0x0101.  ``activity_timeout_factor`` counts 100 ms; ``station_name`` is the controller's, as octets."""

    ar_type: int
    ar_uuid: UUID
    session_key: int
    initiator_mac: bytes
    initiator_object_uuid: UUID
    properties: int
    activity_timeout_factor: int
    udp_rt_port: int
    station_name: bytes
    version: int = VERSION_1_0


def parse_ar_block_req(block: RawBlock) -> ArBlockReq:
    r = check_type(block, BlockType.AR_REQ)
    value = ArBlockReq(
        r.u16(),
        read_uuid(r),
        r.u16(),
        r.bytes(6),
        read_uuid(r),
        r.u32(),
        r.u16(),
        r.u16(),
        _read_name(r),
        block.version,
    )
    r.expect_end()
    return value


def emit_ar_block_req(value: ArBlockReq) -> bytes:
    w = Writer().u16(value.ar_type)
    write_uuid(w, value.ar_uuid).u16(value.session_key).bytes(value.initiator_mac)
    write_uuid(w, value.initiator_object_uuid).u32(value.properties).u16(value.activity_timeout_factor)
    w.u16(value.udp_rt_port).u16(len(value.station_name)).bytes(value.station_name)
    return emit_raw_block(RawBlock(BlockType.AR_REQ, w.getvalue(), value.version))


@dataclass(frozen=True, slots=True)
class ArBlockRes:
    """0x8101."""

    ar_type: int
    ar_uuid: UUID
    session_key: int
    responder_mac: bytes
    udp_rt_port: int = 0x8892
    version: int = VERSION_1_0


def parse_ar_block_res(block: RawBlock) -> ArBlockRes:
    r = check_type(block, BlockType.AR_RES)
    value = ArBlockRes(r.u16(), read_uuid(r), r.u16(), r.bytes(6), r.u16(), block.version)
    r.expect_end()
    return value


def emit_ar_block_res(value: ArBlockRes) -> bytes:
    w = Writer().u16(value.ar_type)
    write_uuid(w, value.ar_uuid).u16(value.session_key).bytes(value.responder_mac).u16(value.udp_rt_port)
    return emit_raw_block(RawBlock(BlockType.AR_RES, w.getvalue(), value.version))


@dataclass(frozen=True, slots=True)
class AlarmCrBlockReq:
    """0x0103.  ``rta_timeout_factor`` counts 100 ms; ``max_alarm_data_length`` octets."""

    alarm_cr_type: int = 1
    lt: int = 0x8892
    properties: int = 0
    rta_timeout_factor: int = 1
    rta_retries: int = 3
    local_alarm_reference: int = 0
    max_alarm_data_length: int = 200
    tag_header_high: int = ALARM_TAG_HEADER_HIGH
    tag_header_low: int = ALARM_TAG_HEADER_LOW
    version: int = VERSION_1_0


def parse_alarm_cr_block_req(block: RawBlock) -> AlarmCrBlockReq:
    r = check_type(block, BlockType.ALARM_CR_REQ)
    value = AlarmCrBlockReq(
        r.u16(), r.u16(), r.u32(), r.u16(), r.u16(), r.u16(), r.u16(), r.u16(), r.u16(), block.version
    )
    r.expect_end()
    return value


def emit_alarm_cr_block_req(value: AlarmCrBlockReq) -> bytes:
    w = Writer().u16(value.alarm_cr_type).u16(value.lt).u32(value.properties).u16(value.rta_timeout_factor)
    w.u16(value.rta_retries).u16(value.local_alarm_reference).u16(value.max_alarm_data_length)
    w.u16(value.tag_header_high).u16(value.tag_header_low)
    return emit_raw_block(RawBlock(BlockType.ALARM_CR_REQ, w.getvalue(), value.version))


@dataclass(frozen=True, slots=True)
class AlarmCrBlockRes:
    """0x8103."""

    alarm_cr_type: int
    local_alarm_reference: int
    max_alarm_data_length: int
    version: int = VERSION_1_0


def parse_alarm_cr_block_res(block: RawBlock) -> AlarmCrBlockRes:
    r = check_type(block, BlockType.ALARM_CR_RES)
    value = AlarmCrBlockRes(r.u16(), r.u16(), r.u16(), block.version)
    r.expect_end()
    return value


def emit_alarm_cr_block_res(value: AlarmCrBlockRes) -> bytes:
    w = Writer().u16(value.alarm_cr_type).u16(value.local_alarm_reference).u16(value.max_alarm_data_length)
    return emit_raw_block(RawBlock(BlockType.ALARM_CR_RES, w.getvalue(), value.version))


@dataclass(frozen=True, slots=True)
class PrmServerBlockReq:
    """0x0105: an external parameter server."""

    object_uuid: UUID
    properties: int
    activity_timeout_factor: int
    station_name: bytes
    version: int = VERSION_1_0


def parse_prm_server_block_req(block: RawBlock) -> PrmServerBlockReq:
    r = check_type(block, BlockType.PRM_SERVER_REQ)
    value = PrmServerBlockReq(read_uuid(r), r.u32(), r.u16(), _read_name(r), block.version)
    r.expect_end()
    return value


def emit_prm_server_block_req(value: PrmServerBlockReq) -> bytes:
    w = write_uuid(Writer(), value.object_uuid).u32(value.properties).u16(value.activity_timeout_factor)
    w.u16(len(value.station_name)).bytes(value.station_name)
    return emit_raw_block(RawBlock(BlockType.PRM_SERVER_REQ, w.getvalue(), value.version))


@dataclass(frozen=True, slots=True)
class PrmServerBlockRes:
    """0x8105: a header alone."""

    version: int = VERSION_1_0


def parse_prm_server_block_res(block: RawBlock) -> PrmServerBlockRes:
    check_type(block, BlockType.PRM_SERVER_RES).expect_end()
    return PrmServerBlockRes(block.version)


def emit_prm_server_block_res(value: PrmServerBlockRes) -> bytes:
    return emit_raw_block(RawBlock(BlockType.PRM_SERVER_RES, b"", value.version))


@dataclass(frozen=True, slots=True)
class McrBlockReq:
    """0x0106: a multicast provider to subscribe to."""

    iocr_reference: int
    address_resolution_properties: int
    mci_timeout_factor: int
    station_name: bytes
    version: int = VERSION_1_0


def parse_mcr_block_req(block: RawBlock) -> McrBlockReq:
    r = check_type(block, BlockType.MCR_REQ)
    value = McrBlockReq(r.u16(), r.u32(), r.u16(), _read_name(r), block.version)
    # the standard pads the block itself to a multiple of four octets
    expect_padding(r)
    return value


def emit_mcr_block_req(value: McrBlockReq) -> bytes:
    w = Writer().u16(value.iocr_reference).u32(value.address_resolution_properties).u16(value.mci_timeout_factor)
    w.u16(len(value.station_name)).bytes(value.station_name)
    w.zeros(-(len(w) + 6) % 4)
    return emit_raw_block(RawBlock(BlockType.MCR_REQ, w.getvalue(), value.version))


@dataclass(frozen=True, slots=True)
class ArRpcBlockReq:
    """0x0107: the UDP port on which the initiator serves RPC."""

    server_port: int
    version: int = VERSION_1_0


def parse_ar_rpc_block_req(block: RawBlock) -> ArRpcBlockReq:
    r = check_type(block, BlockType.AR_RPC_REQ)
    value = ArRpcBlockReq(r.u16(), block.version)
    r.expect_end()
    return value


def emit_ar_rpc_block_req(value: ArRpcBlockReq) -> bytes:
    return emit_raw_block(RawBlock(BlockType.AR_RPC_REQ, Writer().u16(value.server_port).getvalue(), value.version))


@dataclass(frozen=True, slots=True)
class ArRpcBlockRes:
    """0x8107: the UDP port on which the responder serves RPC."""

    server_port: int
    version: int = VERSION_1_0


def parse_ar_rpc_block_res(block: RawBlock) -> ArRpcBlockRes:
    r = check_type(block, BlockType.AR_RPC_RES)
    value = ArRpcBlockRes(r.u16(), block.version)
    r.expect_end()
    return value


def emit_ar_rpc_block_res(value: ArRpcBlockRes) -> bytes:
    return emit_raw_block(RawBlock(BlockType.AR_RPC_RES, Writer().u16(value.server_port).getvalue(), value.version))


@dataclass(frozen=True, slots=True)
class ArServerBlock:
    """0x8106: the device's station name; the block is padded to a multiple of four octets."""

    station_name: bytes
    version: int = VERSION_1_0


def parse_ar_server_block(block: RawBlock) -> ArServerBlock:
    r = check_type(block, BlockType.AR_SERVER_RES)
    value = ArServerBlock(_read_name(r), block.version)
    expect_padding(r)
    return value


def emit_ar_server_block(value: ArServerBlock) -> bytes:
    w = Writer().u16(len(value.station_name)).bytes(value.station_name)
    w.zeros(-(len(w) + 6) % 4)
    return emit_raw_block(RawBlock(BlockType.AR_SERVER_RES, w.getvalue(), value.version))


@dataclass(frozen=True, slots=True)
class ArVendorBlockReq:
    """0x0108."""

    ap_structure_identifier: int
    api: int
    data: bytes = b""
    version: int = VERSION_1_0


def parse_ar_vendor_block_req(block: RawBlock) -> ArVendorBlockReq:
    r = check_type(block, BlockType.AR_VENDOR_REQ)
    return ArVendorBlockReq(r.u16(), r.u32(), r.rest(), block.version)


def emit_ar_vendor_block_req(value: ArVendorBlockReq) -> bytes:
    w = Writer().u16(value.ap_structure_identifier).u32(value.api).bytes(value.data)
    return emit_raw_block(RawBlock(BlockType.AR_VENDOR_REQ, w.getvalue(), value.version))


@dataclass(frozen=True, slots=True)
class ArVendorBlockRes:
    """0x8108."""

    ap_structure_identifier: int
    api: int
    data: bytes = b""
    version: int = VERSION_1_0


def parse_ar_vendor_block_res(block: RawBlock) -> ArVendorBlockRes:
    r = check_type(block, BlockType.AR_VENDOR_RES)
    return ArVendorBlockRes(r.u16(), r.u32(), r.rest(), block.version)


def emit_ar_vendor_block_res(value: ArVendorBlockRes) -> bytes:
    w = Writer().u16(value.ap_structure_identifier).u32(value.api).bytes(value.data)
    return emit_raw_block(RawBlock(BlockType.AR_VENDOR_RES, w.getvalue(), value.version))
