"""What both ends say to each other, in the eyes of Wireshark, from a capture that was never on a wire."""

import struct
from ipaddress import IPv4Address

import pytest
from enip_bench import DRIVE, PEER, Bench, explicit_request, io_request
from wireshark import tshark

from pnfarm.links.capture.pcap import PcapngWriter
from pnfarm.protocols.enip.encapsulation import SendDatagram, SendStream
from pnfarm.protocols.enip.identity_search import IdentitySearch
from pnfarm.protocols.enip.originator import Originator
from pnfarm.protocols.enip.originator_events import ConnectionMade, SendTcp
from pnfarm.protocols.enip.wire import message
from pnfarm.protocols.enip.wire.class1 import Class1Pdu, emit_class1
from pnfarm.protocols.enip.wire.cpf import CommonPacket, ConnectedAddress, ConnectedData
from pnfarm.protocols.enip.wire.encapsulation import ENIP_PORT, Command, EncapsulationPdu, emit_encapsulation
from pnfarm.protocols.enip.wire.epath import ElectronicKey, logical_path
from pnfarm.wire.ethernet import EthernetFrame, emit_ethernet
from pnfarm.wire.ipv4 import Ipv4Packet, emit_ipv4
from pnfarm.wire.udp import UdpDatagram, emit_udp

pytestmark = pytest.mark.interop

MACS = bytes.fromhex("020000000001"), bytes.fromhex("020000000011")
ADDRESSES = PEER[0], DRIVE.ip
MULTICAST_MAC = bytes.fromhex("01005e000000")


class Tape:
    """Octets of one TCP connection and datagrams, as frames in a file; time moves by a millisecond each."""

    def __init__(self, path):
        self.path = path
        self._writer = PcapngWriter(path)
        self._interface = self._writer.add_interface("enip")
        self._time = 10**18
        self._next = [1000, 5000]
        self._open()

    def _open(self):
        for side, flags in ((0, 0x02), (1, 0x12), (0, 0x10)):
            self._segment(side, b"", flags)
            if flags & 2:
                self._next[side] += 1

    def tcp(self, side, data):
        self._segment(side, data, 0x18)
        self._next[side] += len(data)

    def _segment(self, side, data, flags):
        ports = (PEER[1], ENIP_PORT) if side == 0 else (ENIP_PORT, PEER[1])
        acknowledged = self._next[1 - side] if flags & 0x10 else 0
        header = struct.pack("!HHIIBBHHH", *ports, self._next[side], acknowledged, 0x50, flags, 65535, 0, 0)
        self._ip(side, 6, header + data, ADDRESSES[1 - side])

    def udp(self, side, data, ports, destination=None):
        destination = destination or ADDRESSES[1 - side]
        datagram = emit_udp(UdpDatagram(*ports, data), ADDRESSES[side], destination)
        self._ip(side, 17, datagram, destination)

    def _ip(self, side, protocol, payload, destination):
        packet = emit_ipv4(Ipv4Packet(ADDRESSES[side], destination, protocol, payload))
        mac = MACS[1 - side]
        if destination.is_multicast:
            mac = MULTICAST_MAC[:3] + (int(destination) & 0x7FFFFF).to_bytes(3, "big")
        self._time += 1_000_000
        frame = emit_ethernet(EthernetFrame(mac, MACS[side], 0x0800, packet))
        self._writer.write(self._interface, frame, self._time, "in")

    def close(self):
        self._writer.close()


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """A search, a session, reads, writes, errors, connections of each kind with their data, and their ends."""
    tape = Tape(tmp_path_factory.mktemp("enip") / "enip.pcapng")
    bench, originator = Bench(), Originator()
    bench.drive.opened(1, PEER, bench.now)
    originator.opened(bench.now)

    def exchange():
        while True:
            out = [output for output in originator.take_outputs() if isinstance(output, SendTcp)]
            for output in out:
                tape.tcp(0, output.data)
                bench.drive.received(1, output.data, bench.now)
            back = [output for output in bench.collect() if isinstance(output, SendStream)]
            for output in back:
                tape.tcp(1, output.data)
                originator.received(output.data, bench.now)
            if not out and not back:
                return originator.take_events()

    exchange()
    search = IdentitySearch(500)
    tape.udp(0, search.question(), (50_000, ENIP_PORT))
    (answer,) = bench.datagram(search.question())
    assert isinstance(answer, SendDatagram)
    tape.udp(1, answer.data, (ENIP_PORT, 50_000))
    for command in (Command.LIST_SERVICES, Command.LIST_IDENTITY, Command.LIST_INTERFACES):
        octets = emit_encapsulation(EncapsulationPdu(command))
        tape.tcp(0, octets)
        bench.drive.received(1, octets, bench.now)
        exchange()
    reads = [message.message_request(0x0E, logical_path(class_id, 1, 1)) for class_id in (1, 2, 6, 0xF5, 0xF6, 0x0F)]
    whole = [message.message_request(0x01, logical_path(class_id, 1)) for class_id in (1, 2, 6, 0xF5)]
    several = message.emit_multiple_service([request.emit() for request in reads])
    others = [
        message.message_request(0x03, logical_path(1, 1), b"\2\0\1\0\7\0"),
        message.message_request(0x0A, logical_path(2, 1), several),
        message.message_request(0x0E, logical_path(0x0F, 1, 99)),
        message.message_request(0x10, logical_path(0x0F, 1, 1), b"\1\0\0\0"),
        message.message_request(0x05, logical_path(1, 1), b"\0"),
    ]
    for request in (*reads, *whole, *others):
        originator.request(request, bench.now)
        exchange()
    opens = [
        io_request(1, key=ElectronicKey(452, 43, 7, 1, 13)),
        io_request(2, points=(100, 194, 102), o_to_t=2),
        io_request(3, kind=2, points=(100, 193, 102), o_to_t=2, large=True),
        explicit_request(4),
        io_request(5, o_to_t=64),
    ]
    made = []
    for request in opens:
        originator.forward_open(request, bench.now)
        made += [event for event in exchange() if isinstance(event, ConnectionMade)]
    assert len(made) == 4
    owner, listener, inputs, explicit = made
    for count in range(1, 4):
        for one, data, header in ((owner, bytes(64), 1), (listener, b"", None), (inputs, b"", None)):
            octets = emit_class1(Class1Pdu(one.reply.o_to_t_id, count, count, data, header))
            tape.udp(0, octets, (2222, 2222))
        for one, destination in ((owner, owner.items[1].address), (inputs, IPv4Address(PEER[0]))):
            octets = emit_class1(Class1Pdu(one.reply.t_to_o_id, count, count, bytes(range(64))))
            tape.udp(1, octets, (2222, 2222), destination)
    for count, request in enumerate(reads, 1):
        data = count.to_bytes(2, "little") + request.emit()
        packet = CommonPacket((ConnectedAddress(explicit.reply.o_to_t_id), ConnectedData(data)))
        octets = emit_encapsulation(EncapsulationPdu(Command.SEND_UNIT_DATA, packet.emit(), originator.session))
        tape.tcp(0, octets)
        bench.drive.received(1, octets, bench.now)
        exchange()
    for request in (*opens[1:], opens[0]):
        originator.forward_close(request.triad, request.path, bench.now)
        exchange()
    originator.unregister(bench.now)
    exchange()
    tape.close()
    return tape.path


def test_wireshark_finds_nothing_malformed_and_no_error(capture):
    suspect = "_ws.malformed or _ws.expert.severity >= 0x800000 or _ws.short"
    assert tshark(capture, "-Y", suspect) == ""


def test_wireshark_reads_every_frame_as_what_it_is(capture):
    def count(what):
        return len(tshark(capture, "-Y", what).splitlines())

    assert count("enip") > 60
    assert count("cipcm") >= 10
    assert count("cipio") + count("enip.cpf.typeid == 0x8002") >= 15
    assert count("data and not enip") == 0
    for what in ("cip.sc == 0x54", "cip.sc == 0x5b", "cip.sc == 0x4e", "cip.sc == 0x0a", "enip.command == 0x70"):
        assert count(what) >= 2, what


def test_wireshark_agrees_on_identity_and_refusals(capture):
    def values(field, what):
        rows = tshark(capture, "-Y", what, "-T", "fields", "-e", field).split()
        return {int(number, 0) for row in rows for number in row.split(",")}

    assert values("enip.lir.vendor", "enip.lir.vendor") == {452}
    assert 0x0127 in values("cip.cm.ext_status", "cip.cm.ext_status")
    assert 0x14 in values("cip.genstat", "cip.genstat")
