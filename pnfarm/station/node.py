"""One node on a bus, whatever the bus: its supply, its memory, its axes, and what happens to it.

A station is bytes and ``now`` in, frames out, like the machines of its bus's device; the farm's runtime carries the
frames.  It does itself what lies between the drive and the bus:

* non-volatile memory is read at power-on, and what a station saves is written through;
* a station with a boot time neither receives nor sends until it has booted;
* commands of a drive itself (save, reboot, another telegram, the lamp) are carried out (:mod:`pnfarm.station.axis`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from pnfarm.errors import EnvironmentError_
from pnfarm.station.device import KeptValueError, SocketDevice
from pnfarm.station.events import (
    Booted,
    MemoryNotTaken,
    MemoryNotWritten,
    PowerLost,
    PowerReturned,
)
from pnfarm.station.visits import Visits

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from pnfarm.drives.parameters.memory import NonVolatile
    from pnfarm.station.description import StationDescription
    from pnfarm.station.device import Device
    from pnfarm.station.event import Event
    from pnfarm.station.event_log import EventLog
    from pnfarm.station.imperfections import Imperfections
    from pnfarm.station.plain_signals import PlainSignals
    from pnfarm.wire.endpoint import Services, SocketAction, SocketEvent

__all__ = ["NodePart", "StationConfig", "StationNode", "StationPort"]


class StationPort(Protocol):
    """Where the station is on the wire: the link's number for it, and its address."""

    @property
    def index(self) -> int: ...
    @property
    def mac(self) -> bytes: ...


class StationConfig(Protocol):
    """Settings of the farm file that any station has; the bus's device reads further ones."""

    @property
    def name(self) -> str: ...


class NodePart(Protocol):
    """What a node has several of: its axes, each with a supply and a memory of its own."""

    @property
    def configured_name(self) -> str: ...

    def restore(self, kept: Mapping[str, Any]) -> list[str]:
        """Start again with the contents of memory; a sentence for each that does not fit."""

    def restore_history(self, kept: Mapping[str, Any]) -> None:
        """The farm starts: take back what outlives it."""

    def commission(self) -> None:
        """Apply the farm file's settings."""

    def supply_gone(self) -> None:
        """The supply goes."""

    def supply_returned(self) -> None:
        """The supply returns."""

    def carry_out(self, now: int) -> bool:
        """Carry out its commands; returns whether there were any."""


class StationNode:
    """See the module's docstring.

    ``bus`` names its bus, ``kinds`` what it is: a model's name and aliases, or those of a maker's description.
    ``index`` is the row of its process image, the first axis's if it has axes, ``image`` that row; ``make_parts`` gives
    its parts and ``make_device`` its bus's device.
    """

    def __init__(
        self,
        config: StationConfig,
        bus: str,
        kinds: Sequence[str],
        index: int,
        port: StationPort,
        image: Any,
        make_parts: Callable[[Any], Sequence[NodePart]],
        make_device: Callable[[Any], Device],
        *,
        memory: NonVolatile,
        log: EventLog,
        flaws: Imperfections,
    ) -> None:
        self.config = config
        self.configured_name = config.name
        self.bus = bus
        self.kinds = tuple(kinds)
        self.index = index
        self.port = port
        self.image = image
        #: Its imperfections, and its latency for parameter requests.
        self.flaws = flaws
        self.latency = flaws.latency()
        #: Whether the control supply is on.
        self.powered = True
        #: A user has switched it off: what else held it off does not switch it on.
        self.switched_off = False
        #: When it was powered on last, ns.
        self.booted_ns = 0
        #: When its lamp was last made to flash.
        self.signalled_ns: int | None = None
        #: Contents of non-volatile memory; :meth:`save` writes them.
        self.kept: dict[str, Any] = {}
        self._memory = memory
        self._log = log
        self._left_out: list[str] = []
        #: A save that failed and is not reported yet.
        self._not_written: MemoryNotWritten | None = None
        #: When a station that boots comes on the wire.
        self._answers_ns: int | None = None
        #: What controllers did with it.
        self.visits = Visits()
        #: How often it came on the wire.
        self.starts = 0
        #: Of a station with plain data; its device sets them.
        self.signals: PlainSignals | None = None
        #: Of a station that its maker's file describes; its device sets it.
        self.description: StationDescription | None = None
        self.parts = tuple(make_parts(self))
        #: Its own name and those of its parts.
        self.names = tuple(dict.fromkeys((config.name, *(part.configured_name for part in self.parts))))
        self.device = make_device(self)
        # found out once: it is asked for each frame
        self._sockets = self.device if isinstance(self.device, SocketDevice) else None
        self._build()
        for part in self.parts:
            part.restore_history(self.kept)

    # -- life --------------------------------------------------------------------------------------------------------

    def _build(self) -> None:
        """Create stores and machines as after power-on, with the contents of non-volatile memory."""
        kept = self._memory.load(self.configured_name) or {}
        try:
            self.device.check(kept)
        except KeptValueError as exc:
            raise self._memory.damaged(f"of drive {self.configured_name}, {exc}") from exc
        self.kept = dict(kept)
        self._left_out = [sentence for part in self.parts for sentence in part.restore(kept)]
        self.device.commission(kept)
        for part in self.parts:
            part.commission()
        self.device.build(self.kept)

    @property
    def on_the_wire(self) -> bool:
        """Whether it receives and sends: powered, and booted."""
        return self.powered and self._answers_ns is None

    def boot(self, now: int) -> None:
        """The station was powered on: it comes on the wire at once, or when it has booted."""
        self.booted_ns = now
        if self.flaws.answer_ns:
            self._answers_ns = now + self.flaws.answer_ns
        else:
            self._start(now)

    def _start(self, now: int) -> None:
        """The station came on the wire."""
        self._answers_ns = None
        self.starts += 1
        left_out = [*self._left_out, *self.device.start(now)]
        if left_out:
            self.note(now, MemoryNotTaken(len(left_out), left_out[0]))

    def power_off(self, now: int) -> None:
        """Cut the supply: connections end, nothing is answered."""
        self.device.stop(now)
        self.powered = False
        for part in self.parts:
            part.supply_gone()
        self._answers_ns = None
        self.note(now, PowerLost())

    def power_on(self, now: int) -> None:
        """Boot with the contents of non-volatile memory."""
        self._build()
        for part in self.parts:
            part.supply_returned()
        self.powered, self.switched_off = True, False
        self.note(now, PowerReturned())
        self.boot(now)

    def switch(self, now: int, *, on: bool) -> bool:
        """A user's switch; whether it changed the supply."""
        changed = self.powered is not on
        if changed:
            (self.power_on if on else self.power_off)(now)
        self.switched_off = not on
        return changed

    def power_cycle(self, now: int) -> None:
        """Off and on again."""
        self.power_off(now)
        self.power_on(now)

    # -- frames and time ---------------------------------------------------------------------------------------------

    def receive(self, data: bytes, now: int) -> None:
        """One acyclic frame of this station's port."""
        if self.on_the_wire:
            self.device.receive(data, now)

    def pump(self, now: int) -> list[bytes]:
        """Finish what inputs began; the frames to send."""
        return self.device.pump(now) if self.on_the_wire else []

    @property
    def has_sockets(self) -> bool:
        """Whether its bus uses sockets."""
        return self._sockets is not None

    def services(self) -> Services | None:
        """The address and the ports that it has now, on a bus that uses sockets."""
        return None if self._sockets is None or not self.on_the_wire else self._sockets.services()

    def socket_event(self, event: SocketEvent, now: int) -> None:
        """Something of a stream, or a datagram."""
        if self._sockets is not None and self.on_the_wire:
            self._sockets.socket_event(event, now)

    def pump_sockets(self, now: int) -> list[SocketAction]:
        """What it sends over its streams and as datagrams."""
        return [] if self._sockets is None or not self.on_the_wire else self._sockets.pump_sockets(now)

    def next_deadline(self) -> int | None:
        """When :meth:`handle_timeout` is due."""
        if not self.powered:
            return None
        return self.device.next_deadline() if self._answers_ns is None else self._answers_ns

    def handle_timeout(self, now: int) -> None:
        """Handle what is due by now."""
        if not self.powered:
            return
        if self._answers_ns is not None:
            if now < self._answers_ns:
                return
            self._start(now)
            self.note(now, Booted(self.flaws.answer_ns))
        self.device.handle_timeout(now)

    def pump_drive(self, now: int) -> bool:
        """Carry out commands of the drives themselves; returns whether there were any. Called by its device."""
        if self._not_written is not None:
            told, self._not_written = self._not_written, None
            self.note(now, told)
        return sum(part.carry_out(now) for part in self.parts) > 0

    # -- memory and log ----------------------------------------------------------------------------------------------

    def note(self, now: int, event: Event, axis: str = "") -> None:
        """Something happened to this station, or to an axis of it."""
        self.visits.take(event, now)
        self._log.record(now, axis or self.configured_name, event)

    def keep(self, now: int, key: str, value: Any) -> bool:
        """Write one value of non-volatile memory through; None forgets it.  As :meth:`save`."""
        del now
        if value is None:
            self.kept.pop(key, None)
        else:
            self.kept[key] = value
        return self.save()

    def save(self) -> bool:
        """Write non-volatile memory as it is in :attr:`kept`; False where that failed: it is written when it can be."""
        try:
            self._memory.save(self.configured_name, self.kept)
        except EnvironmentError_ as exc:
            self._memory.hold(self.configured_name, self.kept)
            self._not_written = MemoryNotWritten(str(exc), refused=False)
            return False
        return True

    def replace_memory(self, values: dict[str, Any]) -> None:
        """Other contents of non-volatile memory, from the next power-on on.  Raises :class:`EnvironmentError_`."""
        self._memory.save(self.configured_name, values)
        self.kept = dict(values)

    @property
    def can_save(self) -> bool:
        """Whether non-volatile memory can be written now, as far as is known."""
        return self._memory.ready

    def try_save(self, values: dict[str, Any]) -> bool:
        """Replace :attr:`kept` by ``values`` if they can be written; False: nothing changed."""
        try:
            self._memory.save(self.configured_name, values)
        except EnvironmentError_ as exc:
            # it may have happened nevertheless: then it is undone
            self._memory.hold(self.configured_name, self.kept)
            self._not_written = MemoryNotWritten(str(exc), refused=True)
            return False
        self.kept = values
        return True
