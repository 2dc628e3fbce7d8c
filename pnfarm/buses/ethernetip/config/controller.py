"""The controller's section on EtherNet/IP: the scanner."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from pnfarm.buses.ethernetip.config.values import Rpi
from pnfarm.config.drive import MAX_DRIVES
from pnfarm.config.ip import IpController
from pnfarm.config.section import Section
from pnfarm.config.values import Cidr, Duration, NamePattern, OctetString, between

__all__ = ["USUAL_RPI_NS", "EdsDevice", "EthernetIpController"]

#: Packet interval of a drive where the file names none and its manual allows it.
USUAL_RPI_NS = 10_000_000
LEAST_REQUEST_NS, MOST_REQUEST_NS = 10_000_000, 60_000_000_000

RequestTime = Annotated[Duration, between(LEAST_REQUEST_NS, MOST_REQUEST_NS, "10ms to 60s")]


class EdsDevice(Section):
    """A device without a model, described by its maker's EDS file."""

    name: NamePattern = Field(description="Its name in this file; on the wire it has none.")
    eds: str = Field(min_length=1, description="Its EDS file, relative to this file.")
    ip: Cidr = Field(description="Its address.")
    connection: str | None = Field(
        default=None,
        min_length=1,
        description="Keyword (`Connection2`) or name of the connection of the EDS file's section Connection Manager; "
        "left out, the first one with an exclusive owner.",
    )
    rpi_ns: Rpi | None = Field(
        default=None,
        alias="rpi",
        description="Its packet interval; left out, the scanner's, else the default of the file.",
    )
    multicast: bool | None = Field(
        default=None,
        description="Whether it sends to a group; left out, as the scanner's where the EDS file allows it.",
    )
    configuration: OctetString | None = Field(
        default=None, description="Data of its configuration assembly in hexadecimal, sent with Forward_Open."
    )
    outputs: OctetString | None = Field(
        default=None, description="Its output data in hexadecimal, the same all the time; left out, zeros."
    )


class EthernetIpController(IpController):
    """The built-in EtherNet/IP scanner."""

    last_keys: ClassVar[tuple[str, ...]] = ("program", "devices", "reconnect")
    description_file: ClassVar[str] = "EDS"

    rpi_ns: Rpi | None = Field(
        default=None,
        alias="rpi",
        description="Requested packet interval of cyclic data, both ways; left out, 10ms (a drive's fastest where that "
        "is slower).",
    )
    timeout_multiplier: Literal[4, 8, 16, 32, 64, 128, 256, 512] = Field(
        default=16, description="Packet intervals without data until either end gives the connection up."
    )
    connection: Literal["exclusive-owner", "input-only", "listen-only"] = Field(
        default="exclusive-owner",
        description="exclusive-owner: it commands the drives; input-only: it receives their data only; listen-only: "
        "the same, as long as an owner is connected whose drives send to a multicast group.",
    )
    multicast: bool = Field(
        default=False,
        description="Whether the drives send their data to a group, so that others can listen; listen-only always asks "
        "for that.",
    )
    keying: Literal["exact", "compatible", "off"] = Field(
        default="compatible",
        description="Electronic key in Forward_Open: exact: this revision; compatible: the drive decides whether it "
        "can take the place of this revision; off: any device.",
    )
    request_timeout_ns: RequestTime = Field(
        default=5_000_000_000,
        alias="request_timeout",
        description="How long any answer may take: of a TCP connection, a session, a Forward_Open, a parameter.",
    )
    devices: list[EdsDevice] = Field(
        default_factory=list, max_length=MAX_DRIVES, description="Further devices, each by its EDS file."
    )
