"""PDUs of the discovery and basic configuration protocol (IEC 61158-6-10, DCP; services: IEC 61158-5-10).

A PDU is a header and a row of blocks; every block names an option and a suboption.  What stands between
a block's length and its value depends on the service, which is why blocks parse only within a PDU:

=====================  =========================  =====================================================
service                request                    response
=====================  =========================  =====================================================
Get                    pairs of option, no block  blocks with block info; ``ResponseBlock`` for refusals
Set                    blocks with a qualifier    one ``ResponseBlock`` for each block set
Identify               bare blocks: the filters   blocks with block info
Hello                  blocks with block info     none
=====================  =========================  =====================================================

A block whose value does not have its option's shape parses as ``UnknownBlock``, octet for octet, so
that the receiver can refuse that one block and answer the others.
"""

from __future__ import annotations

from dataclasses import dataclass

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.dcp.blocks import (
    Block,
    DeviceOptionsBlock,
    OptionId,
    ResponseBlock,
    UnknownBlock,
    shape_block,
)
from pnfarm.protocols.profinet.wire.frame_id import (
    DCP_GET_SET,
    DCP_HELLO,
    DCP_IDENTIFY_REQUEST,
    DCP_IDENTIFY_RESPONSE,
)
from pnfarm.wire.octets import Reader, Writer

__all__ = [
    "HELLO_MULTICAST",
    "IDENTIFY_MULTICAST",
    "MAXIMUM_DELAY_FACTOR",
    "SERVICE_GET",
    "SERVICE_HELLO",
    "SERVICE_IDENTIFY",
    "SERVICE_SET",
    "TYPE_NOT_SUPPORTED",
    "TYPE_REQUEST",
    "TYPE_SUCCESS",
    "DcpPdu",
    "emit_dcp",
    "frame_id_of",
    "parse_dcp",
]

SERVICE_GET = 3
SERVICE_SET = 4
SERVICE_IDENTIFY = 5
SERVICE_HELLO = 6

TYPE_REQUEST = 0
TYPE_SUCCESS = 1
TYPE_NOT_SUPPORTED = 5

IDENTIFY_MULTICAST = bytes.fromhex("010ecf000000")
HELLO_MULTICAST = bytes.fromhex("010ecf000001")

#: Highest ResponseDelayFactor; 0 and everything above are reserved.
MAXIMUM_DELAY_FACTOR = 6400

_FRAME_IDS = range(DCP_HELLO, DCP_IDENTIFY_RESPONSE + 1)
_SERVICES = frozenset({SERVICE_GET, SERVICE_SET, SERVICE_IDENTIFY, SERVICE_HELLO})


@dataclass(frozen=True, slots=True)
class DcpPdu:
    """One DCP frame after its EtherType.

    ``requested`` is filled in a Get request only, ``blocks`` in all others; ``undecoded`` keeps the octets of
    a service that the standard does not name.
    """

    frame_id: int
    service_id: int
    service_type: int
    xid: int
    blocks: tuple[Block, ...] = ()
    requested: tuple[OptionId, ...] = ()
    response_delay_factor: int = 0
    undecoded: bytes = b""


def parse_dcp(data: bytes | bytearray | memoryview) -> DcpPdu:
    """PDU from an Ethernet payload; padding of the frame is cut off.

    Reasons: ``bad-type`` (no frame id of DCP), ``short`` (a length points after the end).
    """
    reader = Reader(data)
    frame_id = reader.u16()
    if frame_id not in _FRAME_IDS:
        raise DecodeError("bad-type", f"frame id {frame_id:#06x}")
    service_id, service_type = reader.u8(), reader.u8()
    xid, response_delay_factor = reader.u32(), reader.u16()
    body = reader.sub(reader.u16())
    blocks: list[Block] = []
    requested: tuple[OptionId, ...] = ()
    if (service_id, service_type) == (SERVICE_GET, TYPE_REQUEST):
        requested = DeviceOptionsBlock.read(body).options
    elif service_id in _SERVICES:
        while body.remaining:
            option_id = OptionId(body.u8(), body.u8())
            value = body.sub(body.u16())
            body.align(2)
            blocks.append(_parse_block(option_id, value, service_id, service_type))
    return DcpPdu(
        frame_id=frame_id,
        service_id=service_id,
        service_type=service_type,
        xid=xid,
        blocks=tuple(blocks),
        requested=requested,
        response_delay_factor=response_delay_factor,
        undecoded=body.rest(),
    )


def emit_dcp(pdu: DcpPdu) -> bytes:
    """Octets of a PDU, each block padded to an even length; :class:`ValueError` when a field does not fit."""
    body = Writer()
    for option_id in pdu.requested:
        body.u8(option_id.option).u8(option_id.suboption)
    with_info = _has_info(pdu.service_id, pdu.service_type)
    for block in pdu.blocks:
        payload = block.emit()
        has_info = with_info and block.info is not None
        body.bytes(bytes(block.option_id)).u16(len(payload) + 2 * has_info)
        if has_info and block.info is not None:
            body.u16(block.info)
        body.bytes(payload).align(2)
    body.bytes(pdu.undecoded)
    writer = Writer().u16(pdu.frame_id).u8(pdu.service_id).u8(pdu.service_type).u32(pdu.xid)
    return writer.u16(pdu.response_delay_factor).u16(len(body)).bytes(body.getvalue()).getvalue()


def frame_id_of(service_id: int, service_type: int) -> int:
    """Frame id that a service's request or response travels under."""
    if service_id == SERVICE_IDENTIFY:
        return DCP_IDENTIFY_REQUEST if service_type == TYPE_REQUEST else DCP_IDENTIFY_RESPONSE
    return DCP_HELLO if service_id == SERVICE_HELLO else DCP_GET_SET


def _has_info(service_id: int, service_type: int) -> bool:
    return (service_id, service_type) != (SERVICE_IDENTIFY, TYPE_REQUEST)


def _parse_block(option_id: OptionId, value: Reader, service_id: int, service_type: int) -> Block:
    if service_type != TYPE_REQUEST and option_id == ResponseBlock.ID:
        data = value.rest()
        return ResponseBlock.parse(data) if len(data) == 3 else UnknownBlock(*option_id, data)
    info = None
    if _has_info(service_id, service_type):
        if value.remaining < 2:
            return UnknownBlock(*option_id, value.rest())
        info = value.u16()
    return shape_block(option_id, value.rest(), info)
