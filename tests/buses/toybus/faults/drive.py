"""A drive on the toy bus as injections see it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.faults.effects.connection import CONNECTION, Connection, ConnectionPart
from pnfarm.faults.effects.parts import DrivePart, InjectedDrive, Part
from pnfarm.faults.effects.supply import Supply
from pnfarm.faults.effects.wire import WIRE, Wire
from pnfarm.faults.stations import injected_station

if TYPE_CHECKING:
    from pnfarm.buses.bus import InjectionHost
    from pnfarm.faults.effects.connection import Status
    from toybus.device.device import ToyDevice


class Mouth(DrivePart):
    """Whether the drive answers."""

    def __init__(self, device: ToyDevice) -> None:
        self._device = device

    def shut(self) -> None:
        self._device.muted += 1

    def open(self) -> None:
        self._device.muted -= 1

    def in_force(self) -> list[Any]:
        return ["muted"] * self._device.muted


MOUTH: Part[Mouth] = Part("reports")


class ToyConnection(ConnectionPart):
    def __init__(self, device: ToyDevice) -> None:
        self._device = device

    def now(self) -> Connection | None:
        if not self._device.connected:
            return None
        return Connection(frozenset({self._device.connects}), True, 10_000_000, 100_000_000, 0)

    def cycles(self) -> int:
        return self._device.closed.sent

    def abort(self, code: int, now: int) -> int:
        return self._device.lose(now)

    def expire(self, now: int) -> int:
        return self._device.lose(now)

    def sent_data(self, since: int) -> bool:
        return not self._device.muted

    def sent_status(self, status: Status, since: int) -> bool:
        return False


def injected_drives(device: ToyDevice, host: InjectionHost) -> list[InjectedDrive]:
    station = device.station
    name, port = station.configured_name, station.port.index
    host.gate.classify(port, lambda _: "toy")
    wire = Wire(name, station.index, port, host.impairments, host.gate, host.carriers, lambda _: None)
    supply = Supply(station, settle=host.settle, goes_off=wire.forget)
    parts: dict[Part[Any], DrivePart] = {WIRE: wire, CONNECTION: ToyConnection(device), MOUTH: Mouth(device)}
    return injected_station(station, parts, supply, lambda: device)
