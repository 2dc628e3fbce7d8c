"""A bus's controller without a clock and without tasks, a :class:`Node` like a farm: what it has on any bus.

Drives are asked by their names.  The axis programs run in the engine's table, a row for each device of the plan.
"""

from __future__ import annotations

from abc import abstractmethod
from collections import Counter
from dataclasses import asdict
from itertools import accumulate
from typing import TYPE_CHECKING, Any, Generic

from pnfarm.buses.controller import Controller, DeviceData
from pnfarm.buses.controllers.axis_program import configure
from pnfarm.buses.controllers.events import PhaseChanged
from pnfarm.buses.controllers.parameter_words import parameter_answer, put_parameter_task
from pnfarm.buses.controllers.session import DATA, STOPPED
from pnfarm.buses.controllers.session_life import S
from pnfarm.engine.columns import Columns, allocate
from pnfarm.errors import ConfigError
from pnfarm.protocols.deadlines import Deadlines
from pnfarm.table import engine_row, program
from pnfarm.table.access.plain_data import ConsumedData, ProvidedData
from pnfarm.table.access.record_fields import field_views
from pnfarm.table.channel import W_START
from pnfarm.table.image import LOST_NEVER
from pnfarm.table.signals import PKW_HEAD, WORD_NONE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.buses.controller import ControllerHost
    from pnfarm.buses.controllers.device_plan import PlannedDevice
    from pnfarm.buses.controllers.session_life import Life
    from pnfarm.drives.profiles.profidrive.pkw import Pkw

__all__ = ["DriveCore", "SessionCore"]


class DriveCore(Controller):
    """``plan`` has the name and the devices.

    With ``pieces`` in its frames each device has a row of plain data, by its place.
    """

    #: What the cyclic data of a drive are called where they have no parameter channel.
    without_channel = "the telegram of drive {!r} has no parameter channel (PKW)"

    def __init__(self, plan: Any, host: ControllerHost, *, channels: int, pieces: int = 0) -> None:
        self.name: str = plan.name
        self.devices: Sequence[PlannedDevice] = plan.devices
        self.link, self.port, self.log = host.link, host.port, host.log
        self.dropped: Counter[str] = Counter()
        #: The axes of all devices, row by row.
        self.axes = [axis for device in self.devices for axis in device.axes]
        count = len(self.axes)
        plain = len(self.devices) if pieces else 0
        self.columns: Columns = allocate(images=count, programs=count, channels=channels, plain=plain, pieces=pieces)
        self.columns.image.lost[:] = LOST_NEVER
        #: What is sent to the devices without axes, and what comes from them, by name.
        self.plain: dict[str, tuple[ProvidedData, ConsumedData]] = {}
        #: The first row of each device.
        self.first_rows = list(accumulate((len(one.axes) for one in self.devices[:-1]), initial=0))[: len(self.devices)]
        #: Devices, and the rows of axes, by name; a device's is that of its first axis.
        self._places = {
            name: place for place, one in enumerate(self.devices) for name, _ in (*one.axes, (one.name, one))
        }
        self._rows = {device.name: row for device, row in zip(self.devices, self.first_rows, strict=True)}
        self._rows |= {name: row for row, (name, _) in enumerate(self.axes)}
        self._tail = 0
        (self._head,) = field_views(self.columns.engine[0], "event_head")
        for row, (_, axis) in zip(self.columns.program, self.axes, strict=True):
            configure(row, axis.program, asdict(axis.steps) | {"life": axis.life})
        self.link.set_receiver(self.receive)

    def _add_plain(self, place: int, outputs: tuple[int, int], inputs: tuple[int, int]) -> ProvidedData:
        """What a device without axes is sent, and what comes from it: octets and pieces of each; gives the former."""
        provided = ProvidedData(self.columns.provided, place, *outputs)
        self.plain[self.devices[place].name] = provided, ConsumedData(self.columns.consumed, place, *inputs)
        return provided

    def _place(self, name: str) -> int:
        """The place of a device, by its name or an axis's.  Raises :class:`ConfigError` for an unknown one."""
        place = self._places.get(name)
        if place is None:
            raise ConfigError(f"controller {self.name} has no drive {name!r}")
        return place

    @property
    def device_data(self) -> dict[str, DeviceData]:
        return {
            one.name: DeviceData(one.data_signals, one.data_places, *self.plain[one.name])
            for one in self.devices
            if one.data_signals and one.name in self.plain
        }

    @property
    def all_running(self) -> bool:
        """Every enabled axis is in operation."""
        return all(
            int(row.phase) == program.RUNNING or not axis.program.enable
            for row, (_, axis) in zip(self.columns.program, self.axes, strict=True)
        )

    def exchanging(self, name: str) -> bool:
        """Whether a drive's data is valid; false for one that is not the controller's."""
        row = self._rows.get(name)
        return row is not None and bool(self.columns.image["valid"][row])

    # -- the parameter channel (PKW) -----------------------------------------------------------------------------------

    def put_parameter_task(self, name: str, task: Pkw) -> None:
        put_parameter_task(self._channel_image(name), task)

    def parameter_answer(self, name: str) -> Pkw:
        return parameter_answer(self._channel_image(name))

    def _channel_image(self, name: str) -> Any:
        self._place(name)
        row = self._rows[name]
        if PKW_HEAD not in {code >> 2 for code in self.axes[row][1].output_words if code != WORD_NONE}:
            raise ConfigError(self.without_channel.format(name))
        return self.columns.image[row]

    # -- the engine's events -------------------------------------------------------------------------------------------

    def drain(self, now: int) -> None:
        """Take the engine's events since the last time."""
        head = self._head[0]
        size = self.columns.events.shape[0]
        if head - self._tail > size:
            self._tail = head - size
            self.overran(now)
        while self._tail < head:
            # as a tuple, in the order of the layout: each attribute would take a microsecond
            kind, row, when, value = self.columns.events[self._tail % size].item()
            self._tail += 1
            if kind == engine_row.EXPIRED:
                self.expired(row, now)
            elif kind == engine_row.PHASE_CHANGED:
                self.log.record(when, self.axes[row][0], PhaseChanged(value >> 8, value & 0xFF))

    def overran(self, now: int) -> None:
        """Events were lost, which only channels mind."""

    def expired(self, row: int, now: int) -> None:
        """No data came in a channel, of which only some controllers have any."""


class SessionCore(DriveCore, Generic[S]):
    """One with a session for each device, whose channels are the engine's."""

    life: Life[S]

    def __init__(self, plan: Any, host: ControllerHost, sessions: list[S], *, pieces: int = 0) -> None:
        channels = 2 * sum(session.plan.channels for session in sessions) + 8
        super().__init__(plan, host, channels=channels, pieces=pieces)
        self.sessions = sessions
        for session, row in zip(sessions, self.first_rows, strict=True):
            session.row = row
        self._by_row = {session.row: session for session in sessions}
        self._deadlines = Deadlines()

    # -- node ----------------------------------------------------------------------------------------------------------

    def service(self, now: int) -> None:
        self.drain(now)
        for index in self._deadlines.take(now):
            session = self.sessions[index]
            self.life.touch(session)
            if session.due_ns is not None and session.due_ns <= now:
                session.due_ns = None
                self.life.timed(session, now)
            if session.machine is not None:
                session.machine.handle_timeout(now)
        self.timed(now)
        self.settle(now)

    def timed(self, now: int) -> None:
        """Do what is due besides: of machines that all sessions share."""

    def next_deadline(self) -> int | None:
        return self._deadlines.first()

    def arm(self, session: S) -> None:
        """Note when a session is next due."""
        due = (session.due_ns, None if session.machine is None else session.machine.next_deadline())
        self._deadlines.set(session.index, min((time for time in due if time is not None), default=None))

    @abstractmethod
    def settle(self, now: int) -> None:
        """Let the machines act until nothing moves, and send."""

    # -- state for observers -------------------------------------------------------------------------------------------

    @property
    def all_stopped(self) -> bool:
        return all(session.state == STOPPED for session in self.sessions)

    @property
    def all_connected(self) -> bool:
        """Every device exchanges data both ways."""
        return all(
            s.state == DATA
            and self.columns.image[s.row].valid
            and all(self.columns.cpm[row].received for row in s.consumers[1:])
            for s in self.sessions
        )

    def session(self, name: str) -> S | None:
        place = self._places.get(name)
        return None if place is None else self.sessions[place]

    def named(self, name: str) -> S:
        """A drive's session.  Raises :class:`ConfigError` for an unknown drive."""
        return self.sessions[self._place(name)]

    # -- the engine's events -------------------------------------------------------------------------------------------

    def expired(self, row: int, now: int) -> None:
        """A session's consumer timed out; a row that was reopened since has not."""
        session = self._by_row[int(self.columns.cpm[row].image)]
        if row in session.consumers and self.columns.cpm[row].expirations:
            self.life.expired(session, now)

    def overran(self, now: int) -> None:
        """A connection whose end was lost with the events must end nevertheless."""
        for session in self.sessions:
            for row in [row for row in session.consumers if self.columns.cpm[row].state == W_START]:
                self.expired(row, now)
