"""The scanner without a clock and without tasks: sessions, cyclic data, programs; a :class:`Node` like a farm.

One port with one address serves all devices; each has a session (:mod:`pnfarm.buses.ethernetip.controller.session`),
and while its TCP connection is up an originator's machine.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from pnfarm.buses.axis_program import configure
from pnfarm.buses.ethernetip.controller.channels import SessionChannels
from pnfarm.buses.ethernetip.controller.events import PhaseChanged
from pnfarm.buses.ethernetip.controller.requests import ExplicitRequest, RequestQueue
from pnfarm.buses.ethernetip.controller.session import DeviceSession, SessionState, Sign
from pnfarm.buses.ethernetip.controller.session_life import SessionLife
from pnfarm.buses.ethernetip.controller.snapshot import snapshot_row
from pnfarm.drives.parameters.parameter import ParameterError
from pnfarm.engine.columns import Columns, allocate
from pnfarm.errors import ConfigError
from pnfarm.protocols.deadlines import Deadlines
from pnfarm.protocols.enip.status import Service
from pnfarm.protocols.enip.wire.encapsulation import IO_PORT
from pnfarm.protocols.enip.wire.epath import logical_path
from pnfarm.protocols.enip.wire.message import message_request
from pnfarm.table import engine_row, program
from pnfarm.table.channel import W_START
from pnfarm.table.image import LOST_NEVER
from pnfarm.wire.endpoint import DatagramReceived, Services, StreamClosed, StreamOpened, StreamReceived

if TYPE_CHECKING:
    from typing import NoReturn

    from pnfarm.buses.controller import ControllerHost
    from pnfarm.buses.ethernetip.controller.device_plan import EthernetIpPlan
    from pnfarm.drives.profiles.cip.part import CipInstance
    from pnfarm.drives.profiles.profidrive.pkw import Pkw
    from pnfarm.links.base import Link, Port
    from pnfarm.protocols.enip.wire.message import MessageRequest
    from pnfarm.wire.endpoint import SocketEvent

__all__ = ["ScannerCore"]

#: The Parameter object, and its attribute with the value (AKD EtherNet/IP manual 7.3).
PARAMETER_CLASS, VALUE = 0x0F, 1


class ScannerCore:
    """See the module's docstring.  Raises :class:`ConfigError` for a link without sockets."""

    def __init__(self, plan: EthernetIpPlan, host: ControllerHost, *, tick_ns: int = 1_000_000) -> None:
        sockets = host.sockets
        if sockets is None:
            raise ConfigError(f"a {host.link.kind} link has no sockets, which EtherNet/IP needs")
        self.name = plan.name
        self.link: Link = host.link
        self.port: Port = host.port
        self.log = host.log
        self.dropped: dict[str, int] = {}
        self._sockets = sockets
        self._address = plan.ip
        count = len(plan.devices)
        self.columns: Columns = allocate(images=count, programs=count, channels=count * 2 + 8)
        self.columns.engine[0].tick_ns = tick_ns
        self.columns.image.lost[:] = LOST_NEVER
        self.channels = SessionChannels(self.columns, self.port, plan.ip.ip, sockets)
        self.sessions = [
            DeviceSession(index, device, RequestQueue(device.explicit == "connected"))
            for index, device in enumerate(plan.devices)
        ]
        self._by_name = {session.plan.name: session for session in self.sessions}
        self.life = SessionLife(self.port, sockets=sockets, channels=self.channels, log=host.log, seed=host.seed)
        self._deadlines = Deadlines()
        self._tail = 0
        for session in self.sessions:
            configure(self.columns.program[session.index], session.plan.program, asdict(session.plan.steps))
        self.link.set_receiver(self.receive)
        sockets.set_user(self.socket_event)

    def start(self, now: int) -> None:
        """Take the address, and begin to connect the devices."""
        self._sockets.serve(self.port.index, Services(self._address, silent=(IO_PORT,)))
        for session in self.sessions:
            session.due_ns = now
            self.life.touch(session)
        self._settle(now)

    # -- node --------------------------------------------------------------------------------------------------------

    def receive(self, port: int, data: bytes, now: int) -> None:
        """Streams and datagrams are the sockets'; nothing else is for a scanner."""
        del port, data, now
        self._drop("unasked-frame")

    def socket_event(self, event: SocketEvent, now: int) -> None:
        """Something of a stream; what belongs to none of the sessions is counted."""
        session = None if isinstance(event, DatagramReceived) else self.life.by_stream.get(event.stream)
        if session is None:
            self._drop("unasked-datagram" if isinstance(event, DatagramReceived) else "unasked-stream")
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
        self._settle(now)

    def service(self, now: int) -> None:
        """See :class:`pnfarm.buses.controller.Controller`."""
        self._drain(now)
        for index in self._deadlines.take(now):
            session = self.sessions[index]
            self.life.touch(session)
            if session.due_ns is not None and session.due_ns <= now:
                session.due_ns = None
                self.life.timed(session, now)
            if session.machine is not None:
                session.machine.handle_timeout(now)
        self._settle(now)

    def next_deadline(self) -> int | None:
        return self._deadlines.first()

    def _drop(self, reason: str) -> None:
        self.dropped[reason] = self.dropped.get(reason, 0) + 1

    # -- what the owner does -----------------------------------------------------------------------------------------

    def release(self, now: int) -> None:
        """Tell the devices that the scanner is idle, and end every connection in order."""
        for session in self.sessions:
            self.life.sign(session, Sign.RELEASE, now)
        self._settle(now)

    def set_mode(self, *, run: bool) -> None:
        """Run or idle, by the header of what is sent to all devices; connections stay."""
        self.channels.running = run
        for session in self.sessions:
            self.channels.set_mode(session, run=run)

    @property
    def all_stopped(self) -> bool:
        return all(session.state is SessionState.STOPPED for session in self.sessions)

    @property
    def all_connected(self) -> bool:
        """Every device exchanges data both ways."""
        return all(s.state is SessionState.DATA and self.columns.image[s.index].valid for s in self.sessions)

    @property
    def all_running(self) -> bool:
        """Every enabled axis is in operation."""
        return all(
            int(self.columns.program[s.index].phase) == program.RUNNING or not s.plan.program.enable
            for s in self.sessions
        )

    def exchanging(self, name: str) -> bool:
        """Whether a device's data is valid; false for one that is not the scanner's."""
        session = self._by_name.get(name)
        return session is not None and bool(self.columns.image[session.index].valid)

    def snapshot(self) -> list[dict[str, Any]]:
        """One dict for each device, for the terminal and for JSON."""
        return [snapshot_row(session, self.columns) for session in self.sessions]

    def session(self, name: str) -> DeviceSession | None:
        return self._by_name.get(name)

    def inputs(self, name: str) -> bytes:
        """The first 64 octets of a device's input data as they came last.

        Raises :class:`ConfigError` for an unknown device.
        """
        return self.channels.read(self._named(name))

    def put_outputs(self, name: str, data: bytes) -> None:
        """Send these output data (the first 64 octets of them) to a device without an axis program.

        Raises :class:`ConfigError` for an unknown device, for one that a program commands, and for too many octets.
        """
        session = self._named(name)
        octets = session.plan.connection.output_octets
        if session.plan.described is not None:
            raise ConfigError(f"the outputs of drive {name!r} are its axis program's")
        if len(data) > min(octets, 64):
            raise ConfigError(f"{name!r} takes {min(octets, 64)} octets here, not {len(data)}")
        self.channels.write(session, data)

    # -- explicit requests -------------------------------------------------------------------------------------------

    def request(self, name: str, request: MessageRequest, now: int) -> ExplicitRequest:
        """Ask a device something; the answer is in what is returned, once that is ``done``.

        Raises :class:`ConfigError` for an unknown device.
        """
        session = self._named(name)
        asked = ExplicitRequest(name, request)
        session.queue.add(asked, session.machine)
        self.life.touch(session)
        self._settle(now)
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

    def read_parameter(self, name: str, parameter: str | int, now: int) -> ExplicitRequest:
        """A parameter of a drive by its name or instance; :meth:`parameter_value` has the number.

        Raises :class:`ConfigError` for an unknown drive or parameter.
        """
        return self.get_attribute(name, PARAMETER_CLASS, self._instance(name, parameter).number, VALUE, now)

    def write_parameter(self, name: str, parameter: str | int, value: int, now: int) -> ExplicitRequest:
        """Write a parameter, a whole number as on the wire; any number executes a command.

        Raises :class:`ConfigError` as :meth:`read_parameter` does, and for a number that does not fit.
        """
        instance = self._instance(name, parameter)
        try:
            data = value.to_bytes(instance.size, "little", signed=instance.signed)
        except OverflowError:
            raise ConfigError(f"{instance.name}: {value} does not fit into {instance.size} octets") from None
        return self.set_attribute(name, PARAMETER_CLASS, instance.number, VALUE, data, now)

    def parameter_value(self, name: str, parameter: str | int, request: ExplicitRequest) -> int:
        """The number that a drive answered to :meth:`read_parameter`.  Raises :class:`ConfigError` without one."""
        if not request.ok:
            raise ConfigError(request.error or "there is no answer yet")
        return int.from_bytes(request.data, "little", signed=self._instance(name, parameter).signed)

    def _instance(self, name: str, parameter: str | int) -> CipInstance:
        model = self._named(name).plan.described
        if model is None:
            raise ConfigError(f"the parameters of {name!r} are not known: use its attributes")
        try:
            found = model.resolve(parameter)[0]
            return model.cip.instances[found.pnu]
        except (ParameterError, KeyError):
            raise ConfigError(f"{model.name} has no parameter {parameter!r} with an instance") from None

    def put_parameter_task(self, name: str, task: Pkw) -> None:
        """See :class:`pnfarm.buses.controller.Controller`: an assembly has no such channel."""
        del task
        self._without_channel(name)

    def parameter_answer(self, name: str) -> Pkw:
        """As :meth:`put_parameter_task`."""
        self._without_channel(name)

    def _without_channel(self, name: str) -> NoReturn:
        self._named(name)
        raise ConfigError(f"the cyclic data of drive {name!r} have no parameter channel (PKW)")

    def _named(self, name: str) -> DeviceSession:
        session = self._by_name.get(name)
        if session is None:
            raise ConfigError(f"controller {self.name} has no drive {name!r}")
        return session

    # -- between the machines ----------------------------------------------------------------------------------------

    def _settle(self, now: int) -> None:
        """Let the machines act until nothing moves."""
        while self.life.touched:
            touched, self.life.touched = self.life.touched, {}
            for session in touched.values():
                while self.life.pump(session, now):
                    pass
                due = (session.due_ns, session.machine.next_deadline() if session.machine is not None else None)
                self._deadlines.set(session.index, min((time for time in due if time is not None), default=None))

    # -- the engine's events -----------------------------------------------------------------------------------------

    def _drain(self, now: int) -> None:
        head = int(self.columns.engine[0].event_head)
        size = self.columns.events.shape[0]
        if head - self._tail > size:
            self._tail = head - size
            self._expired_unseen(now)
        while self._tail < head:
            event = self.columns.events[self._tail % size]
            kind, row, when, value = int(event.kind), int(event.row), int(event.now_ns), int(event.value)
            self._tail += 1
            if kind == engine_row.EXPIRED:
                self._expired(self.sessions[int(self.columns.cpm[row].image)], row, now)
            elif kind == engine_row.PHASE_CHANGED:
                self.log.record(when, self.sessions[row].plan.name, PhaseChanged(value >> 8, value & 0xFF))

    def _expired(self, session: DeviceSession, row: int, now: int) -> None:
        """A session's consumer timed out; a row that was reopened since has not."""
        if session.consumer == row and self.columns.cpm[row].expirations:
            self.life.expired(session, now)

    def _expired_unseen(self, now: int) -> None:
        """The ring of events overran: a connection whose end was lost with it must end nevertheless."""
        for session in self.sessions:
            if session.consumer is not None and self.columns.cpm[session.consumer].state == W_START:
                self._expired(session, session.consumer, now)
