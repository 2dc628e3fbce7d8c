"""EtherNet/IP as a bus of the package (:class:`pnfarm.buses.bus.Bus`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from fastapi import FastAPI

    from pnfarm.buses.bus import DeviceServices, InjectionHost, RouteHost
    from pnfarm.buses.controller import ControllerHost
    from pnfarm.buses.ethernetip.config.controller import EthernetIpController
    from pnfarm.buses.ethernetip.config.drive import EthernetIpDriveConfig
    from pnfarm.buses.ethernetip.config.part import EthernetIpPart
    from pnfarm.buses.ethernetip.controller.core import ScannerCore
    from pnfarm.buses.ethernetip.controller.plan import EthernetIpPlan
    from pnfarm.buses.ethernetip.decode.decoder import EthernetIpDecoder
    from pnfarm.buses.ethernetip.device.device import EthernetIpDevice
    from pnfarm.buses.ethernetip.device.segment import EthernetIpSegment
    from pnfarm.buses.imports import FoundDrive, FoundStation
    from pnfarm.buses.search import Question, SearchAnswer
    from pnfarm.captures.decoder import FrameDecoder
    from pnfarm.captures.packet import Capture
    from pnfarm.drives.description.model import Model
    from pnfarm.faults.effects.parts import InjectedDrive
    from pnfarm.faults.kind import InjectionKind, KindOnBus
    from pnfarm.station.station import Station
    from pnfarm.terminal.command import Command

__all__ = ["ETHERNETIP", "EthernetIp"]


class EthernetIp:
    """See the module's docstring."""

    name = "ethernetip"
    title = "EtherNet/IP"
    link_kinds = frozenset({"macvlan", "veth", "memory"})
    uses_sockets = True

    @property
    def farm_file(self) -> EthernetIpPart:
        from pnfarm.buses.ethernetip.config.part import ETHERNETIP_PART

        return ETHERNETIP_PART

    @property
    def connection_states(self) -> Sequence[str]:
        from pnfarm.buses.ethernetip.device.view import CONNECTION_STATES

        return CONNECTION_STATES

    @property
    def usual_losses(self) -> Sequence[str]:
        from pnfarm.buses.ethernetip.device.view import USUAL_LOSSES

        return USUAL_LOSSES

    def channel_rows(self, model: Model) -> int:
        from pnfarm.buses.ethernetip.device.channels import channel_rows
        from pnfarm.buses.ethernetip.device.product import Product

        return channel_rows(Product.of(model).io_connections)

    def device(self, station: Station, services: DeviceServices) -> EthernetIpDevice:
        from pnfarm.buses.ethernetip.device.device import EthernetIpDevice

        return EthernetIpDevice(station, services)

    def segment(self, devices: Sequence[EthernetIpDevice]) -> EthernetIpSegment:
        from pnfarm.buses.ethernetip.device.segment import EthernetIpSegment

        return EthernetIpSegment(devices)

    def plan(
        self,
        section: EthernetIpController,
        drives: Sequence[EthernetIpDriveConfig],
        models: Sequence[Model],
        folder: Path | None,
    ) -> EthernetIpPlan:
        from pnfarm.buses.ethernetip.controller.plan import plan_controller

        return plan_controller(section, drives, models, folder)

    def controller(self, plan: EthernetIpPlan, host: ControllerHost) -> ScannerCore:
        from pnfarm.buses.ethernetip.controller.core import ScannerCore

        return ScannerCore(plan, host)

    def fault_kinds(self) -> Iterable[InjectionKind]:
        from pnfarm.buses.ethernetip.faults import kinds
        from pnfarm.faults.catalogue import kinds_in

        return kinds_in(kinds)

    def kinds_here(self) -> Mapping[str, KindOnBus]:
        from pnfarm.buses.ethernetip.faults.on_bus import ON_ETHERNETIP

        return ON_ETHERNETIP

    def commands(self) -> Iterable[Command]:
        from pnfarm.buses.ethernetip.commands import eds
        from pnfarm.terminal.command import Command, Panel

        return (Command("eds", Panel.REFERENCE, eds.eds, behind="models"),)

    async def search(self, question: Question) -> SearchAnswer:
        from pnfarm.buses.ethernetip.commands.scan import search

        return await search(question)

    def add_routes(self, app: FastAPI, host: RouteHost) -> None:
        """It has no routes of its own."""

    @property
    def frame_families(self) -> Sequence[str]:
        return ("cyclic", "enip", "cip")

    def decoder(self, capture: Capture) -> EthernetIpDecoder:
        from pnfarm.buses.ethernetip.decode.decoder import EthernetIpDecoder

        return EthernetIpDecoder(capture)

    def observe(self, decoder: FrameDecoder) -> None:
        from pnfarm.buses.ethernetip.decode.decoder import EthernetIpDecoder
        from pnfarm.buses.ethernetip.decode.observed import Observed

        if isinstance(decoder, EthernetIpDecoder):
            decoder.shared.observed = Observed()

    def found(self, decoder: FrameDecoder) -> Iterable[FoundDrive | FoundStation]:
        from pnfarm.buses.ethernetip.decode.decoder import EthernetIpDecoder
        from pnfarm.buses.ethernetip.found import found

        observed = decoder.shared.observed if isinstance(decoder, EthernetIpDecoder) else None
        return () if observed is None else found(observed)

    def injected_drive(self, device: EthernetIpDevice, host: InjectionHost) -> InjectedDrive:
        from pnfarm.buses.ethernetip.faults.drive import injected_drive

        return injected_drive(device, host)


ETHERNETIP = EthernetIp()
