"""Name and addresses of a station as parameters show them (Moog MSD manual 15, P-1289 to P-1292, P-1295)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.wire.names import check_station_name

if TYPE_CHECKING:
    from pnfarm.protocols.profinet.dcp.device import DcpDevice

__all__ = ["StationNetwork"]


class StationNetwork:
    """``dcp`` holds what is in force; every port has the station's own address."""

    def __init__(self, dcp: DcpDevice, mac: bytes, ports: int) -> None:
        self._dcp = dcp
        self.macs = (mac,) * (1 + ports)

    @property
    def name(self) -> str:
        return self._dcp.name

    @property
    def ip(self) -> int:
        return int(self._dcp.address.ip) if self._dcp.address is not None else 0

    @property
    def mask(self) -> int:
        return int(self._dcp.address.netmask) if self._dcp.address is not None else 0

    @property
    def gateway(self) -> int:
        return int(self._dcp.gateway) if self._dcp.gateway is not None else 0

    @property
    def line_rate(self) -> int:
        return 0

    def allows(self, name: str) -> bool:
        return not name or check_station_name(name) is None
