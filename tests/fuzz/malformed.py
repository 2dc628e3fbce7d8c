"""Good frames, calls and messages made bad at one depth, with the right lengths and checksums around it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from random import Random
from uuid import UUID

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.block import split_blocks
from pnfarm.protocols.profinet.wire.rpc.bodies import CancelBody
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    UUID_EPM,
    Flags1,
    PacketType,
    emit_request_args,
    emit_response_args,
    emit_rpc,
    parse_request_args,
    parse_response_args,
    parse_rpc,
)
from pnfarm.protocols.profinet.wire.snmp.message import (
    GET,
    GET_BULK,
    GET_NEXT,
    OCTET_STRING,
    SET,
    OtherPdu,
    Value,
    VarBind,
    emit_snmp,
    parse_snmp,
)
from pnfarm.wire.ethernet import (
    ETHERTYPE_IPV4,
    emit_ethernet,
    parse_ethernet,
)
from pnfarm.wire.ipv4 import emit_ipv4, parse_ipv4
from pnfarm.wire.udp import emit_udp, parse_udp
from tests.fuzz.mutate import mutated, random_octets

UDP = 17


def deep(rng: Random, frame: bytes, pool: Sequence[bytes]) -> bytes:
    """``frame`` with something wrong at a random depth, well-formed around it."""
    depth = rng.randrange(7)
    try:
        return _deep(rng, frame, pool, depth)
    except (DecodeError, ValueError):
        return mutated(rng, frame, pool)  # not so deep, or no longer emittable


def _deep(rng, frame, pool, depth):
    if depth == 0:
        return mutated(rng, frame, pool)
    ether = parse_ethernet(frame)
    if ether.ethertype != ETHERTYPE_IPV4 or depth == 1:
        return emit_ethernet(replace(ether, payload=mutated(rng, ether.payload, pool)))
    packet = parse_ipv4(ether.payload)
    if packet.protocol != UDP or depth == 2:
        packet = replace(packet, payload=mutated(rng, packet.payload, pool)[:1480])
    else:
        datagram = parse_udp(packet.payload)
        data = mutated(rng, datagram.data, pool) if depth == 3 else deep_rpc(rng, datagram.data, pool, depth)
        datagram = replace(datagram, data=data[:1472])
        packet = replace(packet, payload=emit_udp(datagram, packet.source, packet.destination))
    return emit_ethernet(replace(ether, payload=emit_ipv4(packet)))


def deep_rpc(rng: Random, data: bytes, pool: Sequence[bytes], depth: int) -> bytes:
    """An RPC PDU with its body, its arguments or one of its blocks changed; mostly a call that is new to the server."""
    pdu = parse_rpc(data)
    if rng.random() < 0.7:
        pdu = replace(pdu, activity=UUID(bytes=rng.randbytes(16)), sequence=rng.choice((0, 0, 1, rng.getrandbits(32))))
    if rng.random() < 0.1:
        pdu = replace(
            pdu,
            opnum=rng.choice((0, 1, 2, 3, 4, 5, 6, 0xFFFF)),
            packet_type=rng.randrange(12),
            flags1=rng.randrange(256),
        )
    little = pdu.little_endian
    if depth == 4 or pdu.interface == UUID_EPM or pdu.kind not in {PacketType.REQUEST, PacketType.RESPONSE}:
        return emit_rpc(replace(pdu, body=mutated(rng, pdu.body, pool)))
    if pdu.kind == PacketType.REQUEST:
        args = parse_request_args(pdu.body, little_endian=little)
        args = replace(args, payload=deep_blocks(rng, args.payload, pool, depth))
        return emit_rpc(replace(pdu, body=emit_request_args(args, little_endian=little)))
    answer = parse_response_args(pdu.body, little_endian=little)
    answer = replace(answer, payload=deep_blocks(rng, answer.payload, pool, depth))
    return emit_rpc(replace(pdu, body=emit_response_args(answer, little_endian=little)))


def deep_blocks(rng: Random, payload: bytes, pool: Sequence[bytes], depth: int = 6) -> bytes:
    """Blocks of which one is changed, doubled, left out or moved."""
    if depth == 5:
        return mutated(rng, payload, pool)
    try:
        blocks = list(split_blocks(payload))
    except DecodeError:
        return mutated(rng, payload, pool)
    if not blocks:
        return random_octets(rng)
    place = rng.randrange(len(blocks))
    match rng.randrange(6):
        case 0:
            blocks.insert(place, blocks[place])
        case 1:
            del blocks[place]
        case 2:
            rng.shuffle(blocks)
        case _:
            block = blocks[place]
            blocks[place] = replace(block, body=mutated(rng, block.body, [b.body for b in blocks])[:0xFFF0])
    return b"".join(block.emit() for block in blocks)


def about_a_call(rng: Random, data: bytes, endpoint: tuple[UUID, UUID]) -> bytes:
    """Mostly for this endpoint (interface, object), and often about one of a few calls, to meet them in all states."""
    pdu = parse_rpc(data)
    if pdu.interface != UUID_EPM and rng.random() < 0.9:
        pdu = replace(pdu, interface=endpoint[0], object_uuid=endpoint[1])
    if rng.random() < 0.3:
        pdu = replace(pdu, activity=UUID(int=rng.randrange(1, 4)), sequence=rng.randrange(3))
    match rng.randrange(10):
        case 0:
            kinds = (PacketType.PING, PacketType.ACK, PacketType.CL_CANCEL)
            pdu = replace(pdu, packet_type=rng.choice(kinds), body=b"")
        case 1:
            body = CancelBody(rng.randrange(3)).emit(little_endian=pdu.little_endian)
            pdu = replace(pdu, packet_type=PacketType.CL_CANCEL, body=mutated(rng, body, [body]))
        case 2:
            flags = rng.choice((0, Flags1.LAST_FRAGMENT)) | rng.choice((0, Flags1.NO_FACK))
            number = rng.choice((0, 0, 1, 2, 0xFFFF))
            pdu = replace(pdu, flags1=int(Flags1.FRAGMENT | flags), fragment_number=number)
        case _:
            pass
    return emit_rpc(pdu)


def varied_snmp(rng: Random, pool: Sequence[bytes]) -> bytes:
    """A manager's message with octets wrong, or with its list of variables changed and the lengths around it right."""
    data = rng.choice(pool)
    if rng.random() < 0.5:
        return mutated(rng, data, pool)
    message = parse_snmp(data)
    if isinstance(message.pdu, OtherPdu):
        return emit_snmp(replace(message, version=rng.randrange(2), pdu=OtherPdu(rng.randrange(0xA0, 0xAA), data)))
    varbinds = list(message.pdu.varbinds) * rng.choice((1, 1, 1, 5, 30))
    rng.shuffle(varbinds)
    names = [varbind.name for varbind in varbinds]
    if varbinds and rng.random() < 0.8:
        place = rng.randrange(len(varbinds))
        name = (
            *rng.choice(names)[: rng.randrange(2, 20)],
            *(rng.choice((0, 1, 2, 127, 128, 2**32 - 1)),) * rng.randrange(3),
        )
        value = rng.choice((varbinds[place].value, Value(OCTET_STRING, random_octets(rng)[:300]), Value(0x4F, b"x")))
        varbinds[place] = VarBind(name, value)
    pdu = replace(
        message.pdu,
        tag=rng.choice((message.pdu.tag, GET, GET_NEXT, SET, GET_BULK)),
        error_status=rng.choice((0, 0, 1, 5, -1, 2**31 - 1)),
        error_index=rng.choice((0, 1, 10, 50, -1, 2**31 - 1)),
        varbinds=tuple(varbinds),
    )
    community = rng.choice((b"public", b"private", b"private", b"no"))
    return emit_snmp(replace(message, version=rng.randrange(2), community=community, pdu=pdu))
