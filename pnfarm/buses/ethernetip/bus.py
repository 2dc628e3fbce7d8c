"""EtherNet/IP as a bus of the package (:class:`pnfarm.buses.bus.Bus`)."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from pnfarm.buses.checking import CheckingBus
from pnfarm.buses.imports import ImportingBus, ProjectBus
from pnfarm.buses.search import SearchBus

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pnfarm.buses.bus import DeviceServices
    from pnfarm.buses.devices import DeviceRows
    from pnfarm.buses.ethernetip.config.device import EthernetIpDeviceConfig
    from pnfarm.buses.ethernetip.device.device import EthernetIpDevice
    from pnfarm.drives.description.model import Model
    from pnfarm.station.station import Station
    from pnfarm.terminal.command import Command

__all__ = ["ETHERNETIP", "EthernetIp"]


class EthernetIp(ImportingBus, ProjectBus, SearchBus, CheckingBus):
    """See the module's docstring."""

    name = "ethernetip"
    project_kind = "l5x"
    title = "EtherNet/IP"
    link_kinds = frozenset({"macvlan", "veth", "memory"})
    uses_sockets = True
    frame_families = ("cyclic", "enip", "cip")
    description_key = "eds"

    def channel_rows(self, model: Model) -> int:
        from pnfarm.buses.ethernetip.device.channels import channel_rows
        from pnfarm.buses.ethernetip.device.product import Product

        return channel_rows(Product.of(model).io_connections)

    def device(self, station: Station, services: DeviceServices) -> EthernetIpDevice:
        from pnfarm.buses.ethernetip.device.device import EthernetIpDevice
        from pnfarm.buses.ethernetip.device.drive import DriveKind

        return EthernetIpDevice(station, services, DriveKind(station))

    def device_rows(self, config: EthernetIpDeviceConfig) -> DeviceRows:
        from pnfarm.buses.devices import DeviceRows
        from pnfarm.buses.ethernetip.described.kind import io_connections
        from pnfarm.buses.ethernetip.device.channels import channel_rows

        rows = channel_rows(io_connections(config.described))
        # a piece for each direction, and as many of closed ones that the engine has until its next tick
        return DeviceRows(rows, 4 * rows)

    def described_device(self, station: Station, services: DeviceServices) -> EthernetIpDevice:
        from pnfarm.buses.ethernetip.described.kind import DescribedKind
        from pnfarm.buses.ethernetip.described.summary import station_description
        from pnfarm.buses.ethernetip.device.device import EthernetIpDevice

        kind = DescribedKind(
            cast("EthernetIpDeviceConfig", station.config), services.channels.columns, services.plain_row
        )
        station.signals = kind.signals
        station.description = station_description(kind.described)
        return EthernetIpDevice(station, services, kind)

    def commands(self) -> Iterable[Command]:
        from pnfarm.buses.ethernetip.commands import eds
        from pnfarm.terminal.command import Command, Panel

        return (Command("eds", Panel.REFERENCE, eds.eds, behind="models"),)


ETHERNETIP = EthernetIp()
