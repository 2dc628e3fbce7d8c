"""``python pnet_talk.py INTERFACE ADDRESS MAC``: sequences of messages to a PROFINET device, and the answers to each.

A line of standard input is a JSON list of ``[how, octets]``.  ``how``: ``rpc`` a datagram for port 34964, ``dcp`` and
``identify`` what follows the EtherType of a frame, for the device and for all; ``ready`` sends nothing, but waits for a
call of the device's, which is answered as a controller does.  Behind each message goes one that is always answered:
when its answer comes, no other will.  The answer is a list of octets, ``silence``, or ``no end``.
"""

# ruff: noqa: T201 - what it prints is its answer

from __future__ import annotations

import json
import select
import socket
import sys
import time
from collections.abc import Iterable
from typing import Protocol
from uuid import uuid4

from pnfarm.protocols.profinet.wire.any_block import parse_blocks
from pnfarm.protocols.profinet.wire.cm.control import control_response
from pnfarm.protocols.profinet.wire.dcp.blocks import OptionId
from pnfarm.protocols.profinet.wire.dcp.pdu import IDENTIFY_MULTICAST, SERVICE_GET, DcpPdu, emit_dcp, frame_id_of
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    OK,
    RPC_PORT,
    UUID_PNIO_CONTROLLER,
    UUID_PNIO_DEVICE,
    Flags1,
    PacketType,
    ResponseArgs,
    RpcPdu,
    emit_response_args,
    emit_rpc,
    parse_request_args,
    parse_rpc,
)

__all__ = ["End", "answers"]

PROFINET = 0x8892
XID, PROBE_XID = slice(4, 8), b"more"
#: As in asm-generic/socket.h: datagrams without checksum.  The kernel leaves that of others to a network card.
SO_NO_CHECK = 11
#: Where an RPC PDU has its activity.
ACTIVITY = slice(40, 56)
#: Seconds: the probe's answer; a call of the device's; answers to Identify, which may wait for 10 ms.
PATIENCE, READY_SECONDS, IDENTIFY_SECONDS = 0.5, 0.5, 0.06


class End(Protocol):
    """One end of the wire."""

    def send(self, how: str, octets: bytes) -> None:
        """As ``how`` says; ``answer`` is a datagram to whoever called last."""

    def more(self, seconds: float) -> tuple[str, bytes] | None:
        """The next ``rpc``, ``dcp`` or ``call`` that arrives within so many seconds."""


def called(octets: bytes) -> bytes:
    """A controller's answer to a call of the device's."""
    pdu = parse_rpc(octets)
    args = parse_request_args(pdu.body, little_endian=pdu.little_endian)
    payload = control_response(parse_blocks(args.payload)[0]).emit()
    body = emit_response_args(ResponseArgs(OK, payload, args.args_maximum), little_endian=pdu.little_endian)
    return emit_rpc(
        RpcPdu(
            PacketType.RESPONSE, UUID_PNIO_CONTROLLER, pdu.activity, pdu.object_uuid, pdu.sequence, pdu.opnum, body,
            flags1=Flags1.LAST_FRAGMENT | Flags1.NO_FACK, drep=pdu.drep,
        )
    )  # fmt: skip


def _probe(how: str) -> tuple[str, bytes, bytes]:
    """Its kind, its octets, and what its answer has in their place."""
    if how == "rpc":
        activity = uuid4()
        ping = RpcPdu(PacketType.PING, UUID_PNIO_DEVICE, activity, flags1=Flags1.IDEMPOTENT)
        return "rpc", emit_rpc(ping), activity.bytes_le
    request = DcpPdu(
        frame_id_of(SERVICE_GET, 0), SERVICE_GET, 0, int.from_bytes(PROBE_XID, "big"), (), (OptionId(2, 2),)
    )
    return "dcp", emit_dcp(request), PROBE_XID


class _Talk:
    def __init__(self, end: End) -> None:
        self.end = end
        self.calls: list[bytes] = []

    def more(self, until: float, clock) -> tuple[str, bytes] | None:
        """What is no call; calls are answered and kept."""
        while (left := until - clock()) > 0:
            found = self.end.more(left)
            if found is None:
                return None
            if found[0] != "call":
                return found
            # a call that is sent again had its answer already
            self.calls += [found[1]] if found[1] not in self.calls else []
            self.end.send("answer", called(found[1]))
        return None

    def asked(self, how: str, octets: bytes, clock) -> bytes | str:
        self.end.send(how, octets)
        if how == "identify":
            kind, within, expected, place = "dcp", IDENTIFY_SECONDS, b"", XID
        else:
            kind, probe, expected = _probe(how)
            self.end.send(kind, probe)
            within, place = PATIENCE, ACTIVITY if kind == "rpc" else XID
        first: bytes | None = None
        end = clock() + within
        while (found := self.more(end, clock)) is not None:
            if found[0] != kind or (kind == "dcp" and found[1][XID] not in {octets[XID], expected}):
                continue
            if found[1][place] == expected:
                return "silence" if first is None else first
            if first is None or (kind == "rpc" and first[1] == PacketType.FACK):
                # an acknowledged fragment may be the last, behind which the answer comes
                first = found[1]
        return (first or "silence") if how == "identify" else "no end"

    def ready(self, clock) -> bytes | str:
        end = clock() + READY_SECONDS
        while not self.calls:
            if self.more(end, clock) is None and clock() >= end:
                return "silence"
        return self.calls.pop(0)


def answers(end: End, messages: Iterable[tuple[str, bytes]], clock=time.monotonic) -> list[bytes | str]:
    """One for each message, up to the one after which the device says nothing any more: ``no end``."""
    talk = _Talk(end)
    found: list[bytes | str] = []
    for how, octets in messages:
        found.append(talk.ready(clock) if how == "ready" else talk.asked(how, octets, clock))
        if found[-1] == "no end":
            break
    return found


class Sockets:
    """The end in a network namespace."""

    def __init__(self, interface: str, address: str, mac: bytes) -> None:
        self.address, self.mac = address, mac
        self.frames = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(PROFINET))
        self.frames.bind((interface, PROFINET))
        self.own = self.frames.getsockname()[4]
        self.asks, self.called = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        self.called.bind(("", RPC_PORT))
        for one in (self.asks, self.called):
            one.setsockopt(socket.SOL_SOCKET, SO_NO_CHECK, 1)
        self.caller: tuple[str, int] = (address, RPC_PORT)

    def send(self, how: str, octets: bytes) -> None:
        if how == "rpc":
            self.asks.sendto(octets, (self.address, RPC_PORT))
        elif how == "answer":
            self.called.sendto(octets, self.caller)
        else:
            to = IDENTIFY_MULTICAST if how == "identify" else self.mac
            self.frames.send((to + self.own + PROFINET.to_bytes(2, "big") + octets).ljust(60, b"\0"))

    def more(self, seconds: float) -> tuple[str, bytes] | None:
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            ready, _, _ = select.select([self.called, self.asks, self.frames], [], [], left)
            if self.called in ready:
                octets, self.caller = self.called.recvfrom(4096)
                return "call", octets
            if self.asks in ready:
                return "rpc", self.asks.recv(65536)
            if self.frames in ready:
                frame = self.frames.recv(2048)
                # cyclic frames, alarms and LLDP are none of the answers
                if frame[:6] == self.own and frame[14:16] >= b"\xfe\xfc":
                    return "dcp", frame[14:]
        return None


def main(interface: str, address: str, mac: str) -> None:
    end = Sockets(interface, address, bytes.fromhex(mac.replace(":", "")))
    for line in sys.stdin:
        # what came late belongs to the last sequence
        while end.more(0.0005):
            pass
        found = answers(end, [(how, bytes.fromhex(octets)) for how, octets in json.loads(line)])
        print(json.dumps([one if isinstance(one, str) else one.hex() for one in found]), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:4])
