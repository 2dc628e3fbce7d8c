"""Captured calls replayed through both ends, and both ends' octets in the eyes of Wireshark and scapy."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from uuid import UUID

import pytest
from cm_support import UUID_1
from rpc_support import (
    ADDRESS,
    MS,
    OBJECT,
    PEER,
    Network,
    Station,
    about,
    fragments,
    put,
    received,
    request,
    sent,
    server,
)
from wireshark import tshark, tshark_fields

from pnfarm.protocols.profinet.rpc.client import RpcClient
from pnfarm.protocols.profinet.rpc.endpoints import Endpoint
from pnfarm.protocols.profinet.rpc.server import CallReceived, Interface, Peer, RpcServer, RpcServerConfig
from pnfarm.protocols.profinet.wire.records.iod import (
    IodReadReqHeader,
    IodReadResHeader,
    IodWriteReqHeader,
    IodWriteResHeader,
    emit_read_response,
    emit_write_request,
    emit_write_response,
)
from pnfarm.protocols.profinet.wire.rpc.bodies import CancelBody
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    OK,
    RPC_PORT,
    UUID_PNIO_CONTROLLER,
    UUID_PNIO_DEVICE,
    Flags1,
    NcaStatus,
    Opnum,
    PacketType,
    PnioStatus,
    RpcPdu,
    emit_rpc,
    parse_request_args,
    parse_response_args,
    parse_rpc,
)

CAPTURES = Path(__file__).resolve().parents[3].parent / "shared" / "captures"
NAMES = ("drive_connect_api3a00.pcap", "dacookie_connectrequest.pcap", "pnio-rs_s7-1515_golden.pcap")


# -- captures --------------------------------------------------------------------------------------------------------


def captured(name: str) -> list[tuple[Peer, Peer, RpcPdu]]:
    """(from, to, PDU) of every context management datagram, in order."""
    path = CAPTURES / name
    if not path.exists():
        pytest.skip(f"{name} is not here")
    from ipaddress import IPv4Address

    from scapy.layers.inet import IP, UDP
    from scapy.utils import rdpcap

    ports, found = {RPC_PORT}, []
    for packet in rdpcap(str(path)):
        if UDP in packet and ports & {packet[UDP].sport, packet[UDP].dport}:
            # a peer may go on from another port than it was called at
            ports |= {packet[UDP].sport, packet[UDP].dport}
            source = Peer(IPv4Address(packet[IP].src), packet[UDP].sport)
            target = Peer(IPv4Address(packet[IP].dst), packet[UDP].dport)
            found.append((source, target, parse_rpc(bytes(packet[UDP].payload))))
    return found


def exchanges(name: str) -> list[tuple[Peer, RpcPdu, RpcPdu]]:
    """(client, question, answer), matched by activity and sequence."""
    datagrams = captured(name)
    found = []
    for number, (client, _, asked) in enumerate(datagrams):
        if asked.kind not in {PacketType.REQUEST, PacketType.PING}:
            continue
        key = (asked.activity, asked.sequence)
        answer = next(pdu for _, to, pdu in datagrams[number + 1 :] if (pdu.activity, pdu.sequence) == key)
        found.append((client, asked, answer))
    return found


@pytest.mark.parametrize("name", NAMES)
def test_captured_calls_are_answered_as_the_captured_server_did(name):
    rows = exchanges(name)
    assert len(rows) >= 4
    objects = {(asked.interface, asked.object_uuid) for _, asked, _ in rows}
    assert {interface for interface, _ in objects} == {UUID_PNIO_DEVICE, UUID_PNIO_CONTROLLER}
    # one server for both roles: each captured object has its own interface
    endpoints = tuple(Endpoint(uuid, "captured", interface) for interface, uuid in objects)
    interfaces = tuple(Interface(uuid) for uuid in (UUID_PNIO_DEVICE, UUID_PNIO_CONTROLLER))
    device = RpcServer(RpcServerConfig(interfaces=interfaces, endpoints=endpoints), ADDRESS)
    for client, asked, wanted in rows:
        # the boot time that the captured client had learnt is the captured server's
        got = put(device, asked, peer=client)
        if asked.kind == PacketType.REQUEST:
            assert got == []
            call = received(device)
            args = parse_request_args(asked.body, little_endian=asked.little_endian)
            assert (call.payload, call.args_maximum, call.opnum) == (args.payload, args.args_maximum, asked.opnum)
            answer = parse_response_args(wanted.body, little_endian=wanted.little_endian)
            assert device.respond(call.call, answer.status, answer.payload, 0)
            got = sent(device)
        [got] = got
        assert (got.kind, got.fragment_number) == (wanted.kind, wanted.fragment_number)
        if got.little_endian == wanted.little_endian:
            assert got.body == wanted.body
        else:  # one captured device speaks big-endian to everybody
            ours, theirs = (parse_response_args(pdu.body, little_endian=pdu.little_endian) for pdu in (got, wanted))
            assert ours == theirs
        assert (got.object_uuid, got.interface, got.activity) == (wanted.object_uuid, wanted.interface, wanted.activity)
        assert (got.sequence, got.opnum, got.drep) == (wanted.sequence, wanted.opnum, asked.drep)
    assert not device.dropped


@pytest.mark.parametrize("name", NAMES)
def test_the_client_calls_as_the_captured_ones_did(name):
    for client, asked, wanted in exchanges(name):
        if asked.kind != PacketType.REQUEST:
            continue
        caller = RpcClient(lambda asked=asked: asked.activity)
        args = parse_request_args(asked.body, little_endian=asked.little_endian)
        target = Peer(ADDRESS, RPC_PORT)
        caller.call(
            target,
            client.port,
            asked.interface,
            asked.object_uuid,
            asked.opnum,
            args.args_maximum,
            args.payload,
            0,
            little_endian=asked.little_endian,
        )
        [datagram] = caller.to_send(0)
        ours = parse_rpc(datagram.data)
        # where the captured calls were in their activities, and what they knew of the server
        same = {"sequence": asked.sequence, "serial": asked.serial, "server_boot_time": asked.server_boot_time}
        assert emit_rpc(replace(ours, **same)) == emit_rpc(replace(asked, activity_hint=0xFFFF, interface_hint=0xFFFF))
        caller.receive(target, client.port, emit_rpc(replace(wanted, sequence=ours.sequence)), 0)
        [event] = caller.events()
        assert event.payload == parse_response_args(wanted.body, little_endian=wanted.little_endian).payload


@pytest.mark.parametrize("name", NAMES)
def test_application_ready_names_the_controllers_object(name):
    """The object of a call to a controller is the CMInitiatorObjectUUID of its Connect, not the device's own."""
    pdus = [asked for _, asked, _ in exchanges(name) if asked.kind == PacketType.REQUEST]
    [connect] = [pdu for pdu in pdus if pdu.opnum == Opnum.CONNECT]
    [ready] = [pdu for pdu in pdus if pdu.interface == UUID_PNIO_CONTROLLER]
    assert ready.object_uuid.bytes in connect.body
    assert ready.object_uuid != connect.object_uuid


# -- Wireshark -------------------------------------------------------------------------------------------------------


def written(path: Path, datagrams: list[tuple[Peer, Peer, bytes]]) -> Path:
    from scapy.layers.inet import IP, UDP
    from scapy.layers.l2 import Ether
    from scapy.utils import wrpcap

    packets = [
        Ether(src="02:00:00:00:00:01", dst="02:00:00:00:00:02")
        / IP(src=str(source.ip), dst=str(target.ip))
        / UDP(sport=source.port, dport=target.port)
        / data
        for source, target, data in datagrams
    ]
    wrpcap(str(path), packets)
    return path


def looks_well(path: Path, frames: int) -> None:
    fields = ["frame.number", "_ws.malformed", "_ws.expert.message", "_ws.col.Protocol", "_ws.col.Info"]
    rows = tshark_fields(path, *fields)
    assert len(rows) == frames
    for row in rows:
        assert row[1:3] == ["", ""], row
        assert row[3] in {"DCERPC", "PNIO-CM", "PNIO (Device Interface)"}, row


@pytest.mark.parametrize("little", [False, True])
def test_wireshark_reads_a_fragmented_exchange_each_way(tmp_path, little):
    read_size, write_size = 60_000, 4_096

    def serve(event: CallReceived) -> bytes:
        if event.opnum == Opnum.READ:
            asked = IodReadReqHeader.parse(event.payload)
            header = IodReadResHeader(1, asked.ar_uuid, 0, 0, 1, asked.index, read_size)
            return emit_read_response(header, bytes(read_size))
        return emit_write_response((IodWriteResHeader(2, UUID_1, 0, 0, 1, 2, 0, 0, 0, OK),))

    net = Network([one := Station(Peer(ADDRESS, RPC_PORT), answer=serve)])
    client = net.client("10.77.0.1")
    read = IodReadReqHeader(1, UUID_1, 0, 0, 1, 1, read_size).emit()
    net.call(client, one, read, little_endian=little)
    net.run(1_000 * MS)
    write = emit_write_request(IodWriteReqHeader(2, UUID_1, 0, 0, 1, 2), bytes(write_size))
    net.call(client, one, write, opnum=Opnum.WRITE, little_endian=little)
    net.run(2_000 * MS)
    assert len(net.outcomes) == 2
    path = written(tmp_path / "fragments.pcap", net.seen)
    looks_well(path, len(net.seen))
    fields = ("-T", "fields", "-e", "pn_io.opnum", "-e", "dcerpc.reassembled.length")
    whole = tshark(path, "-Y", "dcerpc.fragments", *fields)
    assert [line.split("\t") for line in whole.splitlines()] == [
        ["2", str(20 + 64 + read_size)],
        ["3", str(20 + 64 + write_size)],
    ]


@pytest.mark.parametrize("little", [False, True])
def test_wireshark_reads_every_kind_of_pdu(tmp_path, little):
    device = server(boot_time=77)
    record = emit_write_request(IodWriteReqHeader(2, UUID_1, 0, 0, 1, 2), bytes(3_000))
    short = emit_write_request(IodWriteReqHeader(2, UUID_1, 0, 0, 1, 2), b"1234")
    call = request(1, record, little=little, opnum=Opnum.WRITE)
    parts = fragments(call)
    seen: list[tuple[Peer, Peer, bytes]] = []
    client = Peer(PEER.ip, 49152)

    def exchange(pdu: RpcPdu) -> None:
        seen.append((client, Peer(ADDRESS, RPC_PORT), emit_rpc(pdu)))
        device.receive(client, RPC_PORT, emit_rpc(pdu), 0)
        flush()

    def flush() -> None:
        seen.extend((Peer(ADDRESS, d.local_port), d.peer, d.data) for d in device.to_send(0))

    exchange(about(call, PacketType.PING))  # nocall
    exchange(parts[0])  # fack
    exchange(about(call, PacketType.PING))  # nocall with a body
    for part in parts[1:]:
        exchange(part)
    exchange(about(call, PacketType.PING))  # working
    exchange(about(call, PacketType.CL_CANCEL))  # orphan
    exchange(request(2, short, little=little, opnum=77))  # reject
    exchange(request(3, short, little=little, opnum=Opnum.WRITE, server_boot_time=76))  # reject, wrong boot time
    exchange(request(4, short, little=little, opnum=Opnum.WRITE))
    for event in device.events():
        if isinstance(event, CallReceived):
            device.fault(event.call, NcaStatus.FAULT_UNSPEC, 0)
    flush()
    exchange(request(5, short, little=little, opnum=Opnum.WRITE))
    status = PnioStatus(0xDF, 0x81, 0x40, 5)
    header = IodWriteResHeader(2, UUID_1, 0, 0, 1, 2, 0, 0, 0, status)
    for event in device.events():
        if isinstance(event, CallReceived):
            device.respond(event.call, status, emit_write_response((header,)), 0)
    flush()
    exchange(about(request(5, little=little), PacketType.ACK))
    kinds = {parse_rpc(data).kind for _, _, data in seen}
    assert kinds == set(PacketType)
    looks_well(written(tmp_path / "kinds.pcap", seen), len(seen))


def test_wireshark_reads_a_cancel_with_its_number(tmp_path):
    device = server()
    put(device, request(1))
    cancel = about(request(1), PacketType.CL_CANCEL, body=CancelBody(7).emit(little_endian=True))
    [ack] = put(device, cancel)
    client, own = Peer(PEER.ip, 49152), Peer(ADDRESS, RPC_PORT)
    path = written(tmp_path / "cancel.pcap", [(client, own, emit_rpc(cancel)), (own, client, emit_rpc(ack))])
    looks_well(path, 2)
    text = tshark(path, "-V")
    assert text.count("Cancel ID: 7") == 2
    assert "Server accepting cancels: True" in text


# -- scapy -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("little", [False, True])
def test_scapy_reads_the_fragments_and_facks_of_both_ends(little):
    from scapy.layers.dcerpc import DceRpc4

    net = Network([one := Station(Peer(ADDRESS, RPC_PORT), answer=lambda _: bytes(5_000))])
    net.call(net.client("10.77.0.1"), one, bytes(4_000), little_endian=little)
    net.run(1_000 * MS)
    assert len(net.outcomes) == 1
    kinds = set()
    for _, _, data in net.seen:
        ours, theirs = parse_rpc(data), DceRpc4(data)
        assert (theirs.ptype, theirs.seqnum, theirs.fragnum, theirs.len) == (
            ours.kind,
            ours.sequence,
            ours.fragment_number,
            len(ours.body),
        )
        assert (theirs.act_id, theirs.object, theirs.if_id) == (ours.activity, OBJECT, UUID_PNIO_DEVICE)
        assert UUID(str(theirs.object)) == ours.object_uuid
        assert (theirs.serial_hi << 8 | theirs.serial_lo) == ours.serial
        assert bool(theirs.flags1.frag) == bool(ours.flags1 & Flags1.FRAGMENT)
        assert bool(theirs.flags1.last_frag) == bool(ours.flags1 & Flags1.LAST_FRAGMENT)
        assert bool(theirs.flags1.no_frag_ack) == bool(ours.flags1 & Flags1.NO_FACK)
        assert bool(theirs.endian) is little
        kinds.add(ours.kind)
    assert kinds == {PacketType.REQUEST, PacketType.RESPONSE, PacketType.FACK}
