"""PROFIBUS as a bus of the package (:class:`pnfarm.buses.bus.Bus`)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

from pnfarm.buses.checking import CheckingBus
from pnfarm.buses.imports import ImportingBus, ProjectBus

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from pnfarm.buses.bus import DeviceServices
    from pnfarm.buses.described import DescribedIdentity
    from pnfarm.buses.devices import DeviceRows
    from pnfarm.buses.line_parameters import LineQuestion
    from pnfarm.buses.profibus.config.device import ProfibusDeviceConfig
    from pnfarm.buses.profibus.controller.line_question import LineParameter
    from pnfarm.buses.profibus.device.device import ProfibusDevice
    from pnfarm.drives.description.model import Model
    from pnfarm.links.base import Link, Port
    from pnfarm.protocols.profibus.splitter import Splitter
    from pnfarm.station.station import Station
    from pnfarm.terminal.command import Command

__all__ = ["PROFIBUS", "Profibus"]


class Profibus(ImportingBus, ProjectBus, CheckingBus):
    """See the module's docstring."""

    name = "profibus"
    project_kind = "caex"
    title = "PROFIBUS"
    link_kinds = frozenset({"serial", "memory"})
    frame_families = ("cyclic", "dp", "dpv1", "fdl")
    description_key = "gsd"
    link_type = 257  # LINKTYPE_PROFIBUS_DL

    def described_identity(
        self, path: Path, model: Model, own: Mapping[str, Any], access_point: str | int | None
    ) -> DescribedIdentity:
        """A slave has no access point to choose."""
        from pnfarm.buses.profibus.gsd_file import load_gsd
        from pnfarm.buses.profibus.maker_identity import identity_of

        del own, access_point
        return identity_of(load_gsd(path), model)

    def channel_rows(self, model: Model) -> int:
        """A polled bus has no scheduled rows; the table wants one."""
        del model
        return 1

    @property
    def baud_rates(self) -> Sequence[int]:
        from pnfarm.protocols.profibus.wire.timing import BAUD_RATES

        return BAUD_RATES

    def longest_reply_ns(self, baud: int) -> int:
        from pnfarm.protocols.profibus.wire.timing import bits_ns, longest_tsdr_bits

        return bits_ns(longest_tsdr_bits(baud), baud)

    def splitter(self, baud: int) -> Splitter:
        from pnfarm.protocols.profibus.splitter import Splitter

        return Splitter(baud)

    def device(self, station: Station, services: DeviceServices) -> ProfibusDevice:
        from pnfarm.buses.profibus.device.device import ProfibusDevice
        from pnfarm.buses.profibus.device.drive import DriveKind

        return ProfibusDevice(station, services, DriveKind(station))

    def device_rows(self, config: Any) -> DeviceRows:
        """A polled bus has no scheduled rows, and copies no pieces."""
        from pnfarm.buses.devices import DeviceRows

        del config
        return DeviceRows(0, 0)

    def described_device(self, station: Station, services: DeviceServices) -> ProfibusDevice:
        from pnfarm.buses.profibus.described.kind import DescribedKind
        from pnfarm.buses.profibus.described.summary import station_description
        from pnfarm.buses.profibus.device.device import ProfibusDevice

        settings = cast("ProfibusDeviceConfig", station.config)
        kind = DescribedKind(station, settings, services.channels.columns, services.plain_row)
        station.signals = kind.signals
        station.description = station_description(kind.described)
        return ProfibusDevice(station, services, kind)

    def commands(self) -> Iterable[Command]:
        from pnfarm.buses.profibus.commands import gsd
        from pnfarm.terminal.command import Command, Panel

        return (Command("gsd", Panel.REFERENCE, gsd.gsd, behind="models"),)

    def parameter_asker(self, link: Link, port: Port, question: LineQuestion) -> LineParameter:
        from pnfarm.buses.profibus.controller.line_question import LineParameter

        return LineParameter(link, port, question)


PROFIBUS = Profibus()
