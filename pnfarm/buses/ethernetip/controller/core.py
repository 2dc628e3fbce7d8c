"""The scanner without a clock and without tasks: sessions, cyclic data, programs; a :class:`Node` like a farm.

One port with one address serves all devices; each has a session (:mod:`pnfarm.buses.ethernetip.controller.session`),
and while its TCP connection is up an originator's machine.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.controllers.core import SessionCore
from pnfarm.buses.controllers.snapshot import session_row
from pnfarm.buses.ethernetip.controller.channels import SessionChannels
from pnfarm.buses.ethernetip.controller.requests import ExplicitRequest
from pnfarm.buses.ethernetip.controller.session import DeviceSession, Sign
from pnfarm.buses.ethernetip.controller.session_life import SessionLife
from pnfarm.errors import ConfigError
from pnfarm.protocols.enip.status import Service
from pnfarm.protocols.enip.wire.encapsulation import IO_PORT
from pnfarm.protocols.enip.wire.epath import logical_path
from pnfarm.protocols.enip.wire.message import message_request
from pnfarm.wire.endpoint import DatagramReceived, Services, StreamClosed, StreamOpened, StreamReceived

if TYPE_CHECKING:
    from pnfarm.buses.controller import ControllerHost
    from pnfarm.buses.ethernetip.controller.device_plan import EthernetIpPlan
    from pnfarm.protocols.enip.wire.message import MessageRequest
    from pnfarm.wire.endpoint import SocketEvent

__all__ = ["EthernetIpCore"]


class EthernetIpCore(SessionCore[DeviceSession]):
    """See the module's docstring.  Raises :class:`ConfigError` for a link without sockets."""

    without_channel = "the cyclic data of drive {!r} have no parameter channel (PKW)"
    life: SessionLife

    def __init__(self, plan: EthernetIpPlan, host: ControllerHost) -> None:
        sockets = host.sockets
        if sockets is None:
            raise ConfigError(f"a {host.link.kind} link has no sockets, which EtherNet/IP needs")
        sessions = [DeviceSession(index, device) for index, device in enumerate(plan.devices)]
        plain = [session for session in sessions if session.plan.plain]
        # one that is opened again leaves the pieces of before to the engine until its next tick
        super().__init__(plan, host, sessions, pieces=4 * len(plain))
        for session in plain:
            way = session.plan.connection
            outputs = self._add_plain(session.index, (way.output_octets, 1), (way.input_octets, 1))
            outputs.write({0: session.plan.outputs})
        self._sockets = sockets
        self._address = plan.ip
        self.channels = SessionChannels(self.columns, self.port, plan.ip.ip, sockets)
        self.life = SessionLife(self.port, sockets=sockets, channels=self.channels, log=host.log, seed=host.seed)
        sockets.set_user(self.socket_event)

    def start(self, now: int) -> None:
        """Take the address, and begin to connect the devices."""
        self._sockets.serve(self.port.index, Services(self._address, silent=(IO_PORT,)))
        for session in self.sessions:
            session.due_ns = now
            self.life.touch(session)
        self.settle(now)

    # -- node --------------------------------------------------------------------------------------------------------

    def receive(self, port: int, data: bytes, now: int) -> None:
        """Streams and datagrams are the sockets'; nothing else is for a scanner."""
        del port, data, now
        self.dropped["unasked-frame"] += 1

    def socket_event(self, event: SocketEvent, now: int) -> None:
        """Something of a stream; what belongs to none of the sessions is counted."""
        session = None if isinstance(event, DatagramReceived) else self.life.by_stream.get(event.stream)
        if session is None:
            self.dropped["unasked-datagram" if isinstance(event, DatagramReceived) else "unasked-stream"] += 1
            return
        match event:
            case StreamOpened():
                self.life.sign(session, Sign.OPENED, now)
            case StreamReceived(data=data) if session.machine is not None:
                session.machine.received(data, now)
            case StreamClosed():
                self.life.stream_closed(session, now)
            case _:
                pass
        self.life.touch(session)
        self.settle(now)

    # -- what the owner does -----------------------------------------------------------------------------------------

    def release(self, now: int) -> None:
        """Tell the devices that the scanner is idle, and end every connection in order."""
        for session in self.sessions:
            self.life.sign(session, Sign.RELEASE, now)
        self.settle(now)

    def set_mode(self, *, run: bool) -> None:
        """Run or idle, by the header of what is sent to all devices; connections stay."""
        self.channels.running = run
        for session in self.sessions:
            self.channels.set_mode(session, run=run)

    def snapshot(self) -> list[dict[str, Any]]:
        """One dict for each device, for the terminal and for JSON.

        ``zsw1`` are status words 1 and, above it, 2 of the response assembly; ``stw1`` is the control word of the
        command assembly and, above it, the type of its command: what comes nearest to PROFIdrive's words of these
        names.
        """
        return [
            session_row(
                session,
                self.columns,
                ip=str(session.plan.ip.ip),
                cycle_ns=session.plan.cycle_ns,
                of_axis={"refused_commands": int(self.columns.program[session.index].refused)},
                of_losses={"sessions_lost": session.measures.sessions_lost},
                of_bus={
                    "connection": session.plan.connection.kind,
                    "group": None if session.group is None else str(session.group),
                    "requests_answered": session.queue.answered,
                    "requests_failed": session.queue.failed,
                },
            )
            for session in self.sessions
        ]

    def inputs(self, name: str) -> bytes:
        """A device's input data as they came last, of a drive the first 64 octets.

        Raises :class:`ConfigError` for an unknown device.
        """
        session = self.named(name)
        return self.plain[name][1].read() if session.plan.plain else self.channels.read(session)

    def put_outputs(self, name: str, data: bytes) -> None:
        """Send these output data, zeros after them, to a device without an axis program.

        Raises :class:`ConfigError` for an unknown device, for one that a program commands, and for too many octets.
        """
        session = self.named(name)
        octets = session.plan.connection.output_octets
        if not session.plan.plain:
            raise ConfigError(f"the outputs of drive {name!r} are its axis program's")
        if len(data) > octets:
            raise ConfigError(f"{name!r} takes {octets} octets here, not {len(data)}")
        self.plain[name][0].write({0: data.ljust(octets, b"\0")})

    # -- explicit requests -------------------------------------------------------------------------------------------

    def request(self, name: str, request: MessageRequest, now: int) -> ExplicitRequest:
        """Ask a device something; the answer is in what is returned, once that is ``done``.

        Raises :class:`ConfigError` for an unknown device.
        """
        session = self.named(name)
        asked = ExplicitRequest(name, request)
        session.queue.add(asked, session.machine)
        self.life.touch(session)
        self.settle(now)
        return asked

    def get_attribute(self, name: str, class_id: int, instance: int, attribute: int, now: int) -> ExplicitRequest:
        """Get_Attribute_Single; see :meth:`request`."""
        path = logical_path(class_id, instance, attribute)
        return self.request(name, message_request(Service.GET_ATTRIBUTE_SINGLE, path), now)

    def set_attribute(
        self, name: str, class_id: int, instance: int, attribute: int, data: bytes, now: int
    ) -> ExplicitRequest:
        """Set_Attribute_Single; see :meth:`request`."""
        path = logical_path(class_id, instance, attribute)
        return self.request(name, message_request(Service.SET_ATTRIBUTE_SINGLE, path, data), now)

    # -- between the machines ----------------------------------------------------------------------------------------

    def settle(self, now: int) -> None:
        """Let the machines act until nothing moves."""
        while self.life.touched:
            touched, self.life.touched = self.life.touched, {}
            for session in touched.values():
                while self.life.pump(session, now):
                    pass
                self.arm(session)
