"""One device of a farm in this process, for asynchronous code."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.farm.wait import NotInTime, require_in_time
from pnfarm.library.arguments import duration_ns
from pnfarm.library.device_readings import DeviceReadings

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.library.runner import FarmRunner
    from pnfarm.station.station import Station
    from pnfarm.wire.value_types import Value

__all__ = ["Device"]


class Device(DeviceReadings):
    """A device: every reading is the present one."""

    def __init__(self, passing: FarmRunner, station: Station) -> None:
        super().__init__(passing.core, station, passing.now, self._changed)
        self._passing = passing

    async def refresh(self) -> Device:
        """Does nothing: readings of a farm in this process are the present ones; as :meth:`RemoteDevice.refresh`."""
        return self

    async def write(self, values: Mapping[str, Value]) -> dict[str, str]:
        """Write inputs of the controller, all in force at once, or none; returns those that a fault or force has."""
        return self.signals.set(values)

    async def force(self, values: Mapping[str, Value]) -> dict[str, str]:
        """Values over what is written, until :meth:`release`; returns those that a fault has."""
        return self.signals.force(values)

    async def release(self, *names: str) -> None:
        """End the force of these inputs, or of all: what was written meanwhile is in force."""
        self.signals.release(*names)

    async def wait_for(self, name: str, value: Value | Callable[[Value], object], within: float | str) -> float:
        """Until a signal has a value, or one that a function accepts; how long it took, s.  Looks each millisecond.

        ``within``: seconds, or a duration as ``"500ms"``.  Raises :class:`ConfigError` for a name or a value that there
        cannot be, :class:`NotInTime`.
        """
        within_ns, holds = duration_ns(within, "within"), self.holds(name, value)
        began = self._passing.now()
        if not await self._passing.wait(holds, within_ns):
            raise NotInTime(f"{name} did not become {value!r} within {within_ns / 1e9:g} s: {self.in_words(name)}")
        return require_in_time(name, self._passing.now() - began, within_ns)

    def _changed(self) -> None:
        self._passing.core.settle(self._station, self._passing.now())
        self._passing.poke()
