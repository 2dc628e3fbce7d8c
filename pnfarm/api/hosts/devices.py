"""The stations of one farm, and the signals of its devices."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.farm.views.stations import device_snapshot, signals_snapshot, station_snapshot
from pnfarm.web.errors import named_by_path

if TYPE_CHECKING:
    from pnfarm.api.context import ApiContext
    from pnfarm.station.event import Event
    from pnfarm.station.plain_signals import PlainSignals
    from pnfarm.station.station import Station

__all__ = ["FarmDevices"]


class FarmDevices:
    """As :class:`~pnfarm.api.paths.devices.StationsHost` and :class:`~pnfarm.api.paths.devices.DeviceHost`."""

    def __init__(self, context: ApiContext) -> None:
        self._context = context

    async def stations(self) -> dict[str, Any]:
        return {"stations": [self._listed(station) for station in self._context.core.stations]}

    async def devices(self) -> dict[str, Any]:
        return {"devices": [self._listed(station) for station in self._context.core.stations if not station.axes]}

    def _listed(self, station: Station) -> dict[str, Any]:
        return station_snapshot(station, self._context.now())

    def device(self, name: str) -> dict[str, Any]:
        return device_snapshot(self._context.device(name), self._context.now())

    def signals(self, name: str) -> dict[str, Any]:
        station, signals = self._with_signals(name)
        return {
            "device": station.configured_name,
            "revision": signals.revision,
            "signals": signals_snapshot(signals),
        }

    def tag(self, name: str) -> str:
        return f'"{self._context.instance}-{self._with_signals(name)[1].revision}"'

    def write(self, name: str, values: dict[str, Any], event: Event, *, force: bool) -> dict[str, Any]:
        station, signals = self._with_signals(name)
        overruled = (signals.force if force else signals.set)(values)
        self._context.record(event, station.configured_name)
        self._context.changed(station)
        return {**self.signals(name), "overruled": dict(overruled)}

    def _with_signals(self, name: str) -> tuple[Station, PlainSignals]:
        with named_by_path():
            return self._context.core.with_signals(name)
