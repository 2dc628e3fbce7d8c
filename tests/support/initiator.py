"""A controller or supervisor on the memory switch, block by block: what the built-in controller never asks for.

It connects as it is asked to, answers ApplicationReady, acknowledges alarms, and keeps a drive's data hold timer fed.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING
from uuid import UUID

from bystander import Answer, Bystander

from pnfarm.engine.tick import receive
from pnfarm.protocols.ip.host import DatagramReceived
from pnfarm.protocols.profinet.alarms.channel import AlarmChannel, AlarmReceived
from pnfarm.protocols.profinet.cm.controller.frames import plan_frames
from pnfarm.protocols.profinet.cm.controller.plan import ArPlan
from pnfarm.protocols.profinet.cm.controller.request import connect_payload
from pnfarm.protocols.profinet.errors import OK
from pnfarm.protocols.profinet.rpc.events import CallReceived, Interface, RpcServerConfig
from pnfarm.protocols.profinet.rpc.fragments import Peer
from pnfarm.protocols.profinet.rpc.server import RpcServer
from pnfarm.protocols.profinet.wire.alarms.rta import parse_rta
from pnfarm.protocols.profinet.wire.any_block import emit_blocks, parse_blocks
from pnfarm.protocols.profinet.wire.block import BlockType
from pnfarm.protocols.profinet.wire.cm.connect import AlarmCrBlockReq, AlarmCrBlockRes, ArBlockReq
from pnfarm.protocols.profinet.wire.cm.control import ControlBlock, ControlCommand, SubmoduleList, control_response
from pnfarm.protocols.profinet.wire.cm.iocr import IocrBlockRes, IocrType
from pnfarm.protocols.profinet.wire.records.iod import IodReadReqHeader, IodWriteReqHeader, emit_write_request
from pnfarm.protocols.profinet.wire.rpc.pdu import RPC_PORT, UUID_PNIO_CONTROLLER, Opnum
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET, EthernetFrame, emit_ethernet, parse_ethernet

if TYPE_CHECKING:
    from pnfarm.station.station import Station

PREFIX = "dea00000-6c97-11d1-8271-"
#: 64 ms, and 1.92 s of silence allowed.
RATIO, HOLD = 64, 30


class Initiator(Bystander):
    """One AR to one drive. ``alarms`` are those it was told, ``called`` the blocks of each call of the device's."""

    def __init__(self, line, number: int, ip) -> None:
        self.line = line
        self.number = number
        self.server = RpcServer(
            RpcServerConfig(interfaces=(Interface(UUID_PNIO_CONTROLLER, frozenset({Opnum.CONTROL})),))
        )
        self.channel: AlarmChannel | None = None
        self.alarms: list[object] = []
        self.calls: list[tuple[object, ...]] = []
        self.acknowledges = True
        self._counter = 0
        self._output: tuple[int, int] | None = None
        super().__init__(line.world, f"initiator-{number}", bytes([2, 0, 0, 0x88, 0x88, number]), ip)
        self.server.set_address(ip.ip)
        self.ip.open_ports |= {RPC_PORT}

    def other_datagram(self, event: DatagramReceived) -> None:
        if event.destination_port == RPC_PORT:
            peer = Peer(event.source_ip, event.source_port)
            self.server.receive(peer, RPC_PORT, event.data, self.now, event.source_mac)

    def settle(self) -> None:
        super().settle()
        if not hasattr(self, "rpc"):
            return
        for event in self.server.events():
            if isinstance(event, CallReceived):
                blocks = parse_blocks(event.payload)
                self.calls.append(tuple(blocks))
                self.server.respond(event.call, OK, control_response(blocks[0]).emit(), self.now)
        for datagram in self.server.to_send(self.now):
            self.ip.send(datagram.local_port, datagram.peer.ip, datagram.peer.port, datagram.data, self.now)
        while self.heard:
            self._take(self.heard.popleft())
        for frame in self.ip.to_send(self.now):
            self.send(frame)
        self._speak_alarms()

    def _take(self, frame: bytes) -> None:
        ether = parse_ethernet(frame)
        if ether.payload[:2] in {b"\xfc\x01", b"\xfe\x01"} and self.channel is not None:
            self.channel.receive(parse_rta(ether.payload), self.now)

    def _speak_alarms(self) -> None:
        if self.channel is None:
            return
        for event in self.channel.events():
            if isinstance(event, AlarmReceived):
                self.alarms.append(event.alarm)
                if self.acknowledges:
                    self.channel.acknowledge(event.alarm, self.now)
        for tag, octets in self.channel.to_send(self.now):
            self.send(emit_ethernet(EthernetFrame(self.station.port.mac, self.mac, ETHERTYPE_PROFINET, octets, tag)))

    # -- the AR ------------------------------------------------------------------------------------------------------

    def plan(self, station: Station) -> ArPlan:
        """What the built-in controller would want of this drive, slowly and as another."""
        wanted = self.line.plc.sessions[station.index].plan
        tail = station.device.rpc.config.endpoints[0].object_uuid
        self.station = station
        self.uuid = UUID(int=0xA0000 + self.number)
        return ArPlan(
            vendor_id=wanted.vendor_id, device_id=wanted.device_id, instance=wanted.instance,
            controller_name=f"initiator-{self.number}", controller_mac=self.mac,
            controller_object_uuid=UUID(f"{PREFIX}{self.number:04x}{str(tail)[-8:]}"), ar_uuid=self.uuid,
            session_key=self.number, submodules=wanted.submodules, reduction_ratio=RATIO, watchdog_factor=HOLD,
            input_frame_id=0x9000 + self.number, alarm_cr=AlarmCrBlockReq(local_alarm_reference=0x100 + self.number),
        )  # fmt: skip

    def connect(self, station: Station, *, ar_type: int = 1, properties: int = 0, plan=None, change=None) -> Answer:
        """``properties`` are added to the plan's; ``change`` makes other blocks of those that would be sent."""
        plan = plan or self.plan(station)
        inputs, outputs = plan_frames(plan)
        blocks = parse_blocks(connect_payload(plan, inputs, outputs))
        head = next(block for block in blocks if isinstance(block, ArBlockReq))
        mine = replace(head, ar_type=ar_type, properties=head.properties | properties)
        blocks = [mine if block is head else block for block in blocks]
        answer = self.called(station, Opnum.CONNECT, emit_blocks(change(blocks) if change else blocks))
        if answer.status != 0:
            return answer
        for block in parse_blocks(answer.payload):
            if isinstance(block, AlarmCrBlockRes):
                self.channel = AlarmChannel(
                    plan.alarm_cr.local_alarm_reference,
                    block.local_alarm_reference,
                    plan.alarm_cr,
                    block.max_alarm_data_length,
                )
            if isinstance(block, IocrBlockRes) and block.iocr_type == IocrType.OUTPUT:
                self._output = block.frame_id, outputs.data_length
        return answer

    def establish(self, station: Station, **how) -> Answer:
        answer = self.connect(station, **how)
        assert answer.status == 0, answer
        assert self.control(BlockType.PRM_END_REQ, ControlCommand.PRM_END).status == 0
        self.feed(0.1)
        return answer

    def feed(self, seconds: float) -> None:
        """Time passes, and good data go to the drive's engine."""
        columns = self.line.farm.columns
        for _ in range(max(1, round(seconds / 0.1))):
            if self._output is not None:
                frame_id, length = self._output
                self._counter = (self._counter + 0x800) & 0xFFFF
                octets = self.station.port.mac + self.mac + b"\x88\x92" + frame_id.to_bytes(2, "big")
                octets += b"\x80" * length + self._counter.to_bytes(2, "big") + b"\x35\0"
                columns.rx_frames[0, : len(octets)] = list(octets)
                columns.rx_length[0], columns.rx_port[0], columns.rx_ns[0] = (
                    len(octets),
                    self.station.port.index,
                    self.now,
                )
                receive(columns, 1)
            self.run(min(0.1, seconds))

    def control(self, block_type: int, command: int, sequence: int = 0, extra=()) -> Answer:
        block = ControlBlock(block_type, self.uuid, self.number, command, sequence)
        return self.called(self.station, Opnum.CONTROL, emit_blocks((block, *extra)))

    def begin_parameters(self, *keys: tuple[int, int, int]) -> Answer:
        return self.control(BlockType.PRM_BEGIN_REQ, ControlCommand.PRM_BEGIN, extra=(SubmoduleList(keys),))

    def end_parameters(self) -> Answer:
        return self.control(BlockType.PRM_END_REQ, ControlCommand.PRM_END)

    def end_plugged(self, sequence: int) -> Answer:
        return self.control(BlockType.PRM_END_PLUG_REQ, ControlCommand.PRM_END, sequence)

    def release(self) -> Answer:
        block = ControlBlock(BlockType.RELEASE_REQ, self.uuid, self.number, ControlCommand.RELEASE)
        return self.called(self.station, Opnum.RELEASE, block.emit())

    def read(self, index: int, api: int = 0, slot: int = 0, subslot: int = 1, length: int = 32768) -> Answer:
        payload = IodReadReqHeader(1, self.uuid, api, slot, subslot, index, length).emit()
        return self.called(self.station, Opnum.READ, payload, length + 64)

    def write(
        self, index: int, data: bytes, api: int = 0, slot: int = 0, subslot: int = 1, *, room: int = 4096
    ) -> Answer:
        payload = emit_write_request(IodWriteReqHeader(1, self.uuid, api, slot, subslot, index), data)
        return self.called(self.station, Opnum.WRITE, payload, room)
