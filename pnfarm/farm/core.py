"""A whole farm without a clock and without tasks: stations, table, link, and the traffic between them.

:class:`Node` is what a runtime drives, in real time (:mod:`pnfarm.farm.realtime`) or virtual
(:mod:`pnfarm.farm.virtual`); the built-in controller is one too.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from pnfarm.buses.bus import DeviceServices, LineSegment, Segment, line_of
from pnfarm.buses.devices import device_bus
from pnfarm.buses.registry import bus
from pnfarm.config.axis import apply_axis
from pnfarm.config.machine import apply_machine
from pnfarm.drives.axis_handle import AxisHandle
from pnfarm.engine.channels.impairments import ImpairmentTable
from pnfarm.engine.channels.schedule import ChannelTable
from pnfarm.engine.columns import allocate
from pnfarm.engine.lateness import LatenessRecord
from pnfarm.errors import ConfigError, InternalError
from pnfarm.farm.engine_events import EngineEvents
from pnfarm.farm.events import PortsRefused
from pnfarm.farm.file.places import NO_FILE, FilePlaces
from pnfarm.farm.injections import make_manager
from pnfarm.farm.realism import imperfections
from pnfarm.farm.views.controller_record import ControllerRecords
from pnfarm.faults.gate.gate import GatedLink
from pnfarm.faults.gate.socket_gate import SocketGate
from pnfarm.links.base import unwrap
from pnfarm.links.egress import egress_of
from pnfarm.links.joined import lines_of
from pnfarm.links.kernel.linux import PacketLink
from pnfarm.links.memory import MemoryLink
from pnfarm.links.served_ports import ServedPorts
from pnfarm.links.sockets import sockets_of
from pnfarm.plant.plant import Plant
from pnfarm.protocols.deadlines import Deadlines
from pnfarm.station.axis import Axis
from pnfarm.station.imperfections import Imperfections
from pnfarm.station.station import Station
from pnfarm.table.access.fresh_rows import FreshRows, Same
from pnfarm.table.image import LOST_NEVER
from pnfarm.trace import TraceManager
from pnfarm.vocabulary.quoting import did_you_mean, shortened, shown

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping, Sequence
    from pathlib import Path

    from pnfarm.config.device import DeviceConfig
    from pnfarm.config.drive import DriveConfig
    from pnfarm.drives.description.model import Model
    from pnfarm.drives.parameters.memory import NonVolatile
    from pnfarm.farm.leaseholder import Leaseholder
    from pnfarm.farm.shard import Shard
    from pnfarm.links.base import Clock, Link, Port
    from pnfarm.links.serial.line import LineTally
    from pnfarm.plant.plan import PlantPlan
    from pnfarm.signals.owner import SignalOwner
    from pnfarm.station.event_log import EventLog
    from pnfarm.station.node import StationNode
    from pnfarm.station.plain_signals import NamedSignals
    from pnfarm.wire.endpoint import SocketAction, SocketEvent

__all__ = ["FarmCore"]

#: Impairment rows for each drive: injections into its cyclic frames that can be active at once.
IMPAIRMENTS_PER_DRIVE = 8
#: New axes with the motors and the hardware of the models.
_NEW_MOTORS: FreshRows[None] = FreshRows()


class FarmCore:
    """``ports`` belong to ``drives`` and then ``devices``, one by one; ``models`` gives a drive's model under its own
    identity.

    ``clock`` is the one by which frames are sent.  ``file`` says where in the farm file a station is.  ``shard``: which
    part of a farm these drives are, None for all.
    ``in_real_time``: whether models of the plant in Python may be late.
    """

    def __init__(
        self,
        name: str,
        drives: Sequence[DriveConfig],
        models: Callable[[DriveConfig], Model],
        link: Link,
        ports: Sequence[Port],
        *,
        memory: NonVolatile,
        log: EventLog,
        seed: bytes,
        clock: Clock,
        lldp: bool = True,
        shard: Shard | None = None,
        devices: Sequence[DeviceConfig] = (),
        plant: PlantPlan | None = None,
        in_real_time: bool = False,
        file: FilePlaces = NO_FILE,
        states: Path | None = None,
    ) -> None:
        self.name = name
        self.shard = shard
        #: Where the farm file says what the stations are.
        self.file = file
        #: Where its saved states are; None: nowhere.
        self.states_folder = states
        self._clock = clock
        gate = self._gate = GatedLink(link, clock)
        self.link: Link = gate
        self.log = log
        known = [models(config) for config in drives]
        count = sum(len(config.axes) for config in drives)
        needed = [device_bus(bus(config.bus)).device_rows(config) for config in devices]
        self.columns = allocate(
            images=count + len(devices),
            axes=count,
            channels=sum(
                bus(model.bus).channel_rows(model) * len(config.axes)
                for config, model in zip(drives, known, strict=True)
            )
            + sum(rows.channels for rows in needed),
            impairments=(len(drives) + len(devices)) * IMPAIRMENTS_PER_DRIVE + 8,
            plain=len(devices),
            pieces=sum(rows.pieces for rows in needed),
            traces=True,
        )
        #: What the drives' controllers did.
        self.controllers = ControllerRecords(
            log, {config.name: [axis.name for axis in config.axes] for config in drives}
        )
        self.columns.image.lost[:] = LOST_NEVER
        #: Whether the drives may send at this moment; None: always.
        self.may_speak: Callable[[], bool] | None = None
        #: The keeper of the memory's database and of the lease, None without.
        self.leaseholder: Leaseholder | None = None
        self.impairments = ImpairmentTable(self.columns)
        egress = egress_of(link)
        if egress is None:
            self.channels = ChannelTable(self.columns)
        else:
            self.channels = ChannelTable(self.columns, egress.egress_for)
            egress.set_listener(self.channels.choose_egress)
        #: How late the farm itself was.
        self.lateness = LatenessRecord(self.columns)
        #: What carries streams and datagrams of the drives that have addresses of their own.
        self._sockets = sockets_of(link)
        services = DeviceServices(self.channels, self.impairments, self.lateness, seed, lldp)
        if self._sockets is not None:
            services = replace(services, next_hop=self._sockets.next_hop, answers_arp=self._sockets.answers_arp)
        self.stations: list[Station] = []
        #: The axes of all stations, in the order of their rows.
        self.axes: list[Axis] = []
        self._by_port: dict[int, Station] = {}
        #: Stations by the rows of their process images.
        self._by_image: dict[int, Station] = {}
        self._by_name: dict[str, Station] = {}
        self._axis_by_name: dict[str, Axis] = {}
        self._deadlines = Deadlines()
        for config, model, port in zip(drives, known, ports[: len(drives)], strict=True):
            index = len(self.axes)
            flaws = imperfections(config.realism, model, config.name, by_source=config.realism_by_source)
            station = Station(
                config,
                model.bus,
                (model.name, *model.aliases),
                index,
                port,
                self.columns.image[index],
                partial(self._make_axes, config=config, model=model, flaws=flaws),
                partial(bus(model.bus).device, services=services),
                memory=memory,
                log=log,
                flaws=flaws,
            )
            for axis in station.axes:
                axis.handle.axis.powered = 1
                axis.handle.axis.front = model.front
                self._by_image[axis.index] = station
                self._axis_by_name[axis.configured_name] = axis
            self.axes += station.axes
            self._join(station)
        for row, (device, port) in enumerate(zip(devices, ports[len(drives) :], strict=True)):
            self._join(self._make_device(device, row, port, replace(services, plain_row=row), memory))
        #: What the drives on each bus have in common, and each port's part of it.
        self._segments = {
            name: bus(name).segment([s.device for s in self.stations if s.bus == name])
            for name in {station.bus for station in self.stations}
        }
        on_line = next((one for one in self._segments if line_of(bus(one))), "")
        innermost = unwrap(link)
        #: The serial lines, by the names of their buses.
        self.lines: dict[str, LineTally] = {name or on_line: carrier for name, carrier in lines_of(link).items()}
        if isinstance(innermost, MemoryLink):
            self.lines |= innermost.tallies()
        self._segment_of = {s.port.index: self._segments[s.bus] for s in self.stations}
        self._socket_gate = SocketGate(self._deliver, self._act, self._refuse_streams)
        #: What is behind the stations, None without.
        self.plant: Plant | None = None
        if plant is not None:
            signals = {name: found for name, one in self.devices.items() if (found := one.signals) is not None}
            self.plant = Plant(
                plant,
                {axis.configured_name: axis for axis in self.axes},
                signals,
                self.columns,
                lambda now, event: log.record(now, "", event),
                late=self.lateness.plant.note if in_real_time else None,
            )
        #: What is injected into the drives.
        self.injections = make_manager(
            self.stations,
            self.axes,
            self.signal_owners,
            self.columns,
            self.impairments,
            gate,
            self._socket_gate,
            settle=self.settle,
            log=log,
            clock=clock,
        )
        parts = () if self.plant is None else self.plant.parts.values()
        self.traces = TraceManager(self.axes, self.devices.values(), parts, self.columns, log)
        self._engine_events = EngineEvents(
            self.columns, self._by_image, self.axes, log, self.injections, self.traces, self.plant
        )
        gate.set_receiver(self.receive)
        self._ports: ServedPorts | None = None
        if self._sockets is not None:
            self._sockets.set_user(self.socket_event)
            self._ports = ServedPorts(self._sockets, self._socket_gate, self._ports_refused)
        self._port_of = {name: s.port.index for s in self.stations for name in s.names}
        if isinstance(innermost, (MemoryLink, PacketLink)):
            innermost.set_audience(self._audience)
        self._on_lines = [name for name in self._segments if line_of(bus(name))]
        shared: object = self._segments[self._on_lines[0]] if self._on_lines else None
        self._line_segment = shared if isinstance(shared, LineSegment) else None
        for carrier in lines_of(link).values():
            carrier.set_line_audience(self._line_audience)
            if self._line_segment is not None:
                carrier.set_slaves(self._line_segment.least_reply_bits)
        if isinstance(innermost, MemoryLink):
            innermost.set_line_audience(self._line_audience)

    def _make_axes(
        self, station: Station, *, config: DriveConfig, model: Model, flaws: Imperfections
    ) -> tuple[Axis, ...]:
        """The axes of a drive, in the next free rows."""
        axes = []
        for number, own in enumerate(config.axes):
            index = station.index + number
            axis, image = self.columns.axis[index], self.columns.image[index]
            _NEW_MOTORS.write(axis, Same(model), partial(model.apply_motor, axis))
            apply_axis(axis, own.load, own.motor, model.pitch)
            apply_machine(axis, own.machine, own.load, model.pitch)
            flaws.apply(axis)
            axis.step_ns = 4_000_000
            handle = AxisHandle(axis, image)
            made = Axis(
                station, number, own.name, model, index, handle, params=own.params, motion_tasks=own.motion_tasks
            )
            axes.append(made)
        return tuple(axes)

    def _make_device(
        self, config: DeviceConfig, row: int, port: Port, services: DeviceServices, memory: NonVolatile
    ) -> Station:
        """A device, whose process image is after those of all axes."""
        index = len(self.axes) + row
        return Station(
            config,
            config.bus,
            config.kinds,
            index,
            port,
            self.columns.image[index],
            lambda _: (),
            partial(device_bus(bus(config.bus)).described_device, services=services),
            memory=memory,
            log=self.log,
            flaws=Imperfections(),
        )

    def _join(self, station: Station) -> None:
        """Find a station by its port, its row and its name; its row takes strays for the port."""
        port = station.port
        station.image.port = port.index
        station.image.mac = int.from_bytes(port.mac, "big")
        self.stations.append(station)
        self._by_port[port.index] = station
        self._by_image[station.index] = station
        self._by_name[station.configured_name] = station

    def start(self, now: int) -> None:
        """Power on at ``now``: announce addresses."""
        for axis in self.columns.axis[: len(self.axes)]:
            axis.last_ns = now
            axis.boot_ns = now
            axis.clock.settings.start_ns = now
        for station in self.stations:
            station.boot(now)
            self.settle(station, now)
        if self.plant is not None:
            self.plant.start(now)
        if self._ports is not None:
            self._ports.may_wait = True

    def stop(self, now: int) -> None:
        """Tell every controller that its drive shuts down: an ERR-RTA for each connection."""
        for station in self.stations:
            station.device.leave(now)
            self.settle(station, now)

    def _named(self, name: str) -> Station | None:
        """By the name in the farm file, else by that on the bus."""
        return self._by_name.get(name) or next((s for s in self.stations if s.device.name == name), None)

    def station(self, name: str) -> Station:
        """A station by its name in the farm file, the one set by DCP, or an axis's; raises :class:`ConfigError`."""
        found = self._named(name)
        if found is None and (axis := self._axis_by_name.get(name)) is not None:
            return self._by_image[axis.index]
        if found is None:
            raise ConfigError(f"there is no drive {name!r} in farm {self.name}; `pnfarm inspect` lists them")
        return found

    def axis(self, name: str) -> Axis:
        """An axis by its name, or by that of a drive with one axis; raises :class:`ConfigError`."""
        if (found := self._axis_by_name.get(name)) is not None:
            return found
        station = self.station(name)
        if not station.axes:
            raise ConfigError(f"{name} is a device, not a drive; `pnfarm inspect` lists both")
        if len(station.axes) != 1:
            names = ", ".join(axis.configured_name for axis in station.axes)
            raise ConfigError(f"{name} is no single axis; its axes: {names}")
        return station.axes[0]

    def device(self, name: str) -> Station:
        """A station without axes, by its own names; raises :class:`ConfigError`."""
        found = self._named(name)
        if found is not None and not found.axes:
            return found
        known = [station.configured_name for station in self.stations if not station.axes]
        why = f"there is no device {shown(name)}{did_you_mean(name, known)}" if found is None else f"{name} is a drive"
        raise ConfigError(f"{why}; devices of farm {self.name}: {shortened(known) or 'none'}")

    def with_signals(self, name: str) -> tuple[SignalOwner, NamedSignals]:
        """A device, or a model of the plant, and its signals; raises :class:`ConfigError`."""
        if self.plant is not None and (part := self.plant.parts.get(name)) is not None:
            return part, part.signals
        station = self.device(name)
        if station.signals is None:
            raise ConfigError(f"device {station.configured_name} has no signals: none of its modules has data")
        return station, station.signals

    @property
    def devices(self) -> dict[str, Station]:
        """The stations without axes."""
        return {station.configured_name: station for station in self.stations if not station.axes}

    @property
    def signal_owners(self) -> dict[str, SignalOwner]:
        """The devices, and the models of the plant."""
        parts: Mapping[str, SignalOwner] = {} if self.plant is None else self.plant.parts
        return {**self.devices, **parts}

    def signals(self) -> dict[str, dict[str, Any]]:
        """By device or model of the plant, the signals (:class:`pnfarm.signals.signal.Signal`) by name."""
        devices = {name: owner.signals for name, owner in self.signal_owners.items()}
        return {
            name: {} if found is None else {one: found.signal(one) for one in found.names}
            for name, found in devices.items()
        }

    @property
    def segments(self) -> Mapping[str, Segment]:
        """What the stations on each bus have in common."""
        return self._segments

    # -- frames and time ---------------------------------------------------------------------------------------------

    def receive(self, port: int, frame: bytes, now: int) -> None:
        station = self._by_port.get(port)
        if station is None:
            raise InternalError(f"the link delivered a frame for port {port}, which no drive has")
        if not self._segment_of[port].admits(port, frame, now):
            return
        if not any(map(self.injections.concern, station.names)):
            station.receive(frame, now)
            self.settle(station, now)
            return
        for name in station.names:
            self.injections.refresh(name, now)
        station.receive(frame, now)
        self.settle(station, now)
        for name in station.names:
            self.injections.poke(name, now)

    def socket_event(self, event: SocketEvent, now: int) -> None:
        """Something of a drive's stream, or a datagram."""
        station = self._by_port.get(event.port)
        if station is None:
            raise InternalError(f"a socket of port {event.port} delivered data, and no drive has it")
        self.injections.refresh(station.configured_name, now)
        self._socket_gate.received(event, now)
        self.injections.poke(station.configured_name, now)

    def _deliver(self, port: int, event: SocketEvent, now: int) -> None:
        """What passes the gate reaches its station."""
        station = self._by_port[port]
        station.socket_event(event, now)
        self.settle(station, now)

    def _act(self, port: int, action: SocketAction) -> None:
        if self._sockets is not None and (self.may_speak is None or self.may_speak()):
            self._sockets.act(port, action)

    def _refuse_streams(self, port: int, refused: bool) -> None:
        if self._ports is not None:
            self._ports.refuse(port, refused=refused, now=self._clock())
            self._arm(self._by_port[port])

    def _ports_refused(self, port: int, why: str, now: int) -> None:
        self.log.record(now, self._by_port[port].configured_name, PortsRefused(why))

    def _carry(self, station: StationNode, now: int) -> None:
        """Give a station the address and the ports that it has now, and send what it has to send."""
        port, services = station.port.index, station.services()
        if self._ports is not None:
            self._ports.keep(port, None if services is None else (station.starts, services), now)
        elif services is not None:
            raise ConfigError(f"drive {station.configured_name} needs sockets, which a {self.link.kind} link lacks")
        for action in station.pump_sockets(now):
            self._socket_gate.sent(port, action, now)

    def _audience(self, frame: bytes) -> list[int] | None:
        """Ports that a group-addressed frame can concern, None for any.

        Drives with an injection see each frame: rules count it, and listeners hear it.
        """
        besides, now = self._gate.engaged, self._clock()
        besides.update(self._port_of[name] for name in self.injections.concerned)
        found: list[int] = []
        concerns_all = True
        for name, segment in self._segments.items():
            if name in self._on_lines:
                continue
            ports = segment.audience(frame, now, besides)
            if ports is None:
                found += (s.port.index for s in self.stations if s.bus == name)
            else:
                found += ports
                concerns_all = False
        return None if concerns_all else sorted(besides.union(found))

    def _line_audience(self, telegram: bytes) -> Collection[int] | None:
        """Ports that a telegram of a serial line can concern; one bus has a line."""
        return self._segments[self._on_lines[0]].audience(telegram, self._clock()) if self._on_lines else ()

    def line_counts(self, name: str) -> Mapping[str, int]:
        """What happened on a line, by kind."""
        segment = self._segments.get(name)
        return segment.counts() if isinstance(segment, LineSegment) else {}

    def poll(self, octets: bytes, now: int) -> tuple[int, bytes] | None:
        """Port and answer of a drive whose cyclic data these octets poll, None where more is to be done.

        The fast path of most telegrams of a line: no injection, no deadline and no listener is concerned.
        """
        segment = self._line_segment
        if segment is None or (self.may_speak is not None and not self.may_speak()):
            return None
        port = segment.addressed(octets)
        if port is None:
            return None
        station = self._by_port[port]
        if not station.on_the_wire or self.injections.concern(station.configured_name) or not self._gate.passes(port):
            return None
        answer = segment.poll(port, octets, now)
        return None if answer is None else (port, answer)

    def answer(self, octets: Any, length: int, now: int) -> tuple[int, memoryview] | None:
        """The still shorter way of a poll that is like the one before, while no injection concerns any drive."""
        segment = self._line_segment
        if (
            segment is None
            or self.injections.concerned
            or not self._gate.is_idle
            or (self.may_speak is not None and not self.may_speak())
        ):
            return None
        return segment.answer(octets, length, now)

    def settle(self, station: StationNode, now: int) -> None:
        """Let a station finish processing an input, send its frames, and note its next deadline."""
        frames = station.pump(now)
        self._segment_of[station.port.index].settled(station.port.index)
        for frame in frames:
            self.link.send(station.port.index, frame)
        if frames and self._line_segment is not None:
            self._line_segment.answered(station.port.index, now)
        if station.has_sockets:
            self._carry(station, now)
        self._arm(station)
        if self.plant is not None:
            self.plant.settled(station.names)
        # a connection, a parameter: an injection may wait for it
        for name in station.names:
            self.injections.touch(name)

    def _arm(self, station: StationNode) -> None:
        due = station.next_deadline()
        if self._ports is not None and (again := self._ports.next_deadline(station.port.index)) is not None:
            due = again if due is None else min(due, again)
        self._deadlines.set(station.index, due)

    def settle_owner(self, owner: SignalOwner, now: int) -> None:
        """The same for whatever has signals: the plant takes what is written in its next step."""
        if isinstance(owner, Station):
            self.settle(owner, now)

    @property
    def now(self) -> int:
        """The farm's time, ns."""
        return self._clock()

    @property
    def events_lost(self) -> int:
        """Events of the engine that were overwritten before they were read."""
        return self._engine_events.lost

    def service(self, now: int) -> None:
        for touched in self._engine_events.drain(now):
            self.settle(touched, now)
        for index in self._deadlines.take(now):
            station = self._by_image[index]
            station.handle_timeout(now)
            self.settle(station, now)
        self.injections.handle_timeout(now)
        for happened in self.injections.events():
            self.log.record(happened.now, happened.drive, happened.event)
        self.traces.handle_timeout(now)
        self.log.service(now)
        if self.plant is not None:
            self.plant.service(now)

    def next_deadline(self) -> int | None:
        first = self._deadlines.first()
        plant = None if self.plant is None else self.plant.next_deadline()
        for due in (self.injections.next_deadline(), self.traces.next_deadline(), self.log.next_deadline(), plant):
            if due is not None and (first is None or due < first):
                first = due
        return first
