"""A captured controller: its calls to one device, octet for octet, to a farm's device in virtual time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from ipaddress import IPv4Interface
from itertools import islice

from bystander import Bystander

from pnfarm.captures.reading import FrameReader
from pnfarm.engine.tick import receive
from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.cm.ar import compute_layout, expected_submodules
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
from pnfarm.wire.ipv4 import parse_ipv4
from pnfarm.wire.udp import parse_udp


@dataclass(frozen=True)
class Call:
    """One captured request: its datagram, the port it came from, and what it is."""

    octets: bytes
    port: int
    pdu: RpcPdu

    @property
    def payload(self) -> bytes:
        return parse_request_args(self.pdu.body, little_endian=self.pdu.little_endian).payload


def captured_calls(file, device: bytes) -> tuple[list[Call], bytes, str]:
    """The requests of a start-up to the device with this MAC address, and its controller's MAC and IP addresses."""
    found, mac, ip = [], b"", ""
    # a start-up is at the beginning
    for frame in islice(FrameReader(file), 400):
        ether = parse_ethernet(frame.data)
        if ether.ethertype != ETHERTYPE_IPV4 or ether.destination != device:
            continue
        packet = parse_ipv4(ether.payload)
        datagram = parse_udp(packet.payload)
        try:
            pdu = parse_rpc(datagram.data)
        except DecodeError:
            continue
        if pdu.kind == PacketType.REQUEST and pdu.opnum in {Opnum.CONNECT, Opnum.WRITE, Opnum.CONTROL}:
            found.append(Call(datagram.data, datagram.source_port, pdu))
            mac, ip = ether.source, str(packet.source)
    return found, mac, ip


class CapturedController(Bystander):
    """``start`` a connection as the capture has it, and ``exchange`` data in its frames."""

    def __init__(self, line, file, station) -> None:
        self.station, self.farm = station, line.farm
        self.calls, mac, ip = captured_calls(file, station.port.mac)
        super().__init__(line.world, "captured", mac, IPv4Interface(f"{ip}/24"))
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
        self._put(call.port, RPC_PORT, call.octets)
        _, pdu = self._await(PacketType.RESPONSE)
        answer = parse_response_args(pdu.body, little_endian=pdu.little_endian)
        return answer.status, answer.payload

    def start(self):
        """The whole start-up; the Connect's answer as blocks, and the status of each written record."""
        answers, statuses = [], []
        for call in self.calls:
            status, payload = self.ask(call)
            assert status.ok, f"{Opnum(call.pdu.opnum).name}: 0x{int(status):08X}"
            if call.pdu.opnum == Opnum.CONNECT:
                answers = parse_blocks(payload)
                self.frame_ids = {b.iocr_reference: b.frame_id for b in answers if isinstance(b, IocrBlockRes)}
            elif call.pdu.opnum == Opnum.WRITE:
                statuses += [header.status for header in parse_write_response(payload)]
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
