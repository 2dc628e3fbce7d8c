"""One virtual drive, whatever its bus: its parameters, its supply, its memory, and what happens to it.

A station is bytes and ``now`` in, frames out, like the machines of its bus's device; the farm's runtime carries the
frames.  It does itself what lies between the drive and the bus:

* non-volatile memory is read at power-on, and what a drive saves is written through;
* a drive with a boot time neither receives nor sends until it has booted;
* commands of the drive itself (save, reboot, another telegram, the lamp) are carried out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from pnfarm.drives.parameters.given_values import raw_number
from pnfarm.drives.parameters.store import (
    DisplayBlinkRequested,
    FaultHistoryCleared,
    NonVolatileSaved,
    ParameterStore,
    RebootRequested,
    TelegramChanged,
)
from pnfarm.errors import ConfigError, EnvironmentError_
from pnfarm.station.device import KeptValueError, SocketDevice
from pnfarm.station.events import (
    Booted,
    MemoryNotTaken,
    MemoryNotWritten,
    ParametersSaved,
    PowerLost,
    PowerReturned,
)
from pnfarm.station.events import TelegramChanged as TelegramTaken
from pnfarm.station.fault_memory import active_of, history_of, restore_history
from pnfarm.table.access.record_fields import field_views
from pnfarm.table.axis_codes import CMD_HOLD_FAULT, CMD_POWER_ON, CMD_RAISE_FAULT, CMD_RELEASE_FAULT
from pnfarm.table.image import LOST_NEVER

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.drives.axis_handle import AxisHandle
    from pnfarm.drives.description.model import Model
    from pnfarm.drives.motion_tasks import MotionTask
    from pnfarm.drives.parameters.memory import NonVolatile
    from pnfarm.station.device import Device
    from pnfarm.station.event import Event
    from pnfarm.station.event_log import EventLog
    from pnfarm.station.imperfections import Imperfections
    from pnfarm.wire.endpoint import Services, SocketAction, SocketEvent

__all__ = ["Station", "StationConfig", "StationPort"]


class StationPort(Protocol):
    """Where the drive is on the wire: the link's number for it, and its address."""

    @property
    def index(self) -> int: ...
    @property
    def mac(self) -> bytes: ...


class StationConfig(Protocol):
    """Settings of the farm file that any drive has; the bus's device reads further ones."""

    @property
    def name(self) -> str: ...
    @property
    def params(self) -> Mapping[str, int | float | str | bool]: ...
    @property
    def motion_tasks(self) -> tuple[MotionTask, ...]: ...


class Station:
    """See the module's docstring.  ``index`` is the row of axis and image; ``make_device`` gives its bus's device."""

    def __init__(
        self,
        config: StationConfig,
        model: Model,
        index: int,
        port: StationPort,
        handle: AxisHandle,
        make_device: Callable[[Station], Device],
        *,
        memory: NonVolatile,
        log: EventLog,
        flaws: Imperfections,
    ) -> None:
        self.config = config
        self.configured_name = config.name
        self.model = model
        self.index = index
        self.port = port
        self.handle = handle
        #: Its imperfections, and its latency for parameter requests.
        self.flaws = flaws
        self.latency = flaws.latency()
        (self._powered,) = field_views(handle.axis, "powered")
        self.fault_counts: dict[int, int] = {}
        #: When the drive last ignored a request to acknowledge, because of an injection, ns; 0: never.
        self.refused_ns = 0
        #: When its lamp was last made to flash.
        self.signalled_ns: int | None = None
        #: Contents of non-volatile memory; :meth:`save` writes them.
        self.kept: dict[str, Any] = {}
        self.store: ParameterStore
        self._memory = memory
        self._log = log
        self._left_out: list[str] = []
        #: A save that failed and is not told yet.
        self._not_written: MemoryNotWritten | None = None
        self._booted_ns: int | None = None
        #: When a drive that boots comes on the wire.
        self._answers_ns: int | None = None
        #: How often it came on the wire.
        self.starts = 0
        self.device = make_device(self)
        # found out once: it is asked for each frame
        self._sockets = self.device if isinstance(self.device, SocketDevice) else None
        self._build()
        restore_history(handle.axis, self.kept.get("faults", ()))

    # -- life --------------------------------------------------------------------------------------------------------

    def _build(self) -> None:
        """Create store and machines as after power-on, with the contents of non-volatile memory."""
        kept = self._memory.load(self.configured_name) or {}
        try:
            self.device.check(kept)
        except KeptValueError as exc:
            raise self._memory.damaged(f"of drive {self.configured_name}, {exc}") from exc
        self.kept = dict(kept)
        self.store = ParameterStore(self.model, self.handle, self._save_drive)
        self._left_out = self.store.restore(kept.get("drive"))
        self.device.commission(kept)
        self.store.commission({key: self._raw(key, value) for key, value in self.config.params.items()})
        self.store.commission_tasks(self.config.motion_tasks)
        self.store.power_on()
        self.device.build(self.kept)

    def _raw(self, key: str, value: float | str | bool) -> int:
        """A parameter of the farm file as the raw number that the drive accepts."""
        raw = raw_number(self.model.resolve(key)[0], value)
        if raw is None:
            raise ConfigError(f"{self.configured_name}: {key} cannot be {value!r}")
        return raw

    @property
    def powered(self) -> bool:
        """Whether the control supply is on."""
        return bool(self._powered[0])

    @property
    def on_the_wire(self) -> bool:
        """Whether it receives and sends: powered, and booted."""
        return self.powered and self._answers_ns is None

    @property
    def booted_ns(self) -> int:
        """When it was powered on last."""
        return int(self.handle.axis.boot_ns) if self._booted_ns is None else self._booted_ns

    def boot(self, now: int) -> None:
        """The drive was powered on: it comes on the wire at once, or when it has booted."""
        if self.flaws.answer_ns:
            self._answers_ns = now + self.flaws.answer_ns
        else:
            self._start(now)

    def _start(self, now: int) -> None:
        """The drive came on the wire."""
        self._answers_ns = None
        self.starts += 1
        left_out = [*self._left_out, *self.device.start(now)]
        if left_out:
            self.note(now, MemoryNotTaken(len(left_out), left_out[0]))

    def power_off(self, now: int) -> None:
        """Cut the supply: connections end, nothing is answered."""
        self.device.stop(now)
        self.handle.axis.powered = 0
        self._answers_ns = None
        self.note(now, PowerLost())

    def power_on(self, now: int) -> None:
        """Boot with the contents of non-volatile memory."""
        self._booted_ns = now
        self._build()
        # set points written by parameters are gone, too, and so is the reason why a controller's ended
        self.handle.image.received[:] = 0
        self.handle.image.lost = LOST_NEVER
        self.handle.axis.powered = 1
        self.handle.push_command(CMD_POWER_ON)
        self.note(now, PowerReturned())
        self.boot(now)

    def power_cycle(self, now: int) -> None:
        """Off and on again."""
        self.power_off(now)
        self.power_on(now)

    # -- frames and time ---------------------------------------------------------------------------------------------

    def receive(self, data: bytes, now: int) -> None:
        """One acyclic frame of this drive's port."""
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
        """Carry out commands of the drive itself; returns whether there were any. Called by its device."""
        if self._not_written is not None:
            told, self._not_written = self._not_written, None
            self.note(now, told)
        ordered = self.store.events()
        for event in ordered:
            match event:
                case NonVolatileSaved(written):
                    if written or self.keep(now, "drive", self.store.snapshot()):
                        self.note(now, ParametersSaved())
                case TelegramChanged(number):
                    self.device.telegram_changed()
                    self.note(now, TelegramTaken(number))
                case RebootRequested():
                    self.power_cycle(now)
                case DisplayBlinkRequested():
                    self.signalled_ns = now
                case FaultHistoryCleared():
                    self.keep(now, "faults", active_of(self.handle.axis) or None)
                case _:
                    pass
        return bool(ordered)

    # -- faults ------------------------------------------------------------------------------------------------------

    def fault_raised(self, number: int, now: int) -> None:
        """The drive raised a fault: count it, store it, report it on the bus."""
        self.fault_counts[number] = self.fault_counts.get(number, 0) + 1
        self.device.fault_raised(number)
        self._keep_faults(now)

    def faults_cleared(self, now: int) -> None:
        """Every fault was acknowledged."""
        self.device.faults_cleared()
        self._keep_faults(now)

    def raise_fault(self, wanted: str | int, *, hold: bool) -> int:
        """Raise a fault of the model by number, name or cause; with ``hold`` its cause stays.  Its number."""
        fault = self.model.fault(wanted)
        self.handle.push_command(CMD_HOLD_FAULT if hold else CMD_RAISE_FAULT, fault.code)
        return fault.number

    def release_fault(self, number: int) -> None:
        """The cause of a held fault is gone; it can be acknowledged."""
        self.handle.push_command(CMD_RELEASE_FAULT, number)

    # -- memory and log ----------------------------------------------------------------------------------------------

    def note(self, now: int, event: Event) -> None:
        """Something happened to this drive."""
        self._log.record(now, self.configured_name, event)

    def _keep_faults(self, now: int) -> None:
        """The fault history changed: write it through."""
        self.keep(now, "faults", history_of(self.handle.axis) or None)

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

    def _save_drive(self, snapshot: dict[str, Any]) -> bool:
        """The drive was told to save its values."""
        return self.try_save({**self.kept, "drive": snapshot})
