"""The data of a station's LLDP agent as rows of LLDP-MIB."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.snmp.view import (
    Dot3Port,
    ManagementAddress,
    NeighbourView,
    PnoPort,
    capability_bits,
)
from pnfarm.protocols.profinet.wire.lldp.tlvs import MacPhyStatus, MeasuredDelays, PortStatus
from pnfarm.protocols.profinet.wire.snmp.ber import parse_oid

if TYPE_CHECKING:
    from collections.abc import Hashable, Sequence

    from pnfarm.protocols.profinet.lldp.agent import Neighbour
    from pnfarm.protocols.profinet.wire.lldp.tlvs import ManagementAddress as SentAddress
    from pnfarm.protocols.profinet.wire.snmp.ber import Oid

__all__ = ["NeighbourRows", "management_view"]


class NeighbourRows:
    """Rows of lldpRemTable: a neighbour keeps its index as long as it is present."""

    def __init__(self) -> None:
        self._numbers: dict[Hashable, int] = {}
        self._last = 0

    def views(self, neighbours: Sequence[Neighbour], port: int, booted_ns: int) -> list[NeighbourView]:
        """The neighbours of ``port``; times count from ``booted_ns``."""
        known = {(n.chassis, n.port_id): n for n in neighbours}
        self._numbers = {key: number for key, number in self._numbers.items() if key in known}
        for key in known:
            if key not in self._numbers:
                self._last += 1
                self._numbers[key] = self._last
        return [_view(n, port, self._numbers[key], booted_ns) for key, n in known.items()]


def _view(neighbour: Neighbour, port: int, index: int, booted_ns: int) -> NeighbourView:
    capabilities = neighbour.capabilities
    mac_phy = next((t for t in neighbour.tlvs if isinstance(t, MacPhyStatus)), None)
    return NeighbourView(
        time_mark_ns=max(0, neighbour.changed_ns - booted_ns),
        port=port,
        index=index,
        chassis_id=neighbour.chassis.value,
        chassis_id_subtype=neighbour.chassis.subtype,
        port_id=neighbour.port_id.value,
        port_id_subtype=neighbour.port_id.subtype,
        port_description=neighbour.port_description,
        system_name=neighbour.system_name,
        system_description=neighbour.system_description,
        capabilities_supported=b"" if capabilities is None else capability_bits(capabilities.supported),
        capabilities_enabled=b"" if capabilities is None else capability_bits(capabilities.enabled),
        addresses=tuple(management_view(a) for a in neighbour.management),
        dot3=None if mac_phy is None else _dot3(mac_phy),
        pno=_pno(neighbour),
    )


def management_view(sent: SentAddress) -> ManagementAddress:
    """A management address as in its TLV."""
    object_id: Oid = (0, 0)
    if sent.oid:
        try:
            object_id = parse_oid(sent.oid)
        except DecodeError:
            # a neighbour may send something else than an object identifier; a manager must get one
            object_id = (0, 0)
    return ManagementAddress(
        sent.address, sent.interface_number, sent.subtype, sent.interface_subtype, object_id=object_id
    )


def _dot3(sent: MacPhyStatus) -> Dot3Port:
    return Dot3Port(
        autoneg_supported=bool(sent.autonegotiation & 1),
        autoneg_enabled=bool(sent.autonegotiation & 2),
        autoneg_advertised=sent.advertised.to_bytes(2, "big"),
        mau_type=sent.mau_type,
    )


def _pno(neighbour: Neighbour) -> PnoPort | None:
    status = next((t for t in neighbour.tlvs if isinstance(t, PortStatus)), None)
    delays = next((t for t in neighbour.tlvs if isinstance(t, MeasuredDelays)), None)
    if status is None and delays is None and neighbour.chassis_mac is None:
        return None
    return PnoPort(
        line_delay_ns=0 if delays is None else delays.cable_local,
        tx_delay_ns=0 if delays is None else delays.tx_local,
        rx_delay_ns=0 if delays is None else delays.rx_local,
        rt2_status=0 if status is None else status.rtclass2 & 3,
        rt3_status=0 if status is None else status.rtclass3 & 7,
        station_name=neighbour.station_name,
    )
