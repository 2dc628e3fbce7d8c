"""A farm's API with a drive and an island: a station without axes, whose data no bus carries."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from api_world import ApiWorld
from plain_station import island

from pnfarm.station.description import ModuleDescription, StationDescription, SubmoduleDescription
from pnfarm.station.visits import Visits
from pnfarm.trace.traced import TracedDevice

DESCRIPTION = StationDescription(
    title="Example island",
    identity={"vendor": "Example", "vendor_id": 0xFFFF, "device_id": 0x21, "order_number": "ISL-8"},
    access_point="DAP 2",
    modules=(
        ModuleDescription(1, 0x10, "8DI", (SubmoduleDescription(1, 1, "8DI", 1, 0),)),
        ModuleDescription(2, 0x20, "8DO", (SubmoduleDescription(1, 1, "8DO", 0, 1),)),
    ),
)


def island_station(signals: Any, name: str = "island-1") -> Any:
    """What views use of a station."""
    device = SimpleNamespace(
        name=name, view=lambda now: {"station_name": name, "ip": "10.77.1.41/24"}, connection=lambda: None, details=dict
    )
    return SimpleNamespace(
        configured_name=name, names=(name,), kinds=("ISL-8",), axes=(), bus="profinet", device=device,
        signals=signals, powered=True, index=0, image=SimpleNamespace(injected=0),
        visits=Visits(), description=DESCRIPTION, port=SimpleNamespace(index=9, mac=bytes(5) + b"\x09"),
    )  # fmt: skip


def add_island(farm: Any, name: str = "island-1", **more: Any) -> Any:
    """Put an island into a farm; the station."""
    found = island_station(island(**more), name)
    farm.stations.append(found)
    # its samples are zeros: its rows are not the farm's
    stations = farm.traces._stations
    stations.by_name[name] = stations._named[name] = TracedDevice(found)
    settle = farm.settle
    # no bus carries its data
    farm.settle = lambda station, now: None if station is found else settle(station, now)
    return found


class DeviceWorld(ApiWorld):
    """``device`` is the island, ``signals`` are its."""

    def __init__(self, *, name: str = "island-1", more: Any = None, **line: Any) -> None:
        super().__init__(1, controller=False, **line)
        self.device = add_island(self.line.farm, name, more=more)
        self.signals = self.device.signals
