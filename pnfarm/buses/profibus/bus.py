"""PROFIBUS as a bus of the package (:class:`pnfarm.buses.bus.Bus`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from fastapi import FastAPI

    from pnfarm.buses.bus import DeviceServices, InjectionHost, LineSplitter, RouteHost
    from pnfarm.buses.controller import ControllerHost
    from pnfarm.buses.imports import FoundDrive, FoundStation
    from pnfarm.buses.line_parameters import LineQuestion
    from pnfarm.buses.profibus.config.controller import ProfibusController
    from pnfarm.buses.profibus.config.drive import ProfibusDriveConfig
    from pnfarm.buses.profibus.config.part import ProfibusPart
    from pnfarm.buses.profibus.controller.core import MasterCore
    from pnfarm.buses.profibus.controller.line_question import LineParameter
    from pnfarm.buses.profibus.controller.plan import ProfibusPlan
    from pnfarm.buses.profibus.decode.decoder import ProfibusDecoder
    from pnfarm.buses.profibus.device.device import ProfibusDevice
    from pnfarm.buses.profibus.device.segment import ProfibusSegment
    from pnfarm.captures.decoder import FrameDecoder
    from pnfarm.captures.packet import Capture
    from pnfarm.drives.description.model import Model
    from pnfarm.faults.effects.parts import InjectedDrive
    from pnfarm.faults.kind import InjectionKind, KindOnBus
    from pnfarm.links.base import Link, Port
    from pnfarm.station.station import Station
    from pnfarm.terminal.command import Command

__all__ = ["PROFIBUS", "Profibus"]


class Profibus:
    """See the module's docstring."""

    name = "profibus"
    title = "PROFIBUS"
    link_kinds = frozenset({"serial", "memory"})
    uses_line = True

    @property
    def farm_file(self) -> ProfibusPart:
        from pnfarm.buses.profibus.config.part import PROFIBUS_PART

        return PROFIBUS_PART

    @property
    def connection_states(self) -> Sequence[str]:
        from pnfarm.buses.profibus.device.view import CONNECTION_STATES

        return CONNECTION_STATES

    @property
    def usual_losses(self) -> Sequence[str]:
        from pnfarm.buses.profibus.device.view import USUAL_LOSSES

        return USUAL_LOSSES

    def channel_rows(self, model: Model) -> int:
        """A polled bus has no scheduled rows; the table wants one."""
        del model
        return 1

    def device(self, station: Station, services: DeviceServices) -> ProfibusDevice:
        from pnfarm.buses.profibus.device.device import ProfibusDevice

        return ProfibusDevice(station, services)

    def segment(self, devices: Sequence[ProfibusDevice]) -> ProfibusSegment:
        from pnfarm.buses.profibus.device.segment import ProfibusSegment

        return ProfibusSegment(devices)

    @property
    def baud_rates(self) -> Sequence[int]:
        from pnfarm.protocols.profibus.wire.timing import BAUD_RATES

        return BAUD_RATES

    def longest_reply_ns(self, baud: int) -> int:
        from pnfarm.protocols.profibus.wire.timing import bits_ns, longest_tsdr_bits

        return bits_ns(longest_tsdr_bits(baud), baud)

    def splitter(self, baud: int) -> LineSplitter:
        from pnfarm.buses.profibus.device.line import TelegramSplitter

        return TelegramSplitter(baud)

    def plan(
        self,
        section: ProfibusController,
        drives: Sequence[ProfibusDriveConfig],
        models: Sequence[Model],
        folder: Path | None,
    ) -> ProfibusPlan:
        from pnfarm.buses.profibus.controller.plan import plan_controller

        return plan_controller(section, drives, models, folder)

    def controller(self, plan: ProfibusPlan, host: ControllerHost) -> MasterCore:
        from pnfarm.buses.profibus.controller.core import MasterCore

        return MasterCore(plan, host)

    def fault_kinds(self) -> Iterable[InjectionKind]:
        from pnfarm.buses.profibus.faults import kinds
        from pnfarm.faults.catalogue import kinds_in

        return kinds_in(kinds)

    def kinds_here(self) -> Mapping[str, KindOnBus]:
        from pnfarm.buses.profibus.faults.on_bus import ON_PROFIBUS

        return ON_PROFIBUS

    def commands(self) -> Iterable[Command]:
        from pnfarm.buses.profibus.commands import gsd
        from pnfarm.terminal.command import Command, Panel

        return (Command("gsd", Panel.REFERENCE, gsd.gsd, behind="models"),)

    def add_routes(self, app: FastAPI, host: RouteHost) -> None:
        """It has no routes of its own."""

    @property
    def link_type(self) -> int:
        return 257  # LINKTYPE_PROFIBUS_DL

    @property
    def frame_families(self) -> Sequence[str]:
        return ("cyclic", "dp", "dpv1", "fdl")

    def decoder(self, capture: Capture) -> ProfibusDecoder:
        from pnfarm.buses.profibus.decode.decoder import ProfibusDecoder

        return ProfibusDecoder(capture)

    def observe(self, decoder: FrameDecoder) -> None:
        from pnfarm.buses.profibus.decode.decoder import ProfibusDecoder
        from pnfarm.buses.profibus.decode.observed import Observed

        if isinstance(decoder, ProfibusDecoder):
            decoder.observed = Observed()

    def found(self, decoder: FrameDecoder) -> Iterable[FoundDrive | FoundStation]:
        from pnfarm.buses.profibus.decode.decoder import ProfibusDecoder
        from pnfarm.buses.profibus.found import found

        if not isinstance(decoder, ProfibusDecoder) or decoder.observed is None:
            return ()
        return found(decoder.observed, decoder)

    def parameter_asker(self, link: Link, port: Port, question: LineQuestion) -> LineParameter:
        from pnfarm.buses.profibus.controller.line_question import LineParameter

        return LineParameter(link, port, question)

    def injected_drive(self, device: ProfibusDevice, host: InjectionHost) -> InjectedDrive:
        from pnfarm.buses.profibus.faults.drive import injected_drive

        return injected_drive(device, host)


PROFIBUS = Profibus()
