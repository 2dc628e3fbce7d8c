"""The stations of one farm, and the signals of its devices."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.farm.views.snapshot import injected_kinds
from pnfarm.farm.views.stations import device_row, device_snapshot, signals_snapshot, station_snapshot
from pnfarm.web.errors import named_by_path

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.api.context import ApiContext
    from pnfarm.signals.owner import SignalOwner
    from pnfarm.station.event import Event
    from pnfarm.station.plain_signals import NamedSignals
    from pnfarm.station.station import Station

__all__ = ["FarmDevices"]


class FarmDevices:
    """As :class:`~pnfarm.api.paths.devices.StationsHost` and :class:`~pnfarm.api.paths.devices.DeviceHost`."""

    def __init__(self, context: ApiContext) -> None:
        self._context = context

    async def stations(self) -> dict[str, Any]:
        now = self._context.now()
        return {"stations": [station_snapshot(station, now) for station in self._context.core.stations]}

    async def devices(self) -> dict[str, Any]:
        now, injected = self._context.now(), injected_kinds(self._context.core.injections)
        devices = [station for station in self._context.core.stations if not station.axes]
        return {"devices": [{**device_row(one, now), "injected": _faults(one, injected)} for one in devices]}

    def device(self, name: str) -> dict[str, Any]:
        station, injected = self._context.device(name), injected_kinds(self._context.core.injections)
        return {**device_snapshot(station, self._context.now()), "injected": _faults(station, injected)}

    def signals(self, name: str) -> dict[str, Any]:
        station, signals = self._with_signals(name)
        return {
            "device": station.configured_name,
            "revision": signals.revision,
            "signals": signals_snapshot(signals),
        }

    def tag(self, name: str) -> str:
        return self._context.tag(self._with_signals(name)[1].revision)

    def write(self, name: str, values: dict[str, Any], event: Event, *, force: bool) -> dict[str, Any]:
        station, signals = self._with_signals(name)
        overruled = (signals.force if force else signals.set)(values)
        self._context.record(event, station.configured_name)
        self._context.core.settle_owner(station, self._context.now())
        self._context.poke()
        return {**self.signals(name), "overruled": dict(overruled)}

    def _with_signals(self, name: str) -> tuple[SignalOwner, NamedSignals]:
        with named_by_path():
            return self._context.core.with_signals(name)


def _faults(station: Station, injected: Mapping[str, list[tuple[str, str]]]) -> list[dict[str, str]]:
    return [{"id": fault, "kind": kind} for fault, kind in injected.get(station.configured_name, ())]
