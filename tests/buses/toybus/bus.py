"""What the toy bus offers to the house (:class:`pnfarm.buses.bus.Bus`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.terminal.command import Command, Panel
from toybus.command import toy_order
from toybus.farm_file import ToyPart

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from fastapi import FastAPI

    from pnfarm.buses.bus import DeviceServices, InjectionHost, RouteHost
    from pnfarm.captures.packet import Capture
    from pnfarm.drives.description.model import Model
    from pnfarm.faults.effects.parts import InjectedDrive
    from pnfarm.faults.kind import InjectionKind
    from pnfarm.station.station import Station
    from toybus.decode import ToyDecoder
    from toybus.device import ToyDevice, ToySegment


class ToyBus:
    name = "toybus"
    title = "ToyBus"
    link_kinds = frozenset({"memory"})
    farm_file = ToyPart()
    connection_states = ("TALKING",)
    usual_losses = ("silence",)
    frame_families = ("toy",)

    def channel_rows(self, model: Model) -> int:
        return 0

    def device(self, station: Station, services: DeviceServices) -> ToyDevice:
        from toybus.device import ToyDevice

        return ToyDevice(station)

    def segment(self, devices: Sequence[ToyDevice]) -> ToySegment:
        from toybus.device import ToySegment

        return ToySegment()

    def fault_kinds(self) -> Iterable[InjectionKind]:
        from pnfarm.faults.catalogue import kinds_in
        from toybus import kinds

        return kinds_in(kinds)

    def injected_drive(self, device: ToyDevice, host: InjectionHost) -> InjectedDrive:
        from toybus.faults import injected_drive

        return injected_drive(device, host)

    def commands(self) -> Iterable[Command]:
        return [Command("toy-order", Panel.CONTROLLER, toy_order, behind="plc")]

    def add_routes(self, app: FastAPI, host: RouteHost) -> None:
        @app.get("/api/v1/drives/{name}/orders")
        def orders(name: str) -> dict[str, int]:
            return {"orders": int(host.station(name).device.closed.received)}

    def decoder(self, capture: Capture) -> ToyDecoder:
        from toybus.decode import ToyDecoder

        return ToyDecoder()


TOYBUS = ToyBus()
