"""What the toy bus offers to the house (:class:`pnfarm.buses.bus.Bus`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.bus import Bus
from pnfarm.terminal.command import Command, Panel
from toybus.command import toy_order
from toybus.farm_file import ToyPart

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from fastapi import FastAPI

    from pnfarm.buses.bus import RouteHost
    from pnfarm.drives.description.model import Model
    from pnfarm.faults.kind import KindOnBus


class ToyBus(Bus):
    folder = "toybus"
    prefix = "Toy"
    name = "toybus"
    title = "ToyBus"
    link_kinds = frozenset({"memory"})
    farm_file = ToyPart()
    connection_states = ("TALKING",)
    usual_losses = ("silence",)
    frame_families = ("toy",)

    def channel_rows(self, model: Model) -> int:
        return 0

    def kinds_here(self) -> Mapping[str, KindOnBus]:
        return {}

    def commands(self) -> Iterable[Command]:
        return [Command("toy-order", Panel.CONTROLLER, toy_order, behind="plc")]

    def add_routes(self, app: FastAPI, host: RouteHost) -> None:
        @app.get("/api/v1/drives/{name}/orders")
        def orders(name: str) -> dict[str, int]:
            return {"orders": int(host.station(name).device.closed.received)}


TOYBUS = ToyBus()
