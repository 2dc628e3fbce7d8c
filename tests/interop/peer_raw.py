"""A peer without a library: hand-made frames and datagrams, right ones and wrong ones.  ``peer_raw.py VERB ARGUMENTS``.

Answers are printed as one line of JSON, octets in hexadecimal.
"""

# ruff: noqa: T201 - what it prints is its answer

import itertools
import json
import socket
import sys
import time
from pathlib import Path
from uuid import uuid4

from pnfarm.protocols.profinet.wire.any_block import parse_blocks
from pnfarm.protocols.profinet.wire.block import BlockType, split_blocks
from pnfarm.protocols.profinet.wire.cm.control import control_response
from pnfarm.protocols.profinet.wire.dcp.blocks import OptionId, UnknownBlock
from pnfarm.protocols.profinet.wire.dcp.pdu import DcpPdu, emit_dcp, frame_id_of, parse_dcp
from pnfarm.protocols.profinet.wire.records.iod import IodReadReqHeader, IodWriteReqHeader, emit_write_request
from pnfarm.protocols.profinet.wire.rpc.epm import NIL_HANDLE, LookupRequest, emit_lookup_request, parse_lookup_response
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    NIL_UUID,
    OK,
    RPC_PORT,
    UUID_EPM,
    UUID_PNIO_CONTROLLER,
    UUID_PNIO_DEVICE,
    Flags1,
    Opnum,
    PacketType,
    RequestArgs,
    ResponseArgs,
    RpcPdu,
    emit_request_args,
    emit_response_args,
    emit_rpc,
    object_uuid,
    parse_request_args,
    parse_response_args,
    parse_rpc,
)

INTERFACE = "plc0"
PROFINET = 0x8892
IDENTIFY = bytes.fromhex("010ecf000000")
PATIENCE_SECONDS = 0.4
#: Records of every range: I&M, per API, per AR, per slot, per subslot, and the user's own.
INDEXES = (
    0xAFF0, 0xAFF1, 0xAFF2, 0xAFF3, 0xAFF4, 0xAFF5, 0xF000, 0xF80C, 0xF820, 0xF821, 0xF830, 0xF840,
    0xF841, 0xF842, 0xF880, 0xFBFF, 0xE000, 0xE001, 0xE002, 0xE010, 0xE030, 0xE040, 0xE050, 0xC000,
    0xC001, 0x8000, 0x8001, 0x8010, 0x8028, 0x8029, 0x802A, 0x802B, 0x8080, 0x7FFF,
)  # fmt: skip


# -- frames ----------------------------------------------------------------------------------------------------------


class Frames:
    """A packet socket at the cable."""

    def __init__(self, ethertype=PROFINET):
        self._socket = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ethertype))
        self._socket.bind((INTERFACE, ethertype))
        self._ethertype = ethertype
        self.mac = self._socket.getsockname()[4]

    def exchange(self, destination, payload, seconds=PATIENCE_SECONDS, most=1, tag=b""):
        """Sends one frame; what came back within ``seconds``, at most ``most`` payloads."""
        head = destination + self.mac + tag + self._ethertype.to_bytes(2)
        self._socket.send((head + payload).ljust(60, b"\0"))
        found = []
        end = time.monotonic() + seconds
        while len(found) < most and (left := end - time.monotonic()) > 0:
            self._socket.settimeout(left)
            try:
                frame = self._socket.recv(2048)
            except TimeoutError:
                break
            if frame[:6] == self.mac:
                found.append(frame[14:])
        return found


def dcp(macs):
    """Every service of DCP, with every option there is, to each drive; how many answers came."""
    frames = Frames()
    xids = itertools.count(0x10)
    answers = 0

    def ask(destination, service, blocks=(), requested=(), delay=0, most=1, tag=b""):
        nonlocal answers
        frame_id = frame_id_of(5 if service == 5 else 3, 0)
        pdu = DcpPdu(frame_id, service, 0, next(xids), tuple(blocks), tuple(requested), delay)
        answers += len(frames.exchange(destination, emit_dcp(pdu), most=most, tag=tag))

    known = {
        1: range(1, 4), 2: range(1, 9), 3: (12, 43, 54, 55, 60, 61, 81, 97, 255), 4: range(1, 5), 5: range(1, 7),
        6: (1,), 0x80: (1,), 0xFF: (0xFF,),
    }  # fmt: skip
    options = [OptionId(option, sub) for option, subs in known.items() for sub in subs]
    ask(IDENTIFY, 5, [UnknownBlock(0xFF, 0xFF, b"", None)], delay=1, most=len(macs))
    for text in macs:
        mac = bytes.fromhex(text.replace(":", ""))
        ask(mac, 5, [UnknownBlock(0xFF, 0xFF, b"", None)], delay=1)
        ask(mac, 3, requested=options)
        for option in options:
            ask(mac, 3, requested=[option])
        # Set: values of the right shape that change nothing lasting, of a wrong shape, and of no shape at all
        for option, value in (
            ((2, 2), b"a-name-for-a-while"), ((2, 2), b"Not_A_Name"), ((1, 2), b"\x0a\x4d\x00\xff"), ((5, 3), b"\1\0"),
            ((5, 1), b""), ((5, 2), b""), ((5, 4), b"\2\2"), ((6, 1), b"\0\0"), ((3, 61), b"\0"),
            ((2, 1), b"x"), ((9, 9), b""),
        ):  # fmt: skip
            ask(mac, 4, [UnknownBlock(*option, value, 0)])
        ask(
            mac,
            4,
            [UnknownBlock(5, 3, b"\1\0", 0), UnknownBlock(2, 2, b"again-another", 0), UnknownBlock(7, 7, b"", 0)],
        )
        ask(mac, 4, [UnknownBlock(5, 3, b"\1\0", 0)], tag=bytes.fromhex("8100c000"))
        # Hello, which no drive answers; of a service that does not exist Wireshark knows less than a drive does
        ask(mac, 6)
        for mode in (2, 4, 6, 8, 16, 18, 20, 0):
            ask(mac, 4, [UnknownBlock(5, 6, b"", mode)])
        ask(mac, 4, [UnknownBlock(5, 5, b"", 0)])
    # Identify by what a drive without name still has
    for option, value in (
        ((2, 3), b"\1\5\0\1"),
        ((2, 4), b"\1\0"),
        ((2, 5), b"\2\1\2\2"),
        ((2, 1), b"AKD"),
        ((2, 6), b"port-001.other"),
    ):
        ask(IDENTIFY, 5, [UnknownBlock(*option, value, None)], delay=1, most=len(macs))
    return answers


def conflict(mac, address):
    """Gives a drive an address that another station has; what the drive says of it then, as BlockInfo."""
    frames = Frames()
    destination = bytes.fromhex(mac.replace(":", ""))
    suite = b"".join(socket.inet_aton(part) for part in (address, "255.255.252.0", "0.0.0.0"))
    setting = DcpPdu(frame_id_of(4, 0), 4, 0, 1, (UnknownBlock(1, 2, suite, 0),))
    frames.exchange(destination, emit_dcp(setting))
    info = None
    for xid in range(2, 22):
        asked = DcpPdu(frame_id_of(3, 0), 3, 0, xid, (), (OptionId(1, 2),))
        (answer,) = frames.exchange(destination, emit_dcp(asked))
        info = parse_dcp(answer).blocks[0].info
        if info & 0x80:
            break
        time.sleep(0.05)
    return info


def hold(mac):
    """Two clients that read the name of one drive: who is answered."""
    first, second = Frames(), Frames()
    second.mac = bytes.fromhex("020000000099")
    destination = bytes.fromhex(mac.replace(":", ""))
    xids = itertools.count(1)

    def answered(client):
        pdu = DcpPdu(frame_id_of(3, 0), 3, 0, next(xids), (), (OptionId(2, 2),), 0)
        return bool(client.exchange(destination, emit_dcp(pdu)))

    found = {"first": answered(first), "second": answered(second), "first again": answered(first)}
    time.sleep(3.1)
    return {**found, "second later": answered(second)}


def arp(ip):
    """A probe as duplicate address detection sends it (RFC 5227): the MAC address that answers, or None."""
    frames = Frames(0x0806)
    target = socket.inet_aton(ip)
    probe = bytes.fromhex("0001080006040001") + frames.mac + bytes(4) + bytes(6) + target
    for payload in frames.exchange(b"\xff" * 6, probe):
        if payload[6:8] == b"\0\2" and payload[14:18] == target:
            return payload[8:14].hex(":")
    return None


# -- datagrams -------------------------------------------------------------------------------------------------------


class Datagrams:
    """A UDP socket at one of the peer's addresses."""

    def __init__(self, local="", port=0):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.socket.bind((local, port))

    def receive(self, seconds=PATIENCE_SECONDS):
        self.socket.settimeout(max(0.001, seconds))
        try:
            return self.socket.recvfrom(4096)
        except TimeoutError:
            return None

    def ask(self, ip, data, seconds=PATIENCE_SECONDS):
        self.socket.sendto(data, (ip, RPC_PORT))
        found = self.receive(seconds)
        return None if found is None else found[0]


def lookup(ip):
    """The endpoint mapper's listing, one entry a call as engineering tools ask for it."""
    wire, activity = Datagrams(), uuid4()
    handle, entries = NIL_HANDLE, []
    for sequence in range(8):
        body = emit_lookup_request(LookupRequest(handle=handle), little_endian=True)
        pdu = RpcPdu(
            PacketType.REQUEST,
            UUID_EPM,
            activity,
            sequence=sequence,
            opnum=2,
            body=body,
            flags1=0x20,
            interface_version=3,
        )
        answer = parse_rpc(wire.ask(ip, emit_rpc(pdu)))
        found = parse_lookup_response(answer.body, little_endian=answer.little_endian)
        entries += [(str(e.object_uuid), e.annotation) for e in found.entries]
        handle = found.handle
        if found.status or not found.entries:
            break
    return entries


def rpc(ip, vendor, device):
    """Calls that a device must refuse, and the connectionless protocol's own PDUs; what kind of PDU answered each."""
    wire = Datagrams()
    object_id = object_uuid(1, device, vendor)

    def pdu(**changes):
        fields = {
            "packet_type": PacketType.REQUEST,
            "interface": UUID_PNIO_DEVICE,
            "activity": uuid4(),
            "object_uuid": object_id,
            "opnum": Opnum.READ_IMPLICIT,
            "flags1": Flags1.IDEMPOTENT | Flags1.NO_FACK,
        }
        return RpcPdu(**{**fields, **changes})

    def read(index, api=0, slot=0, subslot=1, little=True, room=4096, uuid=NIL_UUID):
        args = RequestArgs(room, IodReadReqHeader(1, uuid, api, slot, subslot, index, room).emit())
        drep = b"\x10\0\0" if little else b"\0\0\0"
        return {"body": emit_request_args(args, little_endian=little), "drep": drep}

    def arguments(payload):
        return emit_request_args(RequestArgs(4096, payload), little_endian=True)

    rubbish = arguments(b"\x01\x01\x00\x10" + bytes(12))
    header = IodWriteReqHeader(1, uuid4(), 0, 0, 1, 0xAFF1)
    im0 = read(0xAFF0)
    asked = {
        "im0": pdu(**im0),
        "im0-big-endian": pdu(**read(0xAFF0, little=False)),
        "unknown-interface": pdu(interface=uuid4(), **im0),
        "wrong-version": pdu(interface_version=7, **im0),
        "unknown-object": pdu(object_uuid=object_uuid(1, device + 1, vendor), **im0),
        "unknown-operation": pdu(opnum=99, **im0),
        "no-body": pdu(),
        "nothing-behind-arguments": pdu(opnum=Opnum.CONNECT, body=arguments(b"")),
        "rubbish-connect": pdu(opnum=Opnum.CONNECT, body=rubbish),
        "rubbish-control": pdu(opnum=Opnum.CONTROL, body=rubbish),
        "rubbish-release": pdu(opnum=Opnum.RELEASE, body=rubbish),
        "rubbish-write": pdu(opnum=Opnum.WRITE, body=rubbish),
        "read-of-unknown-connection": pdu(opnum=Opnum.READ, **read(0xAFF0, uuid=uuid4())),
        "write-of-unknown-connection": pdu(
            opnum=Opnum.WRITE,
            body=arguments(emit_write_request(header, b"12")),
        ),
        "read-no-slot": pdu(**read(0xAFF0, slot=77)),
        "read-no-index": pdu(**read(0x1234)),
        "read-no-api": pdu(**read(0xAFF0, api=5)),
        "read-small-room": pdu(**read(0xAFF0, room=70)),
        "ping": pdu(packet_type=PacketType.PING),
        "cancel": pdu(packet_type=PacketType.CL_CANCEL, body=bytes(8)),
        "fragment": pdu(flags1=Flags1.FRAGMENT, **im0),
        "ack": pdu(packet_type=PacketType.ACK),
        "response-out-of-nothing": pdu(packet_type=PacketType.RESPONSE, **im0),
        "fault-out-of-nothing": pdu(packet_type=PacketType.FAULT, body=bytes(4)),
        "packet-type-31": pdu(packet_type=31),
    }  # fmt: skip
    for index in INDEXES:
        for api, slot, subslot in ((0, 0, 1), (0x3A00, 1, 2)):
            asked[f"read-{index:04x}-{slot}"] = pdu(**read(index, api, slot, subslot))
    answered = {}
    for name, request in asked.items():
        data = wire.ask(
            ip, emit_rpc(request), 0.15 if name.endswith("nothing") or name in {"ack", "packet-type-31"} else 0.4
        )
        answered[name] = None if data is None else PacketType(parse_rpc(data).packet_type & 0x1F).name
    # 1,300 octets that are no RPC at all, and none
    wire.socket.sendto(b"\x55" * 1300, (ip, RPC_PORT))
    wire.socket.sendto(b"", (ip, RPC_PORT))
    wire.socket.sendto(b"nobody listens there", (ip, 161))
    wire.receive(0.2)
    return answered


# -- a captured controller -------------------------------------------------------------------------------------------


def replay(path):
    """The requests of a captured controller, octet for octet; the answers, and the calls that the device made.

    The file has ``local``, ``ip`` and ``requests``.  A call of the device's is answered as a controller answers it.
    """
    plan = json.loads(Path(path).read_text(encoding="utf-8"))
    wire, own = Datagrams(plan["local"]), Datagrams(plan["local"], RPC_PORT)
    found = []
    for text in plan["requests"]:
        answer = wire.ask(plan["ip"], bytes.fromhex(text), 2.0)
        shown = {"answer": None} if answer is None else shown_answer(answer)
        if text == plan["requests"][-1]:
            shown["call"] = taken_call(own)
        found.append(shown)
    return found


def shown_answer(data):
    pdu = parse_rpc(data)
    shown = {"answer": data.hex(), "type": PacketType(pdu.kind).name}
    if pdu.kind == PacketType.RESPONSE:
        args = parse_response_args(pdu.body, little_endian=pdu.little_endian)
        shown |= {"status": int(args.status), "payload": args.payload.hex()}
        shown["blocks"] = [block.block_type for block in split_blocks(args.payload)] if args.status.ok else []
    return shown


def taken_call(own, seconds=2.0):
    """ApplicationReady, answered; its payload, or None when the device did not call."""
    found = own.receive(seconds)
    if found is None:
        return None
    data, peer = found
    pdu = parse_rpc(data)
    args = parse_request_args(pdu.body, little_endian=pdu.little_endian)
    (block, *_) = parse_blocks(args.payload)
    payload = control_response(block).emit()
    body = emit_response_args(ResponseArgs(OK, payload, args.args_maximum), little_endian=pdu.little_endian)
    answer = RpcPdu(
        PacketType.RESPONSE, UUID_PNIO_CONTROLLER, pdu.activity, pdu.object_uuid, pdu.sequence, pdu.opnum, body,
        flags1=Flags1.LAST_FRAGMENT | Flags1.NO_FACK, drep=pdu.drep,
    )  # fmt: skip
    own.socket.sendto(emit_rpc(answer), peer)
    right = pdu.interface == UUID_PNIO_CONTROLLER and block.block_type == BlockType.APPLICATION_READY_REQ
    return {"payload": args.payload.hex(), "right": right}


VERBS = {
    "dcp": lambda *macs: dcp(macs),
    "conflict": conflict,
    "hold": hold,
    "arp": arp,
    "lookup": lookup,
    "rpc": lambda ip: rpc(ip, 0x0105, 1),
    "replay": replay,
}

if __name__ == "__main__":
    print(json.dumps(VERBS[sys.argv[1]](*sys.argv[2:])))
