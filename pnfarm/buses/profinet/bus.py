"""PROFINET as a bus of the package (:class:`pnfarm.buses.bus.Bus`)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

from pnfarm.buses.checking import CheckingBus
from pnfarm.buses.imports import ImportingBus, ProjectBus
from pnfarm.buses.search import SearchBus

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from fastapi import FastAPI

    from pnfarm.buses.bus import DeviceServices, RouteHost
    from pnfarm.buses.described import DescribedIdentity
    from pnfarm.buses.devices import DeviceRows
    from pnfarm.buses.profinet.config.device import ProfinetDeviceConfig
    from pnfarm.buses.profinet.device.device import ProfinetDevice
    from pnfarm.drives.description.model import Model
    from pnfarm.station.station import Station
    from pnfarm.terminal.command import Command

__all__ = ["PROFINET", "Profinet"]


class Profinet(ImportingBus, ProjectBus, SearchBus, CheckingBus):
    """See the module's docstring."""

    name = "profinet"
    project_kind = "caex"
    title = "PROFINET"
    link_kinds = frozenset({"macvlan", "veth", "tap", "memory"})
    frame_families = ("cyclic", "dcp", "rpc", "alarm", "lldp", "ptcp", "snmp")
    description_key = "gsdml"
    has_names = True

    def described_identity(
        self, path: Path, model: Model, own: Mapping[str, Any], access_point: str | int | None
    ) -> DescribedIdentity:
        from pnfarm.buses.profinet.gsdml_file import load_gsdml
        from pnfarm.buses.profinet.maker_identity import identity_of

        return identity_of(load_gsdml(path), model, own.get("dap") if access_point is None else access_point)

    def channel_rows(self, model: Model) -> int:
        from pnfarm.buses.profinet.device.channels import channel_rows

        return channel_rows(model.limits.io_controllers)

    def device(self, station: Station, services: DeviceServices) -> ProfinetDevice:
        from pnfarm.buses.profinet.device.device import ProfinetDevice
        from pnfarm.buses.profinet.device.drive import DriveKind

        kind = DriveKind(station)
        return ProfinetDevice(station, services, kind, kind.model.limits.io_controllers)

    def device_rows(self, config: ProfinetDeviceConfig) -> DeviceRows:
        from pnfarm.buses.devices import DeviceRows
        from pnfarm.buses.profinet.device.channels import channel_rows

        described = config.described
        controllers = described.plugged.number_of_ars
        # a change of modules leaves the pieces of before to the engine until its next tick
        pieces = 4 * channel_rows(controllers) * (len(described.inputs.places) + len(described.outputs.places))
        return DeviceRows(channel_rows(controllers, described.plugged.relations.crs), pieces)

    def described_device(self, station: Station, services: DeviceServices) -> ProfinetDevice:
        from pnfarm.buses.profinet.described.kind import DescribedKind
        from pnfarm.buses.profinet.device.device import ProfinetDevice

        kind = DescribedKind(
            station, cast("ProfinetDeviceConfig", station.config), services.channels.columns, services.plain_row
        )
        station.signals = kind.signals
        station.description = kind.described.description
        plugged = kind.described.plugged
        return ProfinetDevice(station, services, kind, plugged.number_of_ars, plugged.relations.crs)

    def commands(self) -> Iterable[Command]:
        from pnfarm.buses.profinet.commands import gsdml, module, record
        from pnfarm.terminal.command import Command, Panel

        return (
            Command("module", Panel.RUNNING, module.app, behind="param"),
            Command("record", Panel.CONTROLLER, record.app, behind="plc"),
            Command("gsdml", Panel.REFERENCE, gsdml.gsdml, behind="models"),
        )

    def add_routes(self, app: FastAPI, host: RouteHost) -> None:
        from pnfarm.buses.profinet.api.modules import add_modules

        add_modules(app, host)


PROFINET = Profinet()
