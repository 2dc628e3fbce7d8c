"""A station and its axes as injections see them.

A station with one axis, or with none, is one drive with all parts.  Of a station with several, the node has the parts
of the node, and each axis has a servo of its own and finds the other parts at the node.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.faults.effects.parts import DrivePart, InjectedDrive, Part
from pnfarm.faults.effects.servo import SERVO, Servo
from pnfarm.faults.effects.supply import SUPPLY, Supply
from pnfarm.faults.signals import SIGNALS, Signals

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.station.axis import Axis
    from pnfarm.station.station import Station

__all__ = ["injected_station"]

Parts = dict[Part[Any], DrivePart]


def injected_station(
    station: Station,
    parts: Mapping[Part[Any], DrivePart],
    supply: Supply,
    machines: Callable[[], object],
    *,
    bus_name: Callable[[], str] | None = None,
    of_axis: Callable[[Axis], Parts] = lambda _: {},
) -> list[InjectedDrive]:
    """The node, then its axes where they have names of their own; arguments as of :class:`InjectedDrive`.

    ``bus_name`` is the station's present name on its bus, if that may change; ``of_axis``: further parts of an axis.
    """
    name = station.configured_name

    def names() -> tuple[str, ...]:
        return (name,) if bus_name is None else (name, bus_name())

    own = [(axis, {SERVO: Servo(axis), **of_axis(axis)}) for axis in station.axes]
    named = any(axis.configured_name != name for axis in station.axes)
    alone: Parts = own[0][1] if own and not named else {}
    if station.signals is not None:
        alone[SIGNALS] = Signals(station.signals)
    node = InjectedDrive(name, names, station.kinds, {**alone, SUPPLY: supply, **parts}, machines, station.bus)
    drives = [node]
    if named:
        for axis, axis_parts in own:
            drives.append(node.with_axis(axis.configured_name, axis_parts))
    for drive in drives:
        supply.returned.append(drive.refresh)
    return drives
