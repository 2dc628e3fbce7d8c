"""A device as its own helpers see it: the machines and the drive that they read, and the two calls they may make."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from collections import Counter
    from collections.abc import Mapping

    from pnfarm.buses.profinet.device.address import StationAddress
    from pnfarm.buses.profinet.device.ar_channels import ArChannels
    from pnfarm.buses.profinet.device.channels import StationChannels
    from pnfarm.buses.profinet.device.kind import Kind
    from pnfarm.buses.profinet.device.management.neighbour_rows import NeighbourRows
    from pnfarm.buses.profinet.device.management.neighbours import StationNeighbours
    from pnfarm.buses.profinet.device.management.traffic import PortTraffic
    from pnfarm.links.base import Port
    from pnfarm.protocols.profinet.cm.device.cmdev import CmDevice
    from pnfarm.protocols.profinet.dcp.device import DcpDevice
    from pnfarm.protocols.profinet.description import DeviceDescription
    from pnfarm.protocols.profinet.records.store import DeviceRecords
    from pnfarm.protocols.profinet.snmp.view import SystemText
    from pnfarm.station.event import Event
    from pnfarm.station.station import Station

__all__ = ["DeviceParts"]


class DeviceParts(Protocol):
    """See the module's docstring; the machines are recreated at each power-on."""

    station: Station
    kind: Kind
    description: DeviceDescription
    dcp: DcpDevice
    cm: CmDevice
    records: DeviceRecords
    addressing: StationAddress
    channels: StationChannels
    neighbours: StationNeighbours
    traffic: PortTraffic
    snmp_texts: dict[SystemText, str]
    neighbour_rows: NeighbourRows

    @property
    def port(self) -> Port:
        """Its interface."""

    @property
    def name(self) -> str:
        """The present station name."""

    @property
    def powered(self) -> bool:
        """Whether the control supply is on."""

    @property
    def booted_ns(self) -> int:
        """Time of the last power-on."""

    @property
    def ars(self) -> Mapping[int, ArChannels]:
        """The present connections, by the key of their AR."""

    @property
    def aborts(self) -> Counter[tuple[int, int]]:
        """Aborted connections by the codes of the ERR-RTA."""

    def discards(self) -> dict[str, int]:
        """Dropped frames and PDUs by reason."""

    def note(self, now: int, event: Event) -> None:
        """Something happened to this drive."""

    def keep(self, now: int, key: str, value: Any) -> None:
        """Write one value of non-volatile memory through; None forgets it."""
