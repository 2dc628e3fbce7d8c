"""A captured controller: its calls to one device, octet for octet, to a farm's device in virtual time."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from ipaddress import IPv4Interface

from bystander import Bystander

from pnfarm.captures.reading import FrameReader
from pnfarm.engine.tick import receive
from pnfarm.errors import DecodeError
from pnfarm.protocols.ip.reassembly import Reassembler
from pnfarm.protocols.profinet.cm.ar import compute_layout, expected_submodules
from pnfarm.protocols.profinet.errors import describe_status
from pnfarm.protocols.profinet.wire.any_block import parse_blocks
from pnfarm.protocols.profinet.wire.cm.control import ControlBlock, control_response
from pnfarm.protocols.profinet.wire.cm.expected import ExpectedSubmoduleBlockReq, ModuleDiffBlock
from pnfarm.protocols.profinet.wire.cm.iocr import IocrBlockReq, IocrBlockRes
from pnfarm.protocols.profinet.wire.records.iod import parse_write_response
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    OK,
    RPC_PORT,
    Opnum,
    PacketType,
    ResponseArgs,
    RpcPdu,
    emit_response_args,
    emit_rpc,
    parse_request_args,
    parse_response_args,
    parse_rpc,
)
from pnfarm.wire.ethernet import ETHERTYPE_IPV4, parse_ethernet
from pnfarm.wire.ipv4 import PROTOCOL_UDP, parse_ipv4
from pnfarm.wire.udp import parse_udp


@dataclass(frozen=True)
class Call:
    """One captured request: its datagrams, fragments in their order, the port they came from, and what they are."""

    datagrams: tuple[bytes, ...]
    port: int
    pdu: RpcPdu

    @property
    def payload(self) -> bytes:
        return parse_request_args(self.pdu.body, little_endian=self.pdu.little_endian).payload

    def is_answered_by(self, pdu: RpcPdu) -> bool:
        return (pdu.activity, pdu.sequence) == (self.pdu.activity, self.pdu.sequence)


@dataclass
class Start:
    """A captured Connect and the calls behind it, up to the controller's next one; the controller's addresses.

    ``differs``: what was plugged differed from what was asked for.
    """

    mac: bytes
    ip: str
    calls: list[Call] = field(default_factory=list)
    differs: bool = False


def captured_starts(file, device: bytes) -> list[Start]:
    """The starts of the device with this MAC address, each call of them once; one that lacks fragments is left out."""
    starts: list[Start] = []
    parts: dict[object, dict[int, tuple[bytes, RpcPdu]]] = {}
    joined = Reassembler(Counter(), 64)
    for frame in FrameReader(file):
        ether = parse_ethernet(frame.data)
        if ether.ethertype != ETHERTYPE_IPV4 or device not in {ether.destination, ether.source}:
            continue
        packet = joined.receive(parse_ipv4(ether.payload), frame.time_ns)
        try:
            if packet is None or packet.protocol != PROTOCOL_UDP:
                continue
            datagram = parse_udp(packet.payload)
            pdu = parse_rpc(datagram.data)
        except DecodeError:
            continue
        if pdu.opnum not in {Opnum.CONNECT, Opnum.WRITE, Opnum.CONTROL}:
            continue
        if pdu.kind != (PacketType.REQUEST if ether.destination == device else PacketType.RESPONSE):
            continue
        key = ether.source, pdu.activity, pdu.sequence
        known = parts.setdefault(key, {})
        begins = not pdu.is_fragment or pdu.fragment_number == 0
        if begins and known and known.get(0, (datagram.data,))[0] != datagram.data:
            known.clear()  # the same number again, for another call
        if pdu.fragment_number in known:
            continue
        known[pdu.fragment_number] = datagram.data, pdu
        last = next((number for number, (_, one) in known.items() if one.is_last), None)
        if last is None or set(known) != set(range(last + 1)):
            continue
        datagrams, pdus = zip(*(known[number] for number in range(last + 1)), strict=True)
        whole = replace(pdus[0], body=b"".join(one.body for one in pdus))
        if ether.source == device:
            asked = next((one for one in reversed(starts) if one.calls[0].is_answered_by(whole)), None)
            if asked is not None:
                answer = parse_response_args(whole.body, little_endian=whole.little_endian)
                asked.differs = answer.status.ok and bool(differences(parse_blocks(answer.payload)))
            continue
        if pdu.opnum == Opnum.CONNECT:
            starts.append(Start(ether.source, str(packet.source)))
        own = next((one for one in reversed(starts) if one.mac == ether.source), None)
        if own is not None:
            own.calls.append(Call(datagrams, datagram.source_port, whole))
    return starts


class CapturedController(Bystander):
    """``start`` a connection as the capture has it, the first one of the file; ``exchange`` data in its frames."""

    def __init__(self, line, file, station, start: Start | None = None) -> None:
        self.station, self.farm = station, line.farm
        found = start or captured_starts(file, station.port.mac)[0]
        self.calls = found.calls
        super().__init__(line.world, "captured", found.mac, IPv4Interface(f"{found.ip}/24"))
        self.ip.open_ports |= {RPC_PORT, *(call.port for call in self.calls)}
        self.arrived: list[tuple[int, int, bytes]] = []
        self.request = parse_blocks(self.calls[0].payload)
        self.frame_ids: dict[int, int] = {}
        self.counter = 0

    def other_datagram(self, event) -> None:
        self.arrived.append((event.destination_port, event.source_port, event.data))

    def _put(self, port: int, to: int, octets: bytes) -> None:
        address = self.station.device.ip.address.ip
        self.ip.learn(address, self.station.port.mac, self.now)
        self.ip.send(port, address, to, octets, self.now)
        self.settle()

    def _await(self, kind: int) -> tuple[int, RpcPdu]:
        def found():
            return next(((at, pdu) for _, at, data in self.arrived if (pdu := parse_rpc(data)).kind == kind), None)

        assert self.run(3.0, until=lambda: found() is not None), "the device keeps silent"
        answer = found()
        self.arrived.clear()
        return answer

    def ask(self, call: Call):
        """Send it as it was captured; PNIOStatus and payload of the answer."""
        for octets in call.datagrams:
            self._put(call.port, RPC_PORT, octets)
        _, pdu = self._await(PacketType.RESPONSE)
        answer = parse_response_args(pdu.body, little_endian=pdu.little_endian)
        return answer.status, answer.payload

    def start(self):
        """The whole start-up; the Connect's answer as blocks, and the status of each written record."""
        answers, statuses = [], []
        for call in self.calls:
            status, payload = self.ask(call)
            assert status.ok, f"{Opnum(call.pdu.opnum).name}: {describe_status(status)}"
            if call.pdu.opnum == Opnum.CONNECT:
                answers = parse_blocks(payload)
                self.frame_ids = {b.iocr_reference: b.frame_id for b in answers if isinstance(b, IocrBlockRes)}
            elif call.pdu.opnum == Opnum.WRITE:
                statuses += [header.status for header in parse_write_response(payload)]
        if self.calls[-1].pdu.opnum != Opnum.CONTROL:
            # the capture ends before the end of the parameters
            return answers, statuses
        port, ready = self._await(PacketType.REQUEST)
        asked = parse_request_args(ready.body, little_endian=ready.little_endian)
        block = next(b for b in parse_blocks(asked.payload) if isinstance(b, ControlBlock))
        answer = ResponseArgs(OK, control_response(block).emit(), asked.args_maximum)
        body = emit_response_args(answer, little_endian=ready.little_endian)
        self._put(RPC_PORT, port, emit_rpc(replace(ready, packet_type=PacketType.RESPONSE, body=body)))
        return answers, statuses

    # cyclic data

    @property
    def layouts(self):
        expected = expected_submodules(
            api for b in self.request if isinstance(b, ExpectedSubmoduleBlockReq) for api in b.apis
        )
        return [
            compute_layout(b, expected, self.frame_ids[b.iocr_reference])
            for b in self.request
            if isinstance(b, IocrBlockReq)
        ]

    def exchange(self, octets: dict[tuple[int, int], bytes]) -> bytes:
        """Outputs by slot and subslot, some cycles long; then the device's frame, from its frame id on."""
        (outputs,) = [one for one in self.layouts if not one.is_input]
        sdu = bytearray(b"\x80" * outputs.data_length)
        for place in outputs.data:
            data = octets.get((place.slot, place.subslot), bytes(place.data_length))
            sdu[place.data_offset : place.data_offset + place.data_length] = data
        columns = self.farm.columns
        for _ in range(20):
            self.counter = (self.counter + outputs.cycle_ns // 31_250) & 0xFFFF
            frame = self.station.port.mac + self.mac + b"\x81\0\xc0\0\x88\x92" + outputs.frame_id.to_bytes(2, "big")
            frame += bytes(sdu) + self.counter.to_bytes(2, "big") + b"\x35\0"
            columns.rx_frames[0, : len(frame)] = list(frame)
            columns.rx_length[0], columns.rx_port[0] = len(frame), self.station.port.index
            columns.rx_ns[0] = self.now
            receive(columns, 1)
            self.run(outputs.cycle_ns / 1e9)
        # nobody is joined to take them, so they stay in their row
        (ar,) = self.station.device.ars.values()
        row, _ = ar.providers[0]
        return parse_ethernet(bytes(columns.frames[row, : int(columns.ppm[row].length)])).payload


def differences(blocks) -> list[ModuleDiffBlock]:
    return [block for block in blocks if isinstance(block, ModuleDiffBlock)]
