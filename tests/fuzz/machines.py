"""The protocol machines and whole stations that are fuzzed: a connected drive, and its controller.

A machine's inputs are frames, datagrams and calls that were good, changed at one depth and wrapped again with the right
lengths and checksums, so that what is wrong reaches the layer that it is meant for.
"""

from __future__ import annotations

import gc
from contextlib import suppress
from dataclasses import replace
from ipaddress import IPv4Address
from random import Random
from uuid import UUID

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.alarms.channel import AlarmChannel, AlarmReceived, AlarmRefusedError
from pnfarm.protocols.profinet.errors import RecordError
from pnfarm.protocols.profinet.lldp.agent import MAXIMUM_NEIGHBOURS
from pnfarm.protocols.profinet.rpc.events import CallKey
from pnfarm.protocols.profinet.rpc.fragments import Peer
from pnfarm.protocols.profinet.snmp.agent import MAXIMUM_MESSAGE
from pnfarm.protocols.profinet.wire.alarms.notification import AlarmNotification, acknowledge
from pnfarm.protocols.profinet.wire.alarms.rta import parse_rta
from pnfarm.protocols.profinet.wire.cm.connect import AlarmCrBlockReq
from pnfarm.protocols.profinet.wire.dcp.blocks import OptionId, UnknownBlock
from pnfarm.protocols.profinet.wire.dcp.pdu import IDENTIFY_MULTICAST
from pnfarm.protocols.profinet.wire.frame_id import ALARM_HIGH
from pnfarm.protocols.profinet.wire.lldp.pdu import LLDP_MULTICAST
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    RPC_PORT,
    PacketType,
    PnioStatus,
    emit_rpc,
    parse_rpc,
)
from pnfarm.protocols.profinet.wire.snmp.message import (
    parse_snmp,
)
from pnfarm.wire.ethernet import (
    ETHERTYPE_IPV4,
    ETHERTYPE_LLDP,
    ETHERTYPE_PROFINET,
    EthernetFrame,
    emit_ethernet,
    parse_ethernet,
)
from pnfarm.wire.ipv4 import emit_ipv4, parse_ipv4
from pnfarm.wire.udp import emit_udp, parse_udp
from tests.fuzz.corpus import Conversation
from tests.fuzz.malformed import UDP, about_a_call, deep, deep_blocks, deep_rpc, varied_snmp
from tests.fuzz.mutate import mutated, random_octets, variation

__all__ = ["MACHINES", "Machine"]

#: Inputs between two moments in which time passes and a lost connection comes back.
BETWEEN = 20
PEER = IPv4Address("10.77.1.250")


class Machine:
    """One end of a fresh conversation; ``feed`` what ``next_input`` made."""

    name = ""

    def __init__(self, rng: Random, layers: dict[str, list[bytes]]) -> None:
        self.layers = layers
        self._made = 0
        self.calls = self.answers = 0
        self.start(rng)

    def start(self, rng: Random) -> None:
        """A new conversation, with its connection up."""
        self.talk = Conversation(rng.choice(("legacy", "advanced")))
        self.talk.untap()
        self.line = self.talk.line
        self.station = self.line.farm.stations[0]
        self.session = self.line.plc.sessions[0]

    def revive(self, rng: Random) -> None:
        """Time passes; a connection that was lost comes back, in a new conversation if it must."""
        self.line.run(rng.choice((0.001, 0.005, 0.05, 0.3)))
        if not self.line.world.run(2.0, until=lambda: self.line.plc.all_connected):
            self.start(rng)
            gc.collect()  # the old one is a ring of objects around large tables

    def renewed(self, octets: bytes) -> bytes:
        """With the live connection's UUID in place of those that the corpus knows."""
        live = self.session.ar_uuid
        for known in self.layers["ar-uuid"]:
            octets = octets.replace(known, live.bytes) if live is not None else octets
        return octets

    def renewed_frame(self, frame: bytes) -> bytes:
        """The same within a frame, and its checksums right again."""
        try:
            ether = parse_ethernet(frame)
            if ether.ethertype != ETHERTYPE_IPV4:
                return frame
            packet = parse_ipv4(ether.payload)
            datagram = parse_udp(packet.payload)
        except DecodeError:
            return frame
        datagram = replace(datagram, data=self.renewed(datagram.data))
        packet = replace(packet, payload=emit_udp(datagram, packet.source, packet.destination))
        return emit_ethernet(replace(ether, payload=emit_ipv4(packet)))

    @property
    def now(self) -> int:
        return self.line.world.now

    def prepared_input(self, rng: Random) -> bytes:
        """The next input, for a machine that is as it must be."""
        self._made += 1
        if self._made % BETWEEN == 0:
            self.revive(rng)
        return self.next_input(rng)

    def next_input(self, rng: Random) -> bytes:
        raise AssertionError("each machine makes its own")

    def take(self, rng: Random, data: bytes) -> None:
        raise AssertionError("each machine takes its own")

    def feed(self, rng: Random, data: bytes) -> str:
        """``answered`` when it made the drive or the controller say something, else ``silent``."""
        before = self.said()
        self.take(rng, data)
        after = self.said()
        return "answered" if after > before else "silent"

    def said(self) -> int:
        """Frames and answers so far."""
        return self.line.farm.link.counters.sent + self.line.plc.link.counters.sent + self.answers

    def settle(self) -> None:
        self.line.farm.settle(self.station, self.now)


class Station(Machine):
    """A whole drive: frames at its port."""

    name = "station"
    to_drive = True

    def __init__(self, rng, layers):
        super().__init__(rng, layers)
        self.frames = [frame for to_drive, frame in self.talk.frames if to_drive == self.to_drive]
        # some of the other way's and of the captured frames, too
        self.frames += rng.sample(layers["frame"], 20)

    def next_input(self, rng):
        frame = rng.choice(self.frames)
        if rng.random() < 0.5:
            frame = self.address + frame[6:]
        return deep(rng, self.renewed_frame(frame) if rng.random() < 0.8 else frame, self.frames)

    @property
    def address(self):
        return self.station.port.mac

    def take(self, rng, data):
        self.line.farm.receive(self.station.port.index, data, self.now)


class Controller(Station):
    """The whole controller: frames at its port."""

    name = "controller"
    to_drive = False

    @property
    def address(self):
        return self.line.plc.port.mac

    def take(self, rng, data):
        self.line.plc.receive(self.line.plc.port.index, data, self.now)


class DcpDeviceMachine(Machine):
    name = "dcp-device"

    def next_input(self, rng):
        return variation(rng, self.layers["dcp"])

    def revive(self, rng):
        """First the drive gets back the name and the address that the inputs took from it."""
        for octets in self.layers["dcp-repair"]:
            self.line.run(0.001)
            self.station.device.dcp.receive(self.frame_to(self.station.port.mac, octets), self.now)
            self.settle()
        super().revive(rng)

    def frame_to(self, destination, data):
        return EthernetFrame(destination, self.line.plc.port.mac, ETHERTYPE_PROFINET, data)

    def take(self, rng, data):
        destination = rng.choice((self.station.port.mac, self.station.port.mac, IDENTIFY_MULTICAST))
        self.station.device.dcp.receive(self.frame_to(destination, data), self.now)
        self.settle()


class DcpClientMachine(DcpDeviceMachine):
    name = "dcp-client"
    xid = 0

    def take(self, rng, data):
        client = self.line.plc.dcp
        # answers count only under the number of an open request
        if rng.random() < 0.5:
            mac = self.station.port.mac
            ask = rng.choice(
                (
                    lambda: client.get(mac, [OptionId(2, 2)], now=self.now),
                    lambda: client.set_name(mac, "axis-01", now=self.now),
                    lambda: client.identify([UnknownBlock(0xFF, 0xFF, b"", None)], now=self.now, window_ns=10**8),
                )
            )
            self.xid = ask()
        if len(data) > 8 and rng.random() < 0.9:
            data = data[:4] + self.xid.to_bytes(4, "big") + data[8:]
        client.receive(EthernetFrame(self.line.plc.port.mac, self.station.port.mac, ETHERTYPE_PROFINET, data), self.now)
        self.answers += len(client.events())
        client.to_send(self.now)


class IpHostMachine(Machine):
    name = "ip-host"

    def next_input(self, rng):
        kind = rng.choice(("ipv4", "ipv4", "arp"))
        if kind == "arp" or rng.random() < 0.5:
            return (b"\x08\x06" if kind == "arp" else b"\x08\x00") + variation(rng, self.layers[kind])
        packet = parse_ipv4(rng.choice(self.layers["ipv4"]))
        own = self.station.device.ip.address.ip if self.station.device.ip.address else IPv4Address("10.77.0.11")
        payload = mutated(rng, packet.payload, self.layers["udp"])[:1480]
        if packet.protocol == UDP and rng.random() < 0.5:
            datagram = parse_udp(packet.payload)
            datagram = replace(datagram, data=mutated(rng, datagram.data, self.layers["rpc"])[:1472])
            payload = emit_udp(datagram, packet.source, own)
        packet = replace(
            packet, destination=own, payload=payload,
            identification=rng.randrange(4), more_fragments=rng.random() < 0.4,
            fragment_offset=8 * rng.choice((0, 0, 1, 2, 185, 8191)),
        )  # fmt: skip
        try:
            return b"\x08\x00" + emit_ipv4(packet)
        except ValueError:
            return b"\x08\x00" + random_octets(rng)

    def take(self, rng, data):
        """From the EtherType on; the farm drops shorter frames before they are the host's."""
        mac, peer = self.station.port.mac, self.line.plc.port.mac
        try:
            frame = parse_ethernet(mac + peer + data)
        except DecodeError:
            return
        self.station.device.ip.receive(frame, self.now)
        self.settle()


class RpcServerMachine(Machine):
    name = "rpc-server"

    def next_input(self, rng):
        data = self.renewed(rng.choice(self.layers["rpc"]))
        try:
            return self.about_a_call(rng, deep_rpc(rng, data, self.layers["rpc"], rng.choice((4, 5, 6))))
        except (DecodeError, ValueError):
            return variation(rng, self.layers["rpc"])

    def about_a_call(self, rng, data):
        endpoint = self.station.device.rpc.config.endpoints[0]
        return about_a_call(rng, data, (endpoint.interface, endpoint.object_uuid))

    def take(self, rng, data):
        self.station.device.rpc.receive(Peer(PEER, rng.choice((RPC_PORT, 49153))), RPC_PORT, data, self.now)
        self.settle()


class RpcClientMachine(RpcServerMachine):
    """Answers to calls that are open: their activity and sequence put in."""

    name = "rpc-client"

    def about_a_call(self, rng, data):
        """Mostly answers, of which those that end a call are few."""
        pdu = parse_rpc(data)
        if rng.random() < 0.5:
            kinds = (PacketType.WORKING, PacketType.NOCALL, PacketType.FACK, PacketType.RESPONSE, PacketType.CANCEL_ACK)
            kind = rng.choice(kinds)
            body = pdu.body if kind == PacketType.RESPONSE else mutated(rng, b"", self.layers["fack"])
            flags = rng.choice((0, 2, 4, 6, 12, 14))
            number = rng.choice((0, 0, 1, 2, 0xFFFF))
            pdu = replace(pdu, packet_type=kind, flags1=flags, fragment_number=number, body=body)
        return emit_rpc(pdu)

    def take(self, rng, data):
        client = self.station.device.client
        peer = Peer(PEER, RPC_PORT)
        if client.open_calls == 0:
            interface = parse_rpc(self.layers["rpc"][0]).interface
            client.call(peer, 49152, interface, interface, 4, 4096, bytes(rng.choice((40, 4000))), self.now)
        sent = [parse_rpc(datagram.data) for datagram in client.to_send(self.now)]
        self.open = sent[-1] if sent else getattr(self, "open", None)
        if self.open is not None and rng.random() < 0.8:
            try:
                pdu = parse_rpc(data)
                data = emit_rpc(
                    replace(
                        pdu, activity=self.open.activity, sequence=self.open.sequence, interface=self.open.interface
                    )
                )
            except (DecodeError, ValueError):
                pass  # rubbish goes in as it is
        client.receive(peer, 49152, data, self.now)
        self.answers += len(client.events())


class SnmpAgentMachine(Machine):
    """Messages of managers, some with their list of variables changed and the lengths around it right."""

    name = "snmp-agent"

    def next_input(self, rng):
        return varied_snmp(rng, self.layers["snmp"])

    def take(self, rng, data):
        self.station.device.snmp.receive(Peer(PEER, 40_000), data, self.now)
        answers = self.station.device.snmp.to_send(self.now)
        assert len(answers) <= 1
        for answer in answers:
            assert len(answer.data) <= MAXIMUM_MESSAGE
            parse_snmp(answer.data)
        self.answers += len(answers)
        self.settle()


class CmDeviceMachine(Machine):
    """Calls whose RPC was in order, and alarm frames."""

    name = "cm-device"

    def next_input(self, rng):
        if rng.random() < 0.1:
            return b"\xff" + variation(rng, self.layers["rta"])
        opnum = rng.choice((0, 0, 1, 2, 3, 4, 4, 5))
        pool = self.layers[f"request-{opnum}"]
        chosen = self.renewed(rng.choice(pool))
        changed = deep_blocks(rng, chosen, pool, rng.choice((5, 6, 6))) if rng.random() < 0.9 else chosen
        return bytes([opnum if rng.random() < 0.9 else rng.choice((0, 1, 2, 3, 4, 5, 9))]) + changed

    def take(self, rng, data):
        self.calls += 1
        cm, opnum, payload = self.station.device.cm, data[0], data[1:]
        if opnum == 0xFF:
            cm.receive_rta(payload, self.line.plc.port.mac, self.now)
        else:
            key = CallKey(PEER, UUID(int=self.calls), 0)
            cm.receive_call(
                key, opnum, payload, rng.choice((0, 64, 200, 4096, 0xFFFFFFFF)), Peer(PEER, 49153), self.now
            )
            answers = [answer for answer in cm.responses() if answer[0] == key]
            assert len(answers) == 1, "a call must be answered once"
            self.answers += answers[0][1].ok
        self.settle()


class CmControllerMachine(Machine):
    """Answers and calls of a device whose RPC was in order."""

    name = "cm-controller"

    def next_input(self, rng):
        kind = rng.randrange(10)
        if kind == 0:
            return b"\xff" + variation(rng, self.layers["rta"])
        pool = self.layers[
            rng.choice(("response-0", "response-2", "response-3", "response-4", "request-4", "response-1"))
        ]
        return bytes([kind]) + deep_blocks(rng, self.renewed(rng.choice(pool)), pool, rng.choice((5, 6, 6)))

    def take(self, rng, data):
        self.calls += 1
        machine, kind, payload = self.session.machine, data[0], data[1:]
        if machine is None:
            return  # released; the next time that passes brings another
        if kind == 0xFF:
            machine.receive_rta(payload, self.station.port.mac, self.now)
        elif kind < 4:
            machine.receive_call(CallKey(PEER, UUID(int=self.calls), 0), rng.choice((4, 4, 0, 9)), payload, self.now)
        else:
            machine.read_record(object(), 0x3A00, 1, 1, 47, 4096)
            keys = [call.key for call in machine.calls(self.now)] or [0, 1, 2]
            status = PnioStatus.from_int(rng.choice((0, 0, 0, 0xDB814105, 0xDE80B000, rng.getrandbits(32))))
            machine.call_returned(rng.choice(keys), status, payload, self.now)
        self.answers += len(machine.responses())
        self.line.plc.touch(self.session, self.now)


class AlarmChannelMachine(Machine):
    """One end of an alarm channel: PDUs with its references, mostly with numbers that are next or were last."""

    name = "alarm-channel"
    LOCAL, REMOTE = 0x14, 1

    def start(self, rng):
        self.clock = self.frames = 0
        self.channel = AlarmChannel(self.LOCAL, self.REMOTE, AlarmCrBlockReq(), 200, queue_length=4)
        self.taken = []
        self.pdus = [octets for octets in self.layers["rta"] if octets[:2] in {b"\xfc\x01", b"\xfe\x01"}]

    def revive(self, rng):
        self.clock += rng.choice((1, 10**8, 10**9))
        self.channel.handle_timeout(self.clock)
        if not self.channel.is_open:
            self.start(rng)
        with suppress(AlarmRefusedError):
            self.channel.notify(AlarmNotification(1, 0, 1, 1, high=rng.random() < 0.5), self.clock)

    def next_input(self, rng):
        pdu = parse_rta(rng.choice(self.pdus))
        alarm = AlarmNotification(
            rng.randrange(4), 0, 1, 1, specifier=rng.randrange(4), high=pdu.frame_id == ALARM_HIGH
        )
        body = rng.choice((pdu.body, alarm.emit(), acknowledge(alarm).emit()))
        lines = (self.channel._high, self.channel._low)
        numbers = [n for line in lines for n in (line.send_sequence, line.last_received, line.expected_sequence)]
        pdu = replace(
            pdu, destination=self.LOCAL, source=self.REMOTE, pdu_type=0x10 | rng.choice((1, 1, 1, 2, 3, 3, 4)),
            add_flags=0x11, send_sequence=rng.choice(numbers), ack_sequence=rng.choice(numbers), body=body,
        )  # fmt: skip
        octets = pdu.emit()
        return octets if rng.random() < 0.5 else mutated(rng, octets, self.layers["rta"])

    def take(self, rng, data):
        try:
            pdu = parse_rta(data)
        except DecodeError:
            return
        self.channel.receive(pdu, self.clock)
        self.taken += [event.alarm for event in self.channel.events() if isinstance(event, AlarmReceived)]
        if self.taken and rng.random() < 0.5:
            self.channel.acknowledge(self.taken.pop(), self.clock)
        self.frames += len(self.channel.to_send(self.clock))

    def said(self):
        return self.frames


class LldpMachine(Machine):
    """LLDPDUs, good ones and others, at the drive's port; through the farm, which parses for all drives."""

    name = "lldp-port"

    def next_input(self, rng):
        return variation(rng, self.layers["lldp"])

    def take(self, rng, data):
        source = rng.choice((self.line.plc.port.mac, self.station.port.mac, rng.randbytes(6)))
        frame = EthernetFrame(LLDP_MULTICAST, source, ETHERTYPE_LLDP, data)
        before = self.station.device.neighbours.lldp.received
        self.line.farm.receive(self.station.port.index, emit_ethernet(frame), self.now)
        lldp = self.station.device.neighbours.lldp
        assert len(lldp.neighbours) <= MAXIMUM_NEIGHBOURS
        for neighbour in lldp.neighbours:  # whatever was heard can be shown
            assert isinstance(f"{neighbour.alias} {neighbour.ip} {neighbour.system_name} {neighbour}", str)
        self.answers += lldp.received > before


class PdevMachine(Machine):
    """Records of the physical device, written and read in every place."""

    name = "physical-device"

    def next_input(self, rng):
        chosen = rng.choice(self.layers["pdev"])
        return deep_blocks(rng, chosen, self.layers["pdev"], rng.choice((5, 6)))

    def take(self, rng, data):
        pdev = self.station.device.neighbours.pdev
        fitting = {b"\x02\x00": (0x802B, 0x8001), b"\x02\x02": (0x802F, 0x8001), b"\x02\x50": (0x8071, 0x8000)}
        index, subslot = fitting.get(data[:2], (0x802B, 0x8001))
        slot = 0
        if rng.random() < 0.2:
            slot, subslot = rng.choice(((0, 0x8000), (0, 0x8001), (0, 1), (0, 0x8002), (1, 0x8001)))
            index = rng.choice((0x802A, 0x802B, 0x802F, 0x8051, 0x8071, 0x8072, 0x8080, 0xF841, 0xF842))
        refused = pdev.write(None, 0, slot, subslot, index, data, self.now)
        self.answers += refused is None
        for what in (index, 0x802A, 0xF841, 0xF842):
            found = pdev.read(None, 0, slot, subslot, what, 65536, self.now)
            assert isinstance(found, bytes | RecordError)
        if refused is None:
            assert pdev.read(None, 0, slot, subslot, index, 65536, self.now) == data
        self.settle()


MACHINES: tuple[type[Machine], ...] = (
    Station, Controller, DcpDeviceMachine, DcpClientMachine, IpHostMachine, RpcServerMachine, RpcClientMachine,
    SnmpAgentMachine, CmDeviceMachine, CmControllerMachine, AlarmChannelMachine,
    LldpMachine, PdevMachine,
)  # fmt: skip
