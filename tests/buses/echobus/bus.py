"""The toy bus's house with another device: one that has an address and sockets of its own."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING

import toybus
from toybus.bus import ToyBus
from toybus.farm_file import ToyPart

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from pnfarm.buses.bus import DeviceServices
    from pnfarm.faults.kind import InjectionKind
    from pnfarm.station.device import Device
    from pnfarm.station.station import Station
    from pnfarm.terminal.command import Command


class EchoBus(ToyBus):
    name = "echobus"
    title = "EchoBus"
    link_kinds = frozenset({"memory", "macvlan", "veth"})
    farm_file = ToyPart()
    uses_sockets = True
    frame_families = ("echo",)

    def device(self, station: Station, services: DeviceServices) -> Device:
        from echobus.device import EchoDevice

        return EchoDevice(station, services)

    def fault_kinds(self) -> Iterable[InjectionKind]:
        return ()

    def commands(self) -> Iterable[Command]:
        return ()

    def add_routes(self, app: object, host: object) -> None:
        pass


ECHOBUS = EchoBus()


def make_model(folder: Path) -> Path:
    """A folder of models with ``echo-servo``, the toy servo on this bus."""
    models = folder / "models"
    shutil.copytree(next(iter(toybus.__path__)) + "/models/toy_servo", models / "echo_servo")
    file = models / "echo_servo" / "model.toml"
    text = file.read_text(encoding="utf-8")
    text = text.replace('"toy-servo"', '"echo-servo"').replace('bus = "toybus"', 'bus = "echobus"')
    file.write_text(text, encoding="utf-8")
    return models
