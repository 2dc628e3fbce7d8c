"""A third station on the memory switch of a virtual line: an honest engineering tool, with the project's own clients.

It has an address, calls by RPC, asks by DCP and SNMP, and keeps what else arrives. The world does not know it, so time
passes through :meth:`Bystander.run`.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING
from uuid import UUID

from pnfarm.buses.profinet.uuids import uuid_source
from pnfarm.errors import DecodeError
from pnfarm.protocols.ip.host import DatagramReceived, IpHost
from pnfarm.protocols.profinet.dcp.client import DcpClient
from pnfarm.protocols.profinet.rpc.client import RpcClient
from pnfarm.protocols.profinet.rpc.events import CallReturned
from pnfarm.protocols.profinet.rpc.fragments import Peer
from pnfarm.protocols.profinet.wire.records.iod import API_NONE, IodReadReqHeader, parse_read_response
from pnfarm.protocols.profinet.wire.rpc.pdu import RPC_PORT, UUID_PNIO_DEVICE, Opnum
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET, parse_ethernet

if TYPE_CHECKING:
    from ipaddress import IPv4Interface

    from pnfarm.farm.virtual import VirtualWorld
    from pnfarm.station.station import Station

CALL_PORT, SNMP_CLIENT_PORT, SNMP_PORT = 49_160, 49_161, 161
NIL = UUID(int=0)


@dataclass(frozen=True)
class Answer:
    """How a call ended: ``status`` as a number, or why there is none."""

    status: int | None
    payload: bytes
    reason: str = ""


class Bystander:
    """See the module's head. ``heard`` are the last frames that no machine of it takes."""

    def __init__(self, world: VirtualWorld, name: str, mac: bytes, ip: IPv4Interface) -> None:
        self.world = world
        self.mac = mac
        self.port = world.switch.attach(mac, self._receive, name=name)
        self.ip = IpHost(mac)
        self.ip.open_ports = {CALL_PORT, SNMP_CLIENT_PORT}
        self.ip.set_address(ip)
        self.rpc = RpcClient(uuid_source(name.encode()))
        self.dcp = DcpClient(mac)
        self.answers: dict[int, Answer] = {}
        self.datagrams: deque[bytes] = deque(maxlen=64)
        self.dcp_events: deque[object] = deque(maxlen=64)
        self.heard: deque[bytes] = deque(maxlen=256)
        self.settle()

    @property
    def now(self) -> int:
        return self.world.now

    def _receive(self, _index, frame, now):
        try:
            ether = parse_ethernet(frame)
        except DecodeError:
            self.heard.append(frame)
            return
        if ether.ethertype == ETHERTYPE_PROFINET:
            if ether.destination == self.mac and len(ether.payload) > 10 and ether.payload[0] == 0xFE:
                self.dcp.receive(ether, now)
            self.heard.append(frame)
        else:
            self.ip.receive(ether, now)
        self.settle()

    def settle(self) -> None:
        now = self.now
        for event in self.ip.events():
            if not isinstance(event, DatagramReceived):
                continue
            if event.destination_port == SNMP_CLIENT_PORT:
                self.datagrams.append(event.data)
            elif event.destination_port != CALL_PORT:
                self.other_datagram(event)
            else:
                peer = Peer(event.source_ip, event.source_port)
                self.rpc.receive(peer, event.destination_port, event.data, now)
        for event in self.rpc.events():
            if isinstance(event, CallReturned):
                self.answers[event.call_id] = Answer(int(event.status), event.payload)
            else:
                self.answers[event.call_id] = Answer(None, b"", event.reason)
        self.dcp_events.extend(self.dcp.events())
        for datagram in self.rpc.to_send(now):
            self.ip.send(datagram.local_port, datagram.peer.ip, datagram.peer.port, datagram.data, now)
        for frame in (*self.dcp.to_send(now), *self.ip.to_send(now)):
            self.send(frame)

    def other_datagram(self, event: DatagramReceived) -> None:
        """For whoever opens further ports."""

    def send(self, frame: bytes) -> None:
        self.world.switch.send(self.port.index, frame, self.now)

    def service(self) -> None:
        """Whatever timers are due."""
        for machine in (self.ip, self.rpc, self.dcp):
            machine.handle_timeout(self.now)
        self.settle()

    def run(self, seconds: float, until=None) -> bool:
        """Let time pass in the whole world; true once ``until`` holds."""
        end = self.now + round(seconds * 1e9)
        while True:
            self.service()
            if until is not None and until():
                return True
            if self.now >= end:
                return False
            dues = [machine.next_deadline() for machine in (self.ip, self.rpc, self.dcp)]
            target = min([end, *(due for due in dues if due is not None and due > self.now)])
            self.world.run((target - self.now) / 1e9, until=until)

    # -- what it asks ------------------------------------------------------------------------------------------------

    def call(self, station: Station, opnum: int, payload: bytes, room: int = 4096) -> int:
        """Start a call to a drive's object; its number, under which ``answers`` will have the end."""
        address = station.device.ip.address
        if address is None:
            raise ValueError(f"{station.configured_name} has no address to call")
        # somebody may claim the drive's address; this station's own cache is not what is looked at
        self.ip.learn(address.ip, station.port.mac, self.now)
        endpoint = station.device.rpc.config.endpoints[0]
        peer = Peer(address.ip, RPC_PORT)
        call = self.rpc.call(peer, CALL_PORT, UUID_PNIO_DEVICE, endpoint.object_uuid, opnum, room, payload, self.now)
        self.settle()
        return call

    def called(self, station: Station, opnum: int, payload: bytes, room: int = 4096) -> Answer:
        """The whole call."""
        number = self.call(station, opnum, payload, room)
        self.run(20, until=lambda: number in self.answers)
        return self.answers.pop(number)

    def implicit_read(self, index: int, api: int = 0, slot: int = 0, subslot: int = 1, length: int = 4096) -> bytes:
        """The request's blocks."""
        return IodReadReqHeader(1, NIL, api, slot, subslot, index, length).emit()

    def read_without(self, station: Station, index: int, api: int = 0, slot: int = 0, subslot: int = 1) -> bytes | None:
        """A record, without a connection; None when it was refused or not answered."""
        answer = self.called(station, Opnum.READ_IMPLICIT, self.implicit_read(index, api, slot, subslot))
        return parse_read_response(answer.payload).data if answer.status == 0 else None

    def ask_snmp(self, station: Station, message: bytes) -> None:
        """One datagram to a drive's agent; ``datagrams`` will have the answer."""
        address = station.device.ip.address
        if address is not None:
            self.ip.learn(address.ip, station.port.mac, self.now)
            self.ip.send(SNMP_CLIENT_PORT, address.ip, SNMP_PORT, message, self.now)
            self.settle()


__all__ = ["API_NONE", "CALL_PORT", "Answer", "Bystander"]
