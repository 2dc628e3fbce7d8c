"""One drive of a farm in this process, for asynchronous code."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from pnfarm.errors import ConfigError
from pnfarm.farm.views.readings import DriveReadings
from pnfarm.farm.wait import NotInTime, require_in_time
from pnfarm.library.arguments import duration_ns
from pnfarm.scenario.run import LOOK_NS
from pnfarm.scenario.watch import Watch, as_text
from pnfarm.signals.conditions import bind
from pnfarm.vocabulary.conditions import ConditionError

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.library.fault import FaultHandle
    from pnfarm.library.runner import FarmRunner
    from pnfarm.station.axis import Axis
    from pnfarm.station.event_log import LogEntry

__all__ = ["Drive"]

#: So long a change of the supply waits for a firmware that makes no step.
STEPPED_NS = 1_000_000_000


class Drive(DriveReadings):
    """A drive: every reading is the present one.  ``inject`` is :meth:`pnfarm.Farm.fault`."""

    def __init__(self, inject: Callable[..., FaultHandle], passing: FarmRunner, station: Axis) -> None:
        super().__init__(passing.core, station, passing.now)
        self._inject = inject
        self._passing = passing

    def fault(self, kind: str, **options: Any) -> FaultHandle:
        """Inject a fault, as :meth:`pnfarm.Farm.fault`; ``await`` the result or use it with ``async with``."""
        return self._inject(kind, self.name, **options)

    async def wait_for(self, condition: str, within: float | str) -> float:
        """Until a condition holds, as scenarios write it: ``"state == S4 and velocity > 1000"``; how long it took, s.

        From this call on, a state, fault or connection that lasts a moment counts.
        ``within``: seconds, or a duration as ``"500ms"``.
        Raises :class:`ConfigError` for a condition that this drive cannot have, :class:`NotInTime`.
        """
        try:
            bound = bind(condition, self._station.model, self._passing.core.signals())
        except ConditionError as exc:
            raise ConfigError(f"{condition!r}: {exc}") from exc
        within_ns = duration_ns(within, "within")
        passing = self._passing
        watch = Watch({self.name: bound}, {self.name: self._station}, passing.core.signal_owners)
        # before the clock is read, which may let time pass: what happens from this call on counts
        # a connection is of all axes of its station
        own = {self.name, self._station.station.configured_name}

        def note(entry: LogEntry) -> None:
            if entry.drive in own:
                watch.note(self.name, entry)

        unsubscribe = passing.log.subscribe(note)

        def holds() -> bool:
            watch.look(passing.now())
            return watch.all_held

        try:
            began = passing.now()
            held = await passing.wait(holds, within_ns, polled=watch.polled(virtual=passing.in_virtual_time))
        finally:
            unsubscribe()
        if not held:
            values = as_text(watch.shown()[self.name])
            raise NotInTime(f"{condition} did not hold within {within_ns / 1e9:g} s: {values}; {self!r}")
        return require_in_time(condition, max(0, watch.held_ns[self.name] - began), within_ns, LOOK_NS)

    async def refresh(self) -> Drive:
        """Does nothing: readings of a farm in this process are the present ones; as :meth:`RemoteDrive.refresh`."""
        return self

    async def parameter(self, name: str | int) -> int:
        """A parameter by number or by the manual's name, ``NAME.SUB`` for an element: the number as on the wire.

        Raises the drive's own error (:class:`pnfarm.drives.parameters.parameter.ParameterError`), which says what is
        wrong.
        """
        return self._get_parameter(name)

    async def set_parameter(self, name: str | int, value: int) -> None:
        """Write a parameter; raises the drive's own error, which says what is allowed."""
        self._set_parameter(name, value)
        self._changed()

    async def power_off(self) -> None:
        """Switch its supply off: it leaves the network at once."""
        await self._power(partial(self._station.station.switch, on=False))

    async def power_on(self) -> None:
        """Switch its supply on: it boots."""
        await self._power(partial(self._station.station.switch, on=True))

    async def power_cycle(self) -> None:
        """Off and on."""
        await self._power(self._station.station.power_cycle)

    async def _power(self, action: Callable[[int], object]) -> None:
        action(self._passing.now())
        self._changed()
        # readings are of before until the firmware has made a step: one may have begun, the next one sees the supply
        for _ in range(2):
            await self._stepped()

    async def _stepped(self) -> None:
        axis = self._station.handle.axis
        before_ns = int(axis.last_ns)
        await self._passing.wait(lambda: int(axis.last_ns) != before_ns, STEPPED_NS)

    def _changed(self) -> None:
        core, now = self._passing.core, self._passing.now()
        core.settle(self._station.station, now)
        core.injections.touch(self.name)
        self._passing.poke()
