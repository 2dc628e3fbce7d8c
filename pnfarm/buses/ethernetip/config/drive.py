"""A group of drives on EtherNet/IP, and one drive of it."""

from __future__ import annotations

from dataclasses import dataclass

from pydantic import Field

from pnfarm.buses.ethernetip.config.values import Rpi
from pnfarm.config.ip import IpDriveConfig, IpDrives
from pnfarm.config.values import Cidr

__all__ = ["EthernetIpDriveConfig", "EthernetIpDrives"]


class EthernetIpDrives(IpDrives):
    """Keys of a group on EtherNet/IP."""

    ip: Cidr | None = Field(default=None, description="First drive's address; counts up.  A drive here must have one.")
    rpi_ns: Rpi | None = Field(
        default=None,
        alias="rpi",
        description="Requested packet interval at which the built-in controller runs these drives, from 1ms to 10s.",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class EthernetIpDriveConfig(IpDriveConfig):
    """One drive; ``rpi_ns`` is None where the controller's counts."""

    rpi_ns: int | None = None
