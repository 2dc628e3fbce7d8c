"""One drive of a line in memory: its readings, and what a test does to it."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, Protocol

from pnfarm.farm.views.readings import DriveReadings, FaultReading

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.farm.core import FarmCore
    from pnfarm.station.axis import Axis
    from pnfarm.testing.fault import Fault

__all__ = ["Drive", "FaultReading", "Host"]


class Host(Protocol):
    """What drives need of their line."""

    @property
    def core(self) -> FarmCore: ...

    @property
    def now_ns(self) -> int: ...

    def inject(self, kind: str, on: str, **options: Any) -> Fault: ...

    def changed(self, station: Axis) -> None:
        """A test changed this drive: let it process the consequences."""


class Drive(DriveReadings):
    """A drive: every reading is the present one."""

    def __init__(self, host: Host, station: Axis) -> None:
        super().__init__(host.core, station, lambda: host.now_ns)
        self._host = host

    @property
    def fault(self) -> FaultReading | None:
        """The active one; None without."""
        return self.active_fault

    def parameter(self, name: str | int) -> int:
        """A parameter by number or by the manual's name, ``NAME.SUB`` for an element: the number as on the wire.

        Raises the drive's own error (:class:`pnfarm.drives.parameters.parameter.ParameterError`), which says what is
        wrong.
        """
        return self._get_parameter(name)

    def set_parameter(self, name: str | int, value: int) -> None:
        """Write a parameter; raises the drive's own error, which says what is allowed."""
        self._set_parameter(name, value)
        self._host.changed(self._station)

    def inject(self, kind: str, **options: Any) -> Fault:
        """Inject a fault: as :meth:`pnfarm.testing.Line.inject`, on this drive."""
        return self._host.inject(kind, self.name, **options)

    def power_off(self) -> None:
        """Switch its supply off: it leaves the network at once."""
        self._do(partial(self._station.station.switch, on=False))

    def power_on(self) -> None:
        """Switch its supply on: it boots."""
        self._do(partial(self._station.station.switch, on=True))

    def power_cycle(self) -> None:
        """Off and on."""
        self._do(self._station.station.power_cycle)

    def _do(self, action: Callable[[int], object]) -> None:
        action(self._host.now_ns)
        self._host.changed(self._station)
