"""A group of devices on EtherNet/IP, each by its EDS file, and one device of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from pydantic import Field

from pnfarm.buses.ethernetip.config.values import Rpi  # noqa: TC001 - pydantic reads the annotations of fields
from pnfarm.config.ip import IpDeviceConfig, IpDevices
from pnfarm.config.section import Section
from pnfarm.config.values import Cidr, Scalar  # noqa: TC001 - pydantic reads the annotations of fields

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.buses.ethernetip.described.station import DescribedStation

__all__ = ["DataSizes", "EthernetIpDeviceConfig", "EthernetIpDevices"]

_MOST_OCTETS = 1400


class DataSizes(Section):
    """Octets of data of a connection whose file leaves them to the controller."""

    outputs: int | None = Field(default=None, ge=0, le=_MOST_OCTETS, description="To the device; left out, the file's.")
    inputs: int | None = Field(
        default=None, ge=0, le=_MOST_OCTETS, description="From the device; left out, the file's."
    )


class EthernetIpDevices(IpDevices):
    """Keys of a group on EtherNet/IP."""

    first_keys: ClassVar[tuple[str, ...]] = ("name", "count", "start", "eds", "connection", "ip", "gateway", "mac")

    eds: str = Field(
        min_length=1,
        max_length=4096,
        description="Its maker's EDS file, relative to this file: a device on EtherNet/IP.",
    )
    ip: Cidr | None = Field(
        default=None, description="First device's address; counts up.  A device here must have one."
    )
    connection: str | int | None = Field(
        default=None,
        description="Number, keyword (`Connection2`) or name of the connection that the built-in controller opens; "
        "left out, the first one with an exclusive owner.  Other controllers may open any one of the file.",
    )
    sizes: DataSizes = Field(
        default_factory=DataSizes,
        description="Octets of its data, where the file has a range of them.",
        examples=[{"inputs": 32}],
    )
    parameters: dict[str, Scalar] = Field(
        default_factory=dict,
        max_length=10_000,
        description="Its parameters by the names of its file, or as ParamN: the values that it has, and that the "
        "built-in controller sends as configuration.  Numbers are those on the wire.",
        examples=[{"Filter": "slow"}],
    )
    rpi_ns: Rpi | None = Field(
        default=None,
        alias="rpi",
        description="Packet interval at which the built-in controller runs these devices; left out, the controller's, "
        "else the default of the file.",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class EthernetIpDeviceConfig(IpDeviceConfig):
    """One device; ``rpi_ns`` is None where the controller's counts."""

    described: DescribedStation
    rpi_ns: int | None = None

    @property
    def known_signals(self) -> Mapping[str, Any]:
        return self.described.signals
