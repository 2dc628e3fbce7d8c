"""The class of a PROFINET device's answer: what two implementations of the standard should agree on."""

from __future__ import annotations

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.any_block import parse_blocks
from pnfarm.protocols.profinet.wire.block import BlockType, split_blocks
from pnfarm.protocols.profinet.wire.dcp.blocks import Block, ResponseBlock
from pnfarm.protocols.profinet.wire.dcp.pdu import SERVICE_IDENTIFY, SERVICE_SET, TYPE_SUCCESS, parse_dcp
from pnfarm.protocols.profinet.wire.records.iod import IOD_HEADER_SIZE, parse_write_response
from pnfarm.protocols.profinet.wire.rpc.pdu import PacketType, PnioStatus, parse_response_args, parse_rpc, parse_status
from tests.fuzz.pnet.base import Sent

__all__ = ["answer_class"]

#: ErrorDecode: the code of the operation on a record, whose last octet is the device's own; the PNIO stack's.
PNIORW = 0x80
STANDARD_INDEX = 0x8000
#: Blocks that a device adds to its answer or not.
OPTIONAL = {BlockType.AR_SERVER_RES}


def answer_class(sent: Sent, octets: bytes | str) -> str:
    """``octets`` may be ``silence`` or ``no end``, which are classes."""
    if isinstance(octets, str):
        return octets
    try:
        if sent.how in {"dcp", "identify"}:
            return _dcp(octets, coarse=sent.coarse)
        found = _call(octets) if sent.how == "ready" else _rpc(octets)
    except DecodeError as exc:
        # what a device says is well-formed
        return f"unreadable ({exc.reason})"
    return _kind(found) if sent.coarse else found


def _kind(found: str) -> str:
    """Of an answer: whether it is positive, and else where in the stack it was refused."""
    words = found.split(" ")
    return "OK" if words[0] == "OK" else " ".join(words[:3])


def _call(octets: bytes) -> str:
    """A call of the device's."""
    pdu = parse_rpc(octets)
    (block, *_) = split_blocks(pdu.body[20:])
    return f"calls operation {pdu.opnum} {_name(block.block_type)}"


def _name(block_type: int) -> str:
    return BlockType(block_type).name if block_type in set(BlockType) else f"0x{block_type:04X}"


def _status(status: PnioStatus) -> str:
    last = "" if status.error_decode == PNIORW else f" {status.error_code2:02X}"
    return f"{status.error_code:02X} {status.error_decode:02X} {status.error_code1:02X}{last}"


def _rpc(octets: bytes) -> str:
    pdu = parse_rpc(octets)
    little = pdu.little_endian
    if pdu.kind in {PacketType.FAULT, PacketType.REJECT}:
        return f"{PacketType(pdu.kind).name.lower()} 0x{parse_status(pdu.body, little_endian=little):08X}"
    if pdu.kind != PacketType.RESPONSE:
        return PacketType(pdu.kind).name.lower() if pdu.kind in set(PacketType) else f"PDU {pdu.kind}"
    args = parse_response_args(pdu.body, little_endian=little)
    if not args.status.ok:
        return _status(args.status)
    return " ".join(["OK", *_answered(args.payload)])


def _answered(payload: bytes) -> list[str]:
    """The kinds of its blocks; of a write each record's status; of a read the first block of a standard record."""
    if payload[:2] == BlockType.IOD_WRITE_RES.to_bytes(2, "big"):
        return [_status(one.status) if not one.status.ok else "written" for one in parse_write_response(payload)]
    if payload[:2] == BlockType.IOD_READ_RES.to_bytes(2, "big"):
        index = int.from_bytes(payload[34:36], "big")
        record = payload[IOD_HEADER_SIZE:]
        if index < STANDARD_INDEX:
            return [f"{len(record)} octets"]
        return [_name(int.from_bytes(record[:2], "big")) if record else "nothing"]
    return [_name(block.kind) for block in parse_blocks(payload) if block.kind not in OPTIONAL]


def _dcp(octets: bytes, *, coarse: bool) -> str:
    pdu = parse_dcp(octets)
    if pdu.service_type != TYPE_SUCCESS:
        return f"service type {pdu.service_type}"
    if coarse:
        return "OK"
    if pdu.service_id == SERVICE_IDENTIFY:
        # which of its options a device tells of itself is its own
        return "answers"
    told = [_block(block) for block in pdu.blocks]
    # the order is that of the request where there is a result for each of its blocks
    return " ".join(told if pdu.service_id == SERVICE_SET or ":" in "".join(told) else sorted(set(told))) or "empty"


def _block(block: Block) -> str:
    if isinstance(block, ResponseBlock):
        return f"{block.subject.option}/{block.subject.suboption}: {block.error}"
    return f"{block.option_id.option}/{block.option_id.suboption}"
