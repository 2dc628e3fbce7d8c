"""PROFINET as a bus of the package (:class:`pnfarm.buses.bus.Bus`)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from fastapi import FastAPI

    from pnfarm.buses.bus import DeviceServices, InjectionHost, RouteHost
    from pnfarm.buses.caex import CaexElement
    from pnfarm.buses.controller import ControllerHost
    from pnfarm.buses.described import DescribedIdentity
    from pnfarm.buses.imports import FoundDrive, FoundStation
    from pnfarm.buses.profinet.config.controller import ProfinetController
    from pnfarm.buses.profinet.config.drive import ProfinetDriveConfig
    from pnfarm.buses.profinet.config.part import ProfinetPart
    from pnfarm.buses.profinet.controller.core import ControllerCore
    from pnfarm.buses.profinet.controller.device_plan import ProfinetPlan
    from pnfarm.buses.profinet.decode.decoder import ProfinetDecoder
    from pnfarm.buses.profinet.device.device import ProfinetDevice
    from pnfarm.buses.profinet.device.drive import DriveSettings
    from pnfarm.buses.profinet.device.segment import ProfinetSegment
    from pnfarm.buses.search import Question, SearchAnswer
    from pnfarm.captures.decoder import FrameDecoder
    from pnfarm.captures.packet import Capture
    from pnfarm.drives.description.model import Model
    from pnfarm.faults.effects.parts import InjectedDrive
    from pnfarm.faults.kind import InjectionKind, KindOnBus
    from pnfarm.station.station import Station
    from pnfarm.terminal.command import Command

__all__ = ["PROFINET", "Profinet"]


class Profinet:
    """See the module's docstring."""

    name = "profinet"
    title = "PROFINET"
    link_kinds = frozenset({"macvlan", "veth", "tap", "memory"})

    @property
    def farm_file(self) -> ProfinetPart:
        from pnfarm.buses.profinet.config.part import PROFINET_PART

        return PROFINET_PART

    def observe(self, decoder: FrameDecoder) -> None:
        from pnfarm.buses.profinet.decode.decoder import ProfinetDecoder
        from pnfarm.buses.profinet.decode.observed import Observed

        if isinstance(decoder, ProfinetDecoder):
            decoder.shared.observed = Observed()

    def found(self, decoder: FrameDecoder) -> Iterable[FoundDrive | FoundStation]:
        from pnfarm.buses.profinet.decode.decoder import ProfinetDecoder
        from pnfarm.buses.profinet.found import found

        observed = decoder.shared.observed if isinstance(decoder, ProfinetDecoder) else None
        return () if observed is None else found(observed)

    def of_project(self, root: CaexElement, folders: Sequence[Path], base: Path) -> Iterable[FoundDrive | FoundStation]:
        from pnfarm.buses.profinet.project import of_project

        return of_project(root, folders, base)

    @property
    def description_key(self) -> str:
        return "gsdml"

    def described_identity(self, path: Path, model: Model, own: Mapping[str, Any]) -> DescribedIdentity:
        from pnfarm.buses.profinet.gsdml_file import load_gsdml
        from pnfarm.buses.profinet.maker_identity import identity_of

        dap = own.get("dap")
        return identity_of(load_gsdml(path), model, dap if isinstance(dap, int) else None)

    @property
    def connection_states(self) -> Sequence[str]:
        from pnfarm.buses.profinet.device.view import CONNECTION_STATES

        return CONNECTION_STATES

    @property
    def usual_losses(self) -> Sequence[str]:
        from pnfarm.buses.profinet.device.view import USUAL_LOSSES

        return USUAL_LOSSES

    def channel_rows(self, model: Model) -> int:
        from pnfarm.buses.profinet.device.channels import channel_rows

        return channel_rows(model.limits.io_controllers)

    def device(self, station: Station, services: DeviceServices) -> ProfinetDevice:
        from pnfarm.buses.profinet.device.device import ProfinetDevice
        from pnfarm.buses.profinet.device.drive import DriveKind

        kind = DriveKind(station, cast("DriveSettings", station.config))
        return ProfinetDevice(station, services, kind, kind.model.limits.io_controllers)

    def segment(self, devices: Sequence[ProfinetDevice]) -> ProfinetSegment:
        from pnfarm.buses.profinet.device.segment import ProfinetSegment

        return ProfinetSegment(devices)

    def plan(
        self,
        section: ProfinetController,
        drives: Sequence[ProfinetDriveConfig],
        models: Sequence[Model],
        folder: Path | None,
    ) -> ProfinetPlan:
        from pnfarm.buses.profinet.controller.plan import plan_controller

        return plan_controller(section, drives, models, folder)

    def controller(self, plan: ProfinetPlan, host: ControllerHost) -> ControllerCore:
        from pnfarm.buses.profinet.controller.core import ControllerCore

        return ControllerCore(
            plan.name, plan.devices, host.link, host.port, ip=plan.ip, log=host.log, seed=host.seed, lldp=host.lldp
        )

    def fault_kinds(self) -> Iterable[InjectionKind]:
        from pnfarm.buses.profinet.faults import kinds
        from pnfarm.faults.catalogue import kinds_in

        return kinds_in(kinds)

    def kinds_here(self) -> Mapping[str, KindOnBus]:
        from pnfarm.buses.profinet.faults.on_bus import ON_PROFINET

        return ON_PROFINET

    def commands(self) -> Iterable[Command]:
        from pnfarm.buses.profinet.commands import gsdml, module, record
        from pnfarm.terminal.command import Command, Panel

        return (
            Command("module", Panel.RUNNING, module.app, behind="param"),
            Command("record", Panel.CONTROLLER, record.app, behind="plc"),
            Command("gsdml", Panel.REFERENCE, gsdml.gsdml, behind="models"),
        )

    async def search(self, question: Question) -> SearchAnswer:
        from pnfarm.buses.profinet.commands.scan import search

        return await search(question)

    def add_routes(self, app: FastAPI, host: RouteHost) -> None:
        from pnfarm.buses.profinet.api.modules import add_modules

        add_modules(app, host)

    @property
    def frame_families(self) -> Sequence[str]:
        return ("cyclic", "dcp", "rpc", "alarm", "lldp", "ptcp", "snmp")

    def decoder(self, capture: Capture) -> ProfinetDecoder:
        from pnfarm.buses.profinet.decode.decoder import ProfinetDecoder

        return ProfinetDecoder(capture)

    def injected_drive(self, device: ProfinetDevice, host: InjectionHost) -> InjectedDrive:
        from pnfarm.buses.profinet.faults.drive import injected_drive

        return injected_drive(device, host)


PROFINET = Profinet()
