"""A station that copies what a controller says of itself in its Connect, and floods drives with it."""

from __future__ import annotations

import struct
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING
from uuid import UUID

from pnfarm.protocols.profinet.cm.controller.frames import plan_frames
from pnfarm.protocols.profinet.cm.controller.request import connect_payload
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    RPC_PORT,
    UUID_PNIO_DEVICE,
    Opnum,
    PacketType,
    RequestArgs,
    RpcPdu,
    emit_request_args,
    emit_rpc,
)
from pnfarm.wire.ethernet import ETHERTYPE_IPV4, EthernetFrame, emit_ethernet
from pnfarm.wire.ipv4 import Ipv4Packet, emit_ipv4
from pnfarm.wire.udp import UdpDatagram, emit_udp

if TYPE_CHECKING:
    from ipaddress import IPv4Address

    from virtual_line import VirtualLine

UDP = 17
IDEMPOTENT = 0x20


@dataclass
class Impostor:
    """``mac`` and ``ip`` are what its frames come from; ``claims`` is what its Connect says of CMInitiatorMacAdd."""

    line: VirtualLine
    mac: bytes
    ip: IPv4Address
    claims: bytes = b""
    sent: int = 0

    def __post_init__(self) -> None:
        self.port = self.line.world.switch.attach(self.mac, lambda *_: None, name="impostor")
        self._payloads: dict[int, bytes] = {}

    def connect_frame(self, index: int) -> bytes:
        """A Connect to one drive, in the controller's name, with an AR UUID and an activity of its own."""
        self.sent += 1
        station = self.line.farm.axes[index]
        number = UUID(int=(0xBAD << 96) + self.sent)
        payload = self._payload(index, number)
        body = emit_request_args(RequestArgs(4096, payload), little_endian=True)
        target = station.device.rpc.config.endpoints[0].object_uuid
        head = RpcPdu(
            PacketType.REQUEST, UUID_PNIO_DEVICE, number, target, opnum=Opnum.CONNECT,
            drep=bytes((0x10, 0, 0)), flags1=IDEMPOTENT, body=body,
        )  # fmt: skip
        address = station.device.ip.address.ip
        octets = emit_udp(UdpDatagram(50_000, RPC_PORT, emit_rpc(head)), self.ip, address)
        packet = emit_ipv4(Ipv4Packet(self.ip, address, UDP, octets, identification=self.sent & 0xFFFF))
        return emit_ethernet(EthernetFrame(station.port.mac, self.mac, ETHERTYPE_IPV4, packet))

    def _payload(self, index: int, uuid: UUID) -> bytes:
        """The copied blocks; building them anew for each frame would cost more than the drive's work."""
        if index not in self._payloads:
            machine = self.line.plc.sessions[index].machine
            plan = replace(machine.plan, controller_mac=self.claims or self.mac, ar_uuid=UUID(int=0))
            self._payloads[index] = connect_payload(plan, *plan_frames(plan))
        # ARBlockReq: header of 6 octets, ARType, ARUUID
        octets = bytearray(self._payloads[index])
        octets[8:24] = struct.pack(">16s", uuid.bytes)
        return bytes(octets)

    def flood(self, per_second: int, seconds: float) -> None:
        """Send to all drives in turn while the world goes on."""
        drives = len(self.line.farm.axes)
        for _ in range(round(seconds * 100)):
            for _ in range(per_second // 100):
                frame = self.connect_frame(self.sent % drives)
                self.line.world.switch.send(self.port.index, frame, self.line.world.now)
            self.line.run(0.01)
