"""A drive's target with plain data, and a peer that speaks to it octet by octet."""

from dataclasses import replace
from ipaddress import IPv4Address, IPv4Interface

from pnfarm.protocols.enip.adapter import Adapter, AdapterData
from pnfarm.protocols.enip.connection import ConnectionKind, ConnectionSettings, IoOffer
from pnfarm.protocols.enip.encapsulation import EncapsulationSettings, SendDatagram, SendStream, StreamEnd
from pnfarm.protocols.enip.object import Attribute, AttributeObject
from pnfarm.protocols.enip.objects.assembly import AssemblyData
from pnfarm.protocols.enip.objects.ethernet_link import EthernetLinkData
from pnfarm.protocols.enip.objects.identity import IdentityData, identity_key
from pnfarm.protocols.enip.objects.tcp_ip import TcpIpData, multicast_address
from pnfarm.protocols.enip.wire import cpf, encapsulation, epath, message
from pnfarm.protocols.enip.wire import forward_open as fo
from pnfarm.protocols.enip.wire.data_types import DINT
from pnfarm.protocols.enip.wire.encapsulation import Command, EncapsulationPdu

SECOND = 1_000_000_000
PEER = (IPv4Address("10.77.0.1"), 51000)
DRIVE = IPv4Interface("10.77.0.11/24")
OWNER = IoOffer(ConnectionKind.EXCLUSIVE_OWNER, 101, 102, 64, 64, 100)
OFFERS = (
    OWNER,
    IoOffer(ConnectionKind.INPUT_ONLY, 193, 102, 0, 64, 100),
    IoOffer(ConnectionKind.LISTEN_ONLY, 194, 102, 0, 64, 100),
)
MANAGER = epath.logical_path(6, 1)


class Bench:
    """``now`` moves by ``later``; what the drive says is parsed and returned."""

    def __init__(self, limits=EncapsulationSettings(), **connections):  # noqa: B008 - a value that does not change
        self.now = SECOND
        self.numbers = {1: 77, 2: -5}
        self.resets = []
        identity = IdentityData(452, 43, 7, (1, 13), 0xC0FFEE, "AKD", reset=self.reset)
        self.settings = ConnectionSettings(identity_key(identity), OFFERS, multicast_address(DRIVE), **connections)
        numbers = AttributeObject(
            0x0F, {0: {}, **{n: {1: Attribute(DINT, lambda n=n: self.numbers[n], self.writer(n))} for n in (1, 2)}}
        )
        self.drive = Adapter(
            AdapterData(
                identity,
                TcpIpData(DRIVE, host_name="axis-01"),
                EthernetLinkData(bytes.fromhex("020000000011")),
                [
                    AssemblyData(100, 0, lambda: b""),
                    AssemblyData(101, 64, lambda: bytes(64)),
                    AssemblyData(102, 64, lambda: bytes(range(64))),
                ],
                self.settings,
                objects=[numbers],
                encapsulation=limits,
            )
        )
        self.sent = []
        self.events = []

    def reset(self, kind):
        self.resets.append(kind)
        return 0

    def writer(self, number):
        def write(value):
            if abs(value) > 1000:
                return 0x09
            self.numbers[number] = value
            return 0

        return write

    # octets

    def collect(self):
        outputs = self.drive.take_outputs()
        self.sent += outputs
        self.events += self.drive.take_events()
        return outputs

    def replies(self, stream):
        return [
            encapsulation.parse_encapsulation(output.data)
            for output in self.collect()
            if isinstance(output, SendStream) and output.stream == stream
        ]

    def ask(self, pdu, stream=1):
        """The replies to one message."""
        self.drive.received(stream, encapsulation.emit_encapsulation(pdu), self.now)
        return self.replies(stream)

    def datagram(self, data, broadcast=False):
        self.drive.datagram(data, PEER, self.now, broadcast=broadcast)
        return [output for output in self.collect() if isinstance(output, SendDatagram)]

    def later(self, seconds):
        """Time passes, and every deadline is kept on the way."""
        end = self.now + round(seconds * SECOND)
        while (due := self.drive.next_deadline()) is not None and due <= end:
            self.now = max(self.now, due)
            self.drive.handle_timeout(self.now)
        self.now = end
        return self.collect()

    def ended(self, stream=1):
        return StreamEnd(stream) in self.sent

    # sessions and requests

    def register(self, stream=1, peer=PEER):
        self.drive.opened(stream, peer, self.now)
        (reply,) = self.ask(EncapsulationPdu(Command.REGISTER_SESSION, b"\1\0\0\0"), stream)
        assert reply.status == 0
        return reply.session

    def unconnected(self, session, octets, *items, stream=1):
        packet = cpf.CommonPacket((cpf.NullAddress(), cpf.UnconnectedData(octets), *items))
        (reply,) = self.ask(EncapsulationPdu(Command.SEND_RR_DATA, packet.emit(), session, context=b"context!"), stream)
        assert reply.context == b"context!"
        assert reply.status == 0
        _, data, *more = cpf.CommonPacket.parse(reply.data).items
        return message.parse_reply(data.data), more

    def request(self, session, service, path, data=b"", stream=1):
        octets = message.message_request(service, path, data).emit()
        return self.unconnected(session, octets, stream=stream)[0]

    def open(self, session, request, *items, stream=1):
        """The Connection Manager's reply to a Forward_Open."""
        octets = message.message_request(0x5B if request.large else 0x54, MANAGER, fo.emit_forward_open(request)).emit()
        return self.unconnected(session, octets, *items, stream=stream)

    def opened(self, session, request, *items, stream=1):
        reply, more = self.open(session, request, *items, stream=stream)
        assert (reply.status, reply.extended) == (0, ())
        return fo.ForwardOpenReply.parse(reply.data), more

    def close(self, session, triad, stream=1):
        body = fo.ForwardClose(triad, b"").emit()
        return self.request(session, 0x4E, MANAGER, body, stream)

    def take(self, kind):
        found = [event for event in self.events if isinstance(event, kind)]
        self.events = []
        return found


def io_request(serial=1, kind=fo.ConnectionType.MULTICAST, points=(100, 101, 102), o_to_t=70, t_to_o=66, **more):
    """A Forward_Open of the manual's connection; every part may be another."""
    key = more.pop("key", None)
    configuration = more.pop("configuration", b"")
    class_id = more.pop("class_id", 4)
    path = (*([key] if key else []), *epath.logical_path(class_id, points[0], None, *points[1:]), *more.pop("more", []))
    if configuration:
        path = (*path, epath.DataSegment(configuration))
    fields = {
        "triad": fo.Triad(serial, 0x4D, 0xDEADBEEF),
        "o_to_t_id": 0,
        "t_to_o_id": 0x00990000 | serial,
        "o_to_t_rpi_us": 10_000,
        "o_to_t": fo.NetworkParameters(o_to_t),
        "t_to_o_rpi_us": 10_000,
        "t_to_o": fo.NetworkParameters(t_to_o, kind),
        "transport": fo.TransportClass(1),
        "path": epath.emit_epath(path),
        "timeout_multiplier": 2,
    }
    return fo.ForwardOpen(**(fields | more))


def explicit_request(serial=9, size=504, **more):
    base = io_request(serial)
    parameters = fo.NetworkParameters(size, fo.ConnectionType.POINT_TO_POINT, 0, variable=True)
    return replace(
        base,
        **{
            "o_to_t": parameters,
            "t_to_o": parameters,
            "transport": fo.TransportClass(3, 2, server=True),
            "path": epath.emit_epath(epath.logical_path(2, 1)),
            "o_to_t_rpi_us": 1_000_000,
            "large": size > 511,
            **more,
        },
    )
