"""A device as its observers see it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from ipaddress import IPv4Address

    from pnfarm.buses.ethernetip.device.address import DeviceAddress
    from pnfarm.buses.ethernetip.device.channels import StationChannels
    from pnfarm.buses.ethernetip.device.connections import StationConnections
    from pnfarm.buses.ethernetip.device.kind import Settings
    from pnfarm.protocols.enip.adapter import Adapter

__all__ = ["DeviceParts"]


class DeviceParts(Protocol):
    """The machines are recreated at each power-on."""

    adapter: Adapter
    address: DeviceAddress
    channels: StationChannels
    connections: StationConnections

    @property
    def config(self) -> Settings:
        """This station's settings in the farm file."""

    @property
    def name(self) -> str:
        """The present station name."""

    def next_hop(self, address: IPv4Address) -> bytes | None:
        """The MAC address to which frames for an address go, None while it is not known."""
