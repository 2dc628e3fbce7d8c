"""EtherNet/IP as a bus of the package (:class:`pnfarm.buses.bus.Bus`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.imports import ImportingBus
from pnfarm.buses.search import SearchBus

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pnfarm.buses.bus import DeviceServices
    from pnfarm.buses.ethernetip.device.device import EthernetIpDevice
    from pnfarm.drives.description.model import Model
    from pnfarm.station.station import Station
    from pnfarm.terminal.command import Command

__all__ = ["ETHERNETIP", "EthernetIp"]


class EthernetIp(ImportingBus, SearchBus):
    """See the module's docstring."""

    name = "ethernetip"
    title = "EtherNet/IP"
    link_kinds = frozenset({"macvlan", "veth", "memory"})
    uses_sockets = True
    frame_families = ("cyclic", "enip", "cip")

    def channel_rows(self, model: Model) -> int:
        from pnfarm.buses.ethernetip.device.channels import channel_rows
        from pnfarm.buses.ethernetip.device.product import Product

        return channel_rows(Product.of(model).io_connections)

    def device(self, station: Station, services: DeviceServices) -> EthernetIpDevice:
        from pnfarm.buses.ethernetip.device.device import EthernetIpDevice
        from pnfarm.buses.ethernetip.device.drive import DriveKind

        return EthernetIpDevice(station, services, DriveKind(station))

    def commands(self) -> Iterable[Command]:
        from pnfarm.buses.ethernetip.commands import eds
        from pnfarm.terminal.command import Command, Panel

        return (Command("eds", Panel.REFERENCE, eds.eds, behind="models"),)


ETHERNETIP = EthernetIp()
