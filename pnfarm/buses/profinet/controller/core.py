"""The controller without a clock and without tasks: sessions, shared machines, programs; a :class:`Node` like a farm.

One interface, one address, one RPC client and server serve all drives; each drive has a session
(:mod:`pnfarm.buses.profinet.controller.session`) and, while it is connected, an AR machine.
"""

from __future__ import annotations

from itertools import accumulate
from typing import TYPE_CHECKING, Any

from pnfarm.buses.controllers.core import SessionCore
from pnfarm.buses.controllers.snapshot import session_row
from pnfarm.buses.profinet.controller import events
from pnfarm.buses.profinet.controller.channels import SessionChannels
from pnfarm.buses.profinet.controller.device_plan import CALL_PORT
from pnfarm.buses.profinet.controller.events import NameGivenTwice
from pnfarm.buses.profinet.controller.records import READ_LENGTH, RecordJob, RecordPlace
from pnfarm.buses.profinet.controller.search import Duplicate, Outcome, Search
from pnfarm.buses.profinet.controller.session import DeviceSession, SessionState, Sign
from pnfarm.buses.profinet.controller.session_life import SessionLife
from pnfarm.buses.profinet.uuids import uuid_source
from pnfarm.errors import DecodeError
from pnfarm.protocols.deadlines import earliest
from pnfarm.protocols.ip.host import DatagramReceived, IpHost
from pnfarm.protocols.profinet.cm.controller.response import addressed_ar
from pnfarm.protocols.profinet.dcp.client import DcpClient, GetFinished, HelloReceived
from pnfarm.protocols.profinet.dcp.device import DcpDevice
from pnfarm.protocols.profinet.dcp.rules import DcpIdentity
from pnfarm.protocols.profinet.errors import CmrpcError, ConnectFault, ErrorCode, pnio_error
from pnfarm.protocols.profinet.lldp.agent import LldpPort, LocalPort, LocalSystem, NeighbourAppeared, NeighbourChanged
from pnfarm.protocols.profinet.rpc.client import RpcClient
from pnfarm.protocols.profinet.rpc.events import CallFailed, CallReceived, CallReturned, Interface, RpcServerConfig
from pnfarm.protocols.profinet.rpc.fragments import Peer
from pnfarm.protocols.profinet.rpc.server import RpcServer
from pnfarm.protocols.profinet.wire.dcp.blocks import (
    FactoryResetBlock,
    FullIpSuiteBlock,
    IpParameterBlock,
    NameBlock,
    ResetToFactoryBlock,
)
from pnfarm.protocols.profinet.wire.dcp.pdu import TYPE_REQUEST
from pnfarm.protocols.profinet.wire.frame_id import DCP_HELLO, DCP_IDENTIFY_RESPONSE
from pnfarm.protocols.profinet.wire.rpc.pdu import RPC_PORT, UUID_PNIO_CONTROLLER, UUID_PNIO_DEVICE, Opnum, object_uuid
from pnfarm.wire.ethernet import ETHERTYPE_LLDP, ETHERTYPE_PROFINET, EthernetFrame, emit_ethernet, parse_ethernet

if TYPE_CHECKING:
    from collections import deque
    from collections.abc import Iterable

    from pnfarm.buses.controller import ControllerHost
    from pnfarm.buses.profinet.controller.device_plan import ProfinetPlan
    from pnfarm.protocols.profinet.cm.ar import ExpectedKey
    from pnfarm.protocols.profinet.cm.controller.cmctl import CmController
    from pnfarm.protocols.profinet.cm.controller.events import RecordRead, RecordWriteDone

__all__ = ["ProfinetCore"]

#: First frame id of the input CRs (RT_CLASS_2 unicast); each has its own.
FIRST_FRAME_ID = 0x8000
#: The controller's own, which no vendor has.
VENDOR_ID, DEVICE_ID = 0xFFFF, 0x0001
#: What DCP may not set in a controller.
OWN_SETTINGS = frozenset(
    block.ID for block in (NameBlock, IpParameterBlock, FullIpSuiteBlock, FactoryResetBlock, ResetToFactoryBlock)
)
#: Place of DCP's service type, after the frame id and the service id.
_SERVICE_TYPE = 3


class ProfinetCore(SessionCore[DeviceSession]):
    """See the module's docstring."""

    life: SessionLife

    def __init__(self, plan: ProfinetPlan, host: ControllerHost) -> None:
        layouts = [device.plain or () for device in plan.devices]
        # a change of modules leaves the pieces of before to the engine until its next tick
        pieces = 4 * sum(len(layout.places) for both in layouts for layout in both)
        frame_ids = accumulate((device.input_crs for device in plan.devices), initial=FIRST_FRAME_ID)
        sessions = [
            DeviceSession(index, device, frame_id=frame_id)
            for (index, device), frame_id in zip(enumerate(plan.devices), frame_ids, strict=False)
        ]
        super().__init__(plan, host, sessions, pieces=pieces)
        name, port, ip, count = plan.name, self.port, plan.ip, len(plan.devices)
        self.channels = SessionChannels(self.columns, port)
        for place, layout in enumerate(layouts if pieces else ()):
            if layout:
                outputs, inputs = ((one.octets, len(one.places)) for one in layout)
                self._add_plain(place, outputs, inputs)
        self._uuids = uuid_source(host.seed + port.mac)
        self._object_uuid = object_uuid(1, DEVICE_ID, VENDOR_ID)
        self.dcp = DcpClient(port.mac)
        self.dcp_self = DcpDevice(
            port.mac, DcpIdentity("pnfarm controller", VENDOR_ID, DEVICE_ID, role=2), name=name, address=ip
        )
        # other stations must not set the controller's name and address
        self.dcp_self.locked = OWN_SETTINGS
        self.ip = IpHost(port.mac, neighbours=max(256, 2 * count))
        self.ip.open_ports = {RPC_PORT, CALL_PORT}
        self.ip.set_address(ip)
        #: The LLDP agent of the controller's port; None without LLDP.
        own = LocalSystem(port.mac, name, "pnfarm controller", ip.ip)
        self.lldp = LldpPort(own, LocalPort(1, port.mac), maximum=max(16, 2 * count)) if host.lldp else None
        self.rpc = RpcServer(
            RpcServerConfig(
                interfaces=(Interface(UUID_PNIO_CONTROLLER, frozenset({Opnum.CONTROL})),),
                # each drive calls ApplicationReady in its own activity; none may displace the answer kept for another
                activities_max=max(32, 2 * count),
            )
        )
        self.client = RpcClient(self._uuids)
        self._search = Search(self.dcp, count)
        self.life = SessionLife(
            name,
            port.mac,
            self._object_uuid,
            columns=self.columns,
            channels=self.channels,
            search=self._search,
            log=self.log,
            uuids=self._uuids,
        )

    def start(self, now: int) -> None:
        for session in self.sessions:
            session.due_ns = now
            self.arm(session)
            for remark in session.plan.remarks:
                self.log.record(now, session.plan.name, events.FileRemarked(remark))
        self.settle(now)

    # -- node --------------------------------------------------------------------------------------------------------

    def receive(self, port: int, data: bytes, now: int) -> None:
        del port
        try:
            frame = parse_ethernet(data)
        except DecodeError as exc:
            self.dropped[exc.reason] += 1
            return
        if frame.ethertype == ETHERTYPE_LLDP:
            if self.lldp is None or not self.lldp.receive(frame, now):
                return
        elif frame.ethertype != ETHERTYPE_PROFINET:
            self.ip.receive(frame, now)
        elif len(frame.payload) < 2:
            self.dropped["short"] += 1
        elif DCP_HELLO <= (frame_id := int.from_bytes(frame.payload[:2], "big")) <= DCP_IDENTIFY_RESPONSE:
            # Hello is a request without an answer
            asked = frame_id != DCP_HELLO and frame.payload[_SERVICE_TYPE:][:1] == bytes([TYPE_REQUEST])
            (self.dcp_self if asked else self.dcp).receive(frame, now)
        else:
            session = self.life.by_mac.get(frame.source)
            if session is None or session.machine is None:
                self.dropped["alarm-of-nobody"] += 1
            else:
                session.machine.receive_rta(frame.payload, frame.source, now)
                self.life.touch(session)
        self.settle(now)

    def timed(self, now: int) -> None:
        for machine in self._machines:
            deadline = machine.next_deadline()
            if deadline is not None and deadline <= now:
                machine.handle_timeout(now)

    def next_deadline(self) -> int | None:
        own, sessions = earliest(*self._machines), super().next_deadline()
        return sessions if own is None or (sessions is not None and sessions < own) else own

    @property
    def _machines(self) -> tuple[DcpClient | DcpDevice | IpHost | RpcServer | RpcClient | LldpPort, ...]:
        shared = (self.dcp, self.dcp_self, self.ip, self.rpc, self.client)
        return shared if self.lldp is None else (*shared, self.lldp)

    # -- what the owner does -----------------------------------------------------------------------------------------

    def release(self, now: int) -> None:
        """Take every connection down in order."""
        for session in self.sessions:
            self.life.touch(session)
            self.life.sign(session, Sign.RELEASE, now)
        if self.lldp is not None:
            self.lldp.shut_down(now)
        self.settle(now)

    @property
    def records(self) -> deque[tuple[int, RecordRead | RecordWriteDone]]:
        """Latest ends of record accesses that are no job's: parameters after a plug, what a machine was asked directly.

        Each is (session index, event).
        """
        return self.life.records

    def touch(self, session: DeviceSession, now: int) -> None:
        """Something was asked of a session's machine (a record): carry it out."""
        self.life.touch(session)
        self.settle(now)

    def read_record(
        self, name: str, place: RecordPlace, now: int, *, length: int = READ_LENGTH, implicit: bool = False
    ) -> RecordJob:
        """Read a record of a drive: API, slot, subslot, index.  Raises :class:`ConfigError` for an unknown drive."""
        session = self.named(name)
        job = self.life.jobs.read(session, place, now, length=length, implicit=implicit)
        self.touch(session, now)
        return job

    def write_record(self, name: str, place: RecordPlace, data: bytes, now: int) -> RecordJob:
        """Write a record of a drive.  Raises :class:`ConfigError` for an unknown drive."""
        session = self.named(name)
        job = self.life.jobs.write(session, place, data, now)
        self.touch(session, now)
        return job

    def access_record(self, axis: str, index: int, data: bytes | None, now: int) -> RecordJob:
        """See :class:`pnfarm.buses.controller.RecordController`: in the first submodule of the axis' slots."""
        place = (*self.named(axis).plan.access_point(axis), index)
        return self.read_record(axis, place, now) if data is None else self.write_record(axis, place, data, now)

    def reparametrise(self, name: str, now: int, submodules: Iterable[ExpectedKey] | None = None) -> bool:
        """Write the records of a connected drive anew, or of some of its submodules: (api, slot, subslot).

        False when it exchanges no data or is being parametrised.  Raises :class:`ConfigError` for an unknown drive.
        """
        session = self.named(name)
        begun = session.machine is not None and session.machine.reparametrise(submodules)
        self.touch(session, now)
        return begun

    def snapshot(self) -> list[dict[str, Any]]:
        """One dict for each drive, for the terminal and for JSON."""
        return [
            session_row(
                session,
                self.columns,
                ip=str(session.plan.ip.ip),
                cycle_ns=session.plan.cycle_ns,
                of_bus={
                    "alarms_received": session.measures.alarms_received,
                    "last_alarm": session.measures.last_alarm,
                },
            )
            for session in self.sessions
        ]

    # -- between the machines ----------------------------------------------------------------------------------------

    def settle(self, now: int) -> None:
        """Carry events between the machines until nothing moves, then send."""
        moved = True
        while moved:
            self._search.ask(now)
            moved = self._pump_dcp(now)
            moved = self._pump_ip(now) or moved
            moved = self._pump_rpc(now) or moved
            self.life.begin_waiting(now)
            moved = self._pump_sessions(now) or moved
            if self.life.identification.pump(now):
                moved = True
        for datagram in (*self.rpc.to_send(now), *self.client.to_send(now)):
            self.ip.send(datagram.local_port, datagram.peer.ip, datagram.peer.port, datagram.data, now)
        for frame in (*self.dcp.to_send(now), *self.dcp_self.to_send(now), *self.ip.to_send(now)):
            self.link.send(self.port.index, frame)
        if self.lldp is not None:
            self._settle_lldp(self.lldp, now)

    def _settle_lldp(self, lldp: LldpPort, now: int) -> None:
        for event in lldp.events():
            happened = {NeighbourAppeared: events.NeighbourAppeared, NeighbourChanged: events.NeighbourChanged}
            self.log.record(now, self.name, happened.get(type(event), events.NeighbourGone)(event.neighbour))
        for frame in lldp.to_send(now):
            self.link.send(self.port.index, frame)

    def _pump_dcp(self, now: int) -> bool:
        events = self.dcp.events()
        for event in events:
            if isinstance(event, HelloReceived):
                self._hello(event, now)
            elif isinstance(event, GetFinished):
                self.dropped["unasked-get"] += 1
            for outcome in self._search.outcomes(event):
                if isinstance(outcome, Duplicate):
                    name = outcome.session.plan.name
                    self.log.record(now, name, NameGivenTwice(str(outcome)))
                else:
                    self._take_search(outcome, now)
        own = self.dcp_self.events()
        return bool(events or own)

    def _take_search(self, outcome: Outcome, now: int) -> None:
        session = outcome.session
        if outcome.answer is not None:
            session.mac = outcome.answer.mac
            session.station_type = outcome.answer.info.station_type or ""
            self.ip.learn(session.plan.ip.ip, session.mac, now)
        elif outcome.reason and session.measures.lost_ns is None:
            # the reason of a loss is more useful than that the drive does not answer yet
            session.measures.last_reason = outcome.reason
        self.life.sign(session, outcome.sign, now)

    def _hello(self, event: HelloReceived, now: int) -> None:
        """A drive came up: no need to wait for the next search."""
        session = self.session(event.info.name or "")
        if session is not None and session.state is SessionState.WAIT:
            session.due_ns = None
            self.life.sign(session, Sign.TIME, now)

    def _pump_ip(self, now: int) -> bool:
        events = self.ip.events()
        for event in events:
            if isinstance(event, DatagramReceived):
                peer = Peer(event.source_ip, event.source_port)
                if event.destination_port == RPC_PORT:
                    self.rpc.receive(peer, RPC_PORT, event.data, now, event.source_mac)
                else:
                    self.client.receive(peer, event.destination_port, event.data, now)
        return bool(events)

    def _pump_rpc(self, now: int) -> bool:
        requests = self.rpc.events()
        for request in requests:
            if not isinstance(request, CallReceived):
                continue
            uuid = addressed_ar(request.payload)
            session = self.life.by_ar.get(uuid) if uuid is not None else None
            if session is None or session.machine is None:
                status = pnio_error(ErrorCode.CONTROL, ConnectFault.CMRPC, CmrpcError.AR_UUID_UNKNOWN)
                self.rpc.respond(request.call, status, b"", now)
                continue
            session.machine.receive_call(request.call, request.opnum, request.payload, now)
            self.life.touch(session)
        answers = self.client.events()
        for answer in answers:
            session = self.life.by_call.pop(answer.call_id, None)
            if session is None or session.machine is None:
                continue
            key = session.calls.pop(answer.call_id)
            if isinstance(answer, CallReturned):
                session.machine.call_returned(key, answer.status, answer.payload, now)
            elif isinstance(answer, CallFailed):
                session.machine.call_failed(key, answer.text, now)
            self.life.touch(session)
        return bool(requests or answers)

    def _pump_sessions(self, now: int) -> bool:
        touched, self.life.touched = self.life.touched, {}
        moved = False
        for session in touched.values():
            machine = session.machine
            if machine is not None:
                moved = self._pump_machine(session, machine, now) or moved
            self.arm(session)
        return moved or bool(self.life.touched)

    def _pump_machine(self, session: DeviceSession, machine: CmController, now: int) -> bool:
        responses = machine.responses()
        for call, status, payload in responses:
            self.rpc.respond(call, status, payload, now)
        calls = machine.calls(now)
        for call in calls:
            call_id = self.client.call(
                Peer(session.plan.ip.ip, RPC_PORT),
                CALL_PORT,
                UUID_PNIO_DEVICE,
                machine.plan.device_object_uuid,
                call.opnum,
                call.args_maximum,
                call.payload,
                now,
            )
            session.calls[call_id] = call.key
            self.life.by_call[call_id] = session
        for destination, payload, tag in machine.rta_to_send():
            frame = EthernetFrame(destination, self.port.mac, ETHERTYPE_PROFINET, payload, tag)
            self.link.send(self.port.index, emit_ethernet(frame))
        events = machine.events()
        for event in events:
            self.life.take(session, event, now)
        return bool(responses or calls or events)
