"""Carries events and actions between the machines of one drive until none is left.

What DCP sets goes to the IP host, RPC and the neighbours; datagrams go to RPC and SNMP; RPC calls go to context
management, and its answers and own calls go back.  What a machine has to send becomes frames.  The machines belong to
the device, which recreates them at each power-on.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from pnfarm.buses.profinet.device import events as happened
from pnfarm.buses.profinet.device.management.neighbours import port_diagnosis
from pnfarm.buses.profinet.device.memory.factory_reset import clear_memory
from pnfarm.buses.profinet.device.memory.record_memory import record_words
from pnfarm.buses.profinet.device.parts import DeviceParts
from pnfarm.errors import InternalError
from pnfarm.protocols.ip.host import DatagramReceived
from pnfarm.protocols.profinet.dcp.rules import AbortRequired, FactoryReset, IpSet, NameSet, SignalBegan, Stored
from pnfarm.protocols.profinet.records.pdev_checks import CheckFailed
from pnfarm.protocols.profinet.rpc.events import CallFailed, CallKey, CallMisdirected, CallReceived, CallReturned
from pnfarm.protocols.profinet.rpc.fragments import Peer
from pnfarm.protocols.profinet.wire.rpc.pdu import RPC_PORT, UUID_PNIO_CONTROLLER, Opnum
from pnfarm.protocols.profinet.wire.snmp.message import SNMP_PORT
from pnfarm.station.visits import Caller
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET, EthernetFrame, emit_ethernet

if TYPE_CHECKING:
    from pnfarm.buses.profinet.config.device import ProfinetDeviceConfig
    from pnfarm.buses.profinet.config.drive import ProfinetDriveConfig
    from pnfarm.buses.profinet.device.connect_budget import ConnectBudget
    from pnfarm.buses.profinet.device.connections import StationConnections
    from pnfarm.protocols.ip.host import IpHost
    from pnfarm.protocols.profinet.rpc.client import RpcClient
    from pnfarm.protocols.profinet.rpc.server import RpcServer
    from pnfarm.protocols.profinet.snmp.agent import SnmpAgent
    from pnfarm.station.visits import Step

__all__ = ["CALL_PORT", "DevicePump"]

#: UDP port from which a device calls its controller (any free one; the response comes back to it).
CALL_PORT = 49_152
#: Longest response of the controller, octets.
ARGS_MAXIMUM = 16_384


class PumpedDevice(DeviceParts, Protocol):
    """The machines between which events are carried, and the drive."""

    budget: ConnectBudget
    connections: StationConnections
    ip: IpHost
    rpc: RpcServer
    client: RpcClient
    snmp: SnmpAgent

    @property
    def config(self) -> ProfinetDriveConfig | ProfinetDeviceConfig:
        """This drive's settings in the farm file."""


class DevicePump:
    """See the module's docstring."""

    def __init__(self, device: PumpedDevice) -> None:
        self._device = device
        #: Tokens of the context management's open calls, by the RPC client's id.
        self._calls: dict[int, int] = {}
        #: A reset that restarts the drive was requested, and its response is still to be sent.
        self._reboot_due = False

    def forget_calls(self) -> None:
        """The machines are recreated: no open call is left."""
        self._calls.clear()

    def pump(self, now: int) -> list[bytes]:
        """See :meth:`pnfarm.station.device.Device.pump`."""
        device = self._device
        # due timers must raise their events here: fetching the frames after the loop would be too late
        device.dcp.handle_timeout(now)
        device.ip.handle_timeout(now)
        moved = True
        while moved:
            moved = False
            for step in self._STEPS:
                moved = step(self, now) or moved
            moved = device.station.pump_drive(now) or moved
        for datagram in (*device.rpc.to_send(now), *device.client.to_send(now), *device.snmp.to_send(now)):
            device.ip.send(datagram.local_port, datagram.peer.ip, datagram.peer.port, datagram.data, now)
        frames = device.dcp.to_send(now)
        frames += device.ip.to_send(now)
        frames += device.neighbours.to_send(now)
        frames += [
            emit_ethernet(EthernetFrame(f.destination, device.port.mac, ETHERTYPE_PROFINET, f.payload, f.tag))
            for f in device.cm.rta_to_send()
        ]
        for frame in frames:
            device.traffic.frame_sent(frame)
        if self._reboot_due:
            # the response to the reset is among the frames; those of the new machines, which count them, follow at once
            self._reboot_due = False
            device.station.power_cycle(now)
            frames += device.station.pump(now)
        return frames

    def _dcp(self, now: int) -> bool:
        device = self._device
        events = device.dcp.events()
        for event in events:
            if isinstance(event, IpSet):
                device.connections.begins(now)
            device.addressing.take_dcp(event, now)
            if isinstance(event, NameSet | IpSet):
                step: Step = "named" if isinstance(event, NameSet) else "addressed"
                device.station.visits.step(Caller(mac=device.dcp.client), step, now)
            match event:
                case NameSet(name):
                    device.cm.station_name = name
                case IpSet(interface) if interface is not None:
                    device.rpc.set_address(interface.ip)
                    device.kind.address_set()
                case SignalBegan():
                    device.station.signalled_ns = now
                case AbortRequired(reason):
                    device.cm.abort_all(reason, now)
                case FactoryReset():
                    self._factory_reset(event, now)
                case _:
                    pass
        if events:
            device.neighbours.update(device.dcp.name, device.dcp.address, device.dcp.gateway, now)
        return bool(events)

    def _factory_reset(self, reset: FactoryReset, now: int) -> None:
        """Clear what the reset's mode names, in memory and machines; name and address have events of their own."""
        device = self._device
        clear_memory(device.station.kept, reset.clears)
        device.station.save()
        if Stored.APPLICATION in reset.clears:
            device.kind.reset_application()
        if device.dcp.address is not None:
            device.kind.address_set()
        elif Stored.COMMUNICATION in reset.clears:
            device.kind.address_forgotten()
        if Stored.IDENTIFICATION in reset.clears:
            device.records.im.texts.clear()
        if Stored.MANAGEMENT in reset.clears:
            device.snmp_texts.clear()
        if Stored.INTERFACE in reset.clears:
            device.neighbours.pdev.forget(now)
            device.addressing.forget_records(on=device.config.hello)
        self._reboot_due = self._reboot_due or reset.reboots
        device.note(now, happened.FactoryResetDone(reset.mode.name.lower(), tuple(sorted(reset.clears))))

    def _ip(self, now: int) -> bool:
        device = self._device
        events = device.ip.events()
        for event in events:
            if isinstance(event, DatagramReceived):
                peer = Peer(event.source_ip, event.source_port)
                if event.destination_port == RPC_PORT:
                    device.rpc.receive(peer, RPC_PORT, event.data, now, event.source_mac)
                elif event.destination_port == SNMP_PORT:
                    device.snmp.receive(peer, event.data, now)
                else:
                    device.client.receive(peer, event.destination_port, event.data, now)
            else:
                device.addressing.take_ip(event, now)
        return bool(events)

    def _rpc(self, now: int) -> bool:
        device = self._device
        requests = device.rpc.events()
        for request in requests:
            if isinstance(request, CallReceived):
                if request.opnum == Opnum.CONNECT and request.source_mac is not None:
                    device.budget.note(request.source_mac, now)
                device.cm.receive_call(
                    request.call,
                    request.opnum,
                    request.payload,
                    request.args_maximum,
                    request.peer,
                    now,
                    source_mac=request.source_mac,
                )
            elif isinstance(request, CallMisdirected) and request.opnum == Opnum.CONNECT:
                device.connections.misdirected(request)
        answers = device.client.events()
        for answer in answers:
            token = self._calls.pop(answer.call_id, None)
            if token is None:
                continue
            if isinstance(answer, CallReturned):
                device.cm.call_returned(token, answer.status, answer.payload, now)
            elif isinstance(answer, CallFailed):
                device.cm.call_failed(token, answer.text, now)
        return bool(requests or answers)

    def _context_management(self, now: int) -> bool:
        device = self._device
        responses = device.cm.responses()
        for call, status, payload in responses:
            if not isinstance(call, CallKey):
                raise InternalError(f"{call!r} is not a call of the RPC server")
            device.rpc.respond(call, status, payload, now)
        calls = device.cm.calls()
        for call in calls:
            call_id = device.client.call(
                Peer(call.peer_ip, call.port or RPC_PORT),
                CALL_PORT,
                UUID_PNIO_CONTROLLER,
                call.object_uuid,
                Opnum.CONTROL,
                args_maximum=ARGS_MAXIMUM,
                payload=call.payload,
                now=now,
            )
            self._calls[call_id] = call.token
        changed = device.cm.report_diagnosis(now)
        events = device.cm.events()
        for event in events:
            device.records.log_book.note(event, now)
            device.connections.take(event, now)
            for listener in device.connections.listeners:
                listener(event, now)
        ended = (
            [call_id for call_id, token in self._calls.items() if not device.cm.awaits(token)] if self._calls else ()
        )
        for call_id in ended:
            # its connection ended: a controller that reconnects would assign it to the new connection
            device.client.forget(call_id, now)
            del self._calls[call_id]
        if device.records.im.take_written():
            device.keep(now, "im", record_words(device.records.im.texts))
        return bool(responses or calls or changed or events)

    def _snmp(self, now: int) -> bool:
        device = self._device
        events = device.snmp.events()
        for event in events:
            device.snmp_texts[event.which] = event.text
            device.keep(now, "snmp", {which.name: text for which, text in device.snmp_texts.items()})
            device.note(now, happened.SystemTextSet(event.text, event.which.name.capitalize()))
        return bool(events)

    def _neighbours(self, now: int) -> bool:
        device = self._device
        notes = device.neighbours.pump(now)
        if notes:
            device.dcp.aliases = device.neighbours.aliases
        for note in notes:
            device.note(now, note)
        for check in device.neighbours.checks():
            entry = port_diagnosis(check)
            if isinstance(check, CheckFailed):
                device.cm.diagnosis.add(entry)
            else:
                device.cm.diagnosis.remove(entry)
        return bool(notes)

    _STEPS = (_dcp, _neighbours, _ip, _rpc, _context_management, _snmp)
