"""Remote procedure calls as text: Connect, Write, Read, Control, Release and the RPC PDUs that carry them.

A response names neither its service nor its record, so requests are remembered by activity and sequence number, up to
a limit.  Fragments are reassembled first.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pnfarm.buses.profinet.decode.connect import connect_request, connect_response, forget_asked
from pnfarm.buses.profinet.decode.records import index_text, is_parameter_access
from pnfarm.buses.profinet.decode.shared import Call
from pnfarm.captures.packet import Description
from pnfarm.captures.parameter_access import parameter_request, parameter_response
from pnfarm.protocols.profinet.errors import ErrorDecode, describe_status
from pnfarm.protocols.profinet.rpc.fragments import STUB_MAX, Reassembly
from pnfarm.protocols.profinet.wire.any_block import read_blocks
from pnfarm.protocols.profinet.wire.block import BlockType
from pnfarm.protocols.profinet.wire.block_texts import blocks_in_line
from pnfarm.protocols.profinet.wire.cm.control import ControlBlock
from pnfarm.protocols.profinet.wire.records.iod import (
    IodReadReqHeader,
    IodReadResHeader,
    IodWriteReqHeader,
    IodWriteResHeader,
    WriteRequest,
    parse_read_response,
    parse_write_request,
    parse_write_response,
)
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    RPC_PORT,
    UUID_EPM,
    UUID_PNIO_DEVICE,
    Opnum,
    PacketType,
    PnioStatus,
    RpcPdu,
    parse_request_args,
    parse_response_args,
    parse_rpc,
    parse_status,
    status_name,
)
from pnfarm.wire.ipv4 import parse_ipv4
from pnfarm.wire.udp import parse_udp

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from ipaddress import IPv4Address

    from pnfarm.buses.profinet.decode.shared import Shared
    from pnfarm.captures.packet import Packet
    from pnfarm.protocols.profinet.wire.block import Block

__all__ = ["is_call", "rpc"]

_RPC_VERSION = 4
_RPC_HEAD = 80
#: The last eight octets of a call's interface UUID are the same in both data representations.
_INTERFACE_TAIL = slice(32, 40)
_INTERFACE_TAILS = frozenset({UUID_PNIO_DEVICE.bytes[8:], UUID_EPM.bytes[8:]})
_SERVICES: Mapping[int, str] = {
    Opnum.CONNECT: "Connect",
    Opnum.RELEASE: "Release",
    Opnum.READ: "Read",
    Opnum.WRITE: "Write",
    Opnum.CONTROL: "Control",
    Opnum.READ_IMPLICIT: "ReadImplicit",
}
_CONTROLS = {
    BlockType.PRM_END_REQ: "PrmEnd",
    BlockType.PRM_END_PLUG_REQ: "PrmEnd (plug)",
    BlockType.APPLICATION_READY_REQ: "ApplicationReady",
    BlockType.APPLICATION_READY_PLUG_REQ: "ApplicationReady (plug)",
    BlockType.READY_FOR_COMPANION_REQ: "ReadyForCompanion",
    BlockType.READY_FOR_RT_CLASS_3_REQ: "ReadyForRTClass3",
    BlockType.PRM_BEGIN_REQ: "PrmBegin",
    BlockType.RELEASE_REQ: "Release",
}
_DIRECTIONS: dict[int, str] = {PacketType.REQUEST: "req", PacketType.RESPONSE: "res"}
#: A client gives a call up well before.
REPEATED_NS = 60_000_000_000
#: Records of a multiple write that are shown.
MOST_RECORDS = 8
_RESPONSE_BIT = 0x8000


def is_call(source_port: int, destination_port: int, data: bytes) -> bool:
    """Whether a datagram is a PROFINET remote procedure call: by its header, whatever its port.

    A datagram to the RPC port that begins like a call counts as one, even if the rest is malformed.
    """
    if not data or data[0] != _RPC_VERSION:
        return False
    if RPC_PORT in {source_port, destination_port}:
        return True
    return len(data) >= _RPC_HEAD and data[_INTERFACE_TAIL] in _INTERFACE_TAILS


def rpc(packet: Packet, shared: Shared) -> Iterator[Description]:
    """One UDP datagram; raises :class:`DecodeError` if it is not a call."""
    ip = parse_ipv4(packet.payload)
    pdu = parse_rpc(parse_udp(ip.payload).data)
    if pdu.interface == UUID_EPM:
        direction = _DIRECTIONS.get(pdu.kind, "")
        yield Description(f"Lookup.{direction}" if direction else "Lookup", "of the endpoint mapper")
        return
    yield from _pdu(pdu, packet, ip.destination, shared)


def _pdu(pdu: RpcPdu, packet: Packet, called: IPv4Address, shared: Shared) -> Iterator[Description]:
    key = (pdu.activity, pdu.sequence)
    call = shared.calls.get(key)
    service = _SERVICES.get(pdu.opnum, f"operation {pdu.opnum}")
    match pdu.kind:
        case PacketType.REQUEST:
            begin = None if pdu.is_fragment and pdu.fragment_number else hash(pdu.body)
            # a controller that was restarted may begin with the same numbers again, and even with the same octets
            known = (
                call is not None
                and (None in {begin, call.begin} or begin == call.begin)
                and abs(packet.time_ns - call.at_ns) < REPEATED_NS
            )
            if call is None or not known:
                call = shared.calls[key] = Call(service, pdu.opnum, packet.source, packet.destination, packet.time_ns)
            call.begin = call.begin if begin is None else begin
            if call.answered or (known and not pdu.is_fragment):
                yield Description(f"{service}.req", "again", {}, {"repeated": ""})
                return
            stub = _whole(pdu, call, request=True)
            if stub is not None:
                yield from _request(stub, pdu, call, packet, called, shared)
        case PacketType.RESPONSE:
            if call is None:
                yield Description(f"{service}.res", "its request is not in the capture")
                return
            if call.answered:
                yield Description(f"{service}.res", "again", {}, {"repeated": ""})
                return
            stub = _whole(pdu, call, request=False)
            if stub is not None:
                call.answered = True
                yield from _response(stub, pdu, call, shared)
                call.blocks, call.write = (), None
        case PacketType.FAULT | PacketType.REJECT:
            service = call.service if call is not None else service
            status = status_name(parse_status(pdu.body, little_endian=pdu.little_endian))
            name = PacketType(pdu.kind).name.lower()
            yield Description(f"RPC {name}", f"of {service}: {status}", {}, {"faults": f"{name} {status}"})
        case PacketType.FACK | PacketType.ACK:
            return
        case _:
            # these PDUs say by their sequence number which call they are about, and not by their operation
            name = PacketType(pdu.kind).name.lower() if pdu.kind <= max(PacketType) else f"type {pdu.kind}"
            yield Description(f"RPC {name}", f"of {call.service}" if call is not None else "")


def _whole(pdu: RpcPdu, call: Call, *, request: bool) -> bytes | None:
    if not pdu.is_fragment:
        return pdu.body
    parts = call.parts.setdefault(request, Reassembly(STUB_MAX))
    if parts is None:
        return None
    parts.add(pdu.fragment_number, pdu.body, last=pdu.is_last)
    if not parts.complete:
        return None
    call.parts[request] = None
    return parts.stub()


# -- requests


def _request(
    stub: bytes, pdu: RpcPdu, call: Call, packet: Packet, called: IPv4Address, shared: Shared
) -> Iterator[Description]:
    payload = parse_request_args(stub, little_endian=pdu.little_endian).payload
    what = f"{call.service}.req"
    match pdu.opnum:
        case Opnum.WRITE:
            call.write = parse_write_request(payload)
            if shared.observed is not None:
                shared.observed.wrote(packet.source, packet.destination, call.write)
            yield Description(what, _write(call.write, packet.destination, shared), {}, {"writes": ""})
        case Opnum.READ | Opnum.READ_IMPLICIT:
            header = IodReadReqHeader.parse(payload)
            yield Description(what, _place(header), _where(header), {"reads": ""})
        case Opnum.CONNECT:
            call.blocks, wrong = read_blocks(payload)
            if shared.observed is not None:
                where = pdu.object_uuid, called
                shared.observed.asked(call.blocks, packet.source, packet.destination, where, packet.time_ns)
            yield _with_wrong(connect_request(call.blocks, pdu, packet, shared), wrong)
        case _:
            call.blocks, wrong = read_blocks(payload)
            if shared.observed is not None:
                shared.observed.controlled(packet.source, packet.destination, call.blocks)
            yield _with_wrong(Description(*_control(call.blocks, call.service, "req")), wrong)


def _with_wrong(description: Description, wrong: tuple[str, ...]) -> Description:
    """The text of a call, and which of its blocks are malformed."""
    if not wrong:
        return description
    text = f"{description.text}; malformed {'; malformed '.join(wrong[:MOST_RECORDS])}"
    return replace(description, text=text.removeprefix("; "), counts={**description.counts, "malformed": wrong[0]})


def _write(write: WriteRequest, device: bytes, shared: Shared) -> str:
    texts = [_record(record.header, record.data, device, shared) for record in write.writes]
    if not write.multiple:
        return texts[0]
    more = f"; and {len(texts) - MOST_RECORDS} more" if len(texts) > MOST_RECORDS else ""
    return f"{len(texts)} records: {'; '.join(texts[:MOST_RECORDS])}{more}"


def _record(header: IodWriteReqHeader, data: bytes, device: bytes, shared: Shared) -> str:
    model = shared.stations.model(device)
    if is_parameter_access(header.api, header.index, drive=model is not None):
        shared.parameter_requests[device, header.slot, header.subslot, header.index] = data
        return f"{_place(header)}: {parameter_request(data, model)}"
    return f"{_place(header)}, {_content(data)}"


def _content(data: bytes) -> str:
    """A record's blocks as text, or its first octets."""
    if not data:
        return "0 octets"
    shown = blocks_in_line(data) or data[:16].hex(" ") + (" ..." if len(data) > 16 else "")
    return f"{len(data)} octets: {shown}"


def _place(header: IodWriteReqHeader | IodWriteResHeader | IodReadReqHeader | IodReadResHeader) -> str:
    api = f"API 0x{header.api:04X} " if header.api else ""
    return f"{api}slot {header.slot} subslot 0x{header.subslot:04X} index {index_text(header.api, header.index)}"


def _where(header: IodReadReqHeader | IodReadResHeader) -> Mapping[str, int]:
    return {"api": header.api, "slot": header.slot, "subslot": header.subslot, "index": header.index}


def _control(
    blocks: tuple[Block, ...], service: str, direction: str
) -> tuple[str, str, dict[str, int], dict[str, str]]:
    block = next((b for b in blocks if isinstance(b, ControlBlock)), None)
    if block is None:
        return f"{service}.{direction}", f"{len(blocks)} blocks", {}, {}
    kind = block.block_type & ~_RESPONSE_BIT
    name = _CONTROLS.get(BlockType(kind), service)
    counts = {"releases": ""} if name == "Release" and direction == "req" else {}
    return f"{name}.{direction}", f"AR {str(block.ar_uuid)[:8]}", {"session": block.session_key}, counts


# -- responses


def _response(stub: bytes, pdu: RpcPdu, call: Call, shared: Shared) -> Iterator[Description]:
    args = parse_response_args(stub, little_endian=pdu.little_endian)
    what = f"{call.service}.res"
    if not args.status.ok:
        if call.opnum == Opnum.CONNECT:
            forget_asked(call.blocks, call.client, call.server, shared)
            if shared.observed is not None:
                shared.observed.answered(call.client, call.server, None)
        # another error is of the call, such as that of a connection which is gone
        of_record = args.status.error_decode == ErrorDecode.PNIORW
        if call.write is not None and of_record and shared.observed is not None:
            shared.observed.refused(call.client, call.server, (one.header for one in call.write.writes))
        yield _refused(what, args.status, call)
        return
    match call.opnum:
        case Opnum.WRITE:
            headers = parse_write_response(args.payload)
            if shared.observed is not None:
                shared.observed.refused(call.client, call.server, (one for one in headers if not one.status.ok))
            yield _written(what, headers, call)
        case Opnum.READ | Opnum.READ_IMPLICIT:
            read = parse_read_response(args.payload)
            if shared.observed is not None:
                shared.observed.read(call.server, read.header.slot, read.header.subslot, read.header.index, read.data)
            yield Description(what, _read(read.header, read.data, call, shared), _where(read.header))
        case Opnum.CONNECT:
            blocks, wrong = read_blocks(args.payload)
            yield _with_wrong(connect_response(call.blocks, blocks, call.client, call.server, shared), wrong)
        case _:
            blocks, wrong = read_blocks(args.payload)
            what, text, details, _ = _control(blocks, call.service, "res")
            yield _with_wrong(Description(what, f"OK, {text}", details), wrong)


def _refused(what: str, status: PnioStatus, call: Call) -> Description:
    text = describe_status(status)
    counter = "refused" if call.opnum == Opnum.CONNECT else "record errors"
    return Description(what, text, {"status": f"0x{int(status):08X}"}, {counter: text})


def _written(what: str, headers: tuple[IodWriteResHeader, ...], call: Call) -> Description:
    records = headers[1:] if call.write is not None and call.write.multiple else headers
    bad = [f"{_place(h)}: {describe_status(h.status)}" for h in records if not h.status.ok]
    if bad:
        return Description(what, "; ".join(bad[:MOST_RECORDS]), {}, {"record errors": bad[0]})
    count = f"{len(records)} records" if len(records) > 1 else _place(records[0]) if records else ""
    return Description(what, f"OK, {count}".rstrip(", "))


def _read(header: IodReadResHeader, data: bytes, call: Call, shared: Shared) -> str:
    place = _place(header)
    model = shared.stations.model(call.server)
    if is_parameter_access(header.api, header.index, drive=model is not None):
        asked = shared.parameter_requests.get((call.server, header.slot, header.subslot, header.index))
        return f"{place}: {parameter_response(data, asked, model)}"
    return f"OK, {place}, {_content(data)}"
