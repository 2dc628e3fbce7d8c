"""One device of a line in memory."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from pnfarm.farm.wait import NotInTime
from pnfarm.library.device_readings import DeviceReadings

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.farm.core import FarmCore
    from pnfarm.station.station import Station
    from pnfarm.wire.value_types import Value

__all__ = ["Device"]


class Host(Protocol):
    """What devices need of their line."""

    @property
    def core(self) -> FarmCore: ...

    @property
    def now_ns(self) -> int: ...

    def wait_until(self, condition: Callable[[], object], within: float, *, what: str) -> float: ...


class Device(DeviceReadings):
    """A device: every reading is the present one."""

    def __init__(self, host: Host, station: Station) -> None:
        super().__init__(host.core, station, lambda: host.now_ns, lambda: host.core.settle(station, host.now_ns))
        self._host = host

    def force(self, values: Mapping[str, Value]) -> dict[str, str]:
        """Values over what is written, until :meth:`release`; returns those that a fault has."""
        return self.signals.force(values)

    def release(self, *names: str) -> None:
        """End the force of these inputs, or of all: what was written meanwhile is in force."""
        self.signals.release(*names)

    def wait_for(self, name: str, value: Value | Callable[[Value], object], within: float) -> float:
        """Until a signal has a value, or one that a function accepts; how long it took, s.

        Raises :class:`ConfigError` for a name or a value that there cannot be, :class:`NotInTime`.
        """
        holds = self.holds(name, value)
        try:
            return self._host.wait_until(holds, within, what=f"{name} = {value!r}")
        except NotInTime as exc:
            raise NotInTime(f"{name} did not become {value!r} within {within:g} s: {self.in_words(name)}") from exc
