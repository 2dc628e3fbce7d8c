"""Stations with a MAC and an IP address: their keys, the checks of these, and how they count up."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from ipaddress import IPv4Address, IPv4Interface, IPv4Network
from typing import TYPE_CHECKING, Any, ClassVar, Self

from pydantic import Field

from pnfarm.config.controller import ControllerSection
from pnfarm.config.device import DeviceConfig, DeviceGroup
from pnfarm.config.drive import DriveConfig, DriveGroup
from pnfarm.config.values import AUTO, Cidr, Gateway, MacSetting, expand_name
from pnfarm.errors import InternalError
from pnfarm.vocabulary.quoting import shown
from pnfarm.wire.mac import format_mac, is_group, mac_from_int, mac_to_int

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from pnfarm.config.drive import Claim
    from pnfarm.vocabulary.issues import Location, Report

__all__ = [
    "IpController",
    "IpDeviceConfig",
    "IpDevices",
    "IpDriveConfig",
    "IpDrives",
    "Macs",
    "auto_mac",
    "check_addresses",
    "check_controller_host",
    "check_host",
    "nth_ip",
]


class IpDrives(DriveGroup):
    """Keys of a group whose drives are such stations."""

    first_keys: ClassVar[tuple[str, ...]] = ("name", "count", "start", "model", "ip", "gateway", "mac")

    ip: Cidr | None = Field(default=None, description="First drive's address; counts up.")
    gateway: Gateway | None = Field(default=None, description="Router of the subnet.")
    mac: MacSetting = Field(
        default=AUTO,
        description="auto: a stable, locally administered address; or the address of the first drive, which counts up.",
    )


class IpDevices(DeviceGroup):
    """The same of devices."""

    first_keys: ClassVar[tuple[str, ...]] = ("name", "count", "start", "ip", "gateway", "mac")

    ip: Cidr | None = Field(
        default=None, description="First device's address; counts up.  Left out, the device waits for DCP."
    )
    gateway: Gateway | None = Field(default=None, description="Router of the subnet.")
    mac: MacSetting = Field(
        default=AUTO,
        description="auto: a stable, locally administered address; or the address of the first device, which counts "
        "up.",
    )


#: A group of stations with addresses.
IpGroup = IpDrives | IpDevices


class IpController(ControllerSection):
    """Keys of a controller that is such a station."""

    first_keys: ClassVar[tuple[str, ...]] = ("name", "ip", "mac")

    ip: Cidr | None = Field(default=None, description="Its address.")
    mac: MacSetting | None = Field(
        default=None, description="Its MAC address; left out, the interface's own, or a stable one on the farm's link."
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class IpDriveConfig(DriveConfig):
    """One such drive."""

    ip: IPv4Interface | None = None
    gateway: IPv4Address | None = None

    def claims(self) -> Sequence[Claim]:
        return _claims(self.mac, self.ip)

    def addresses(self) -> Sequence[str]:
        return self.mac.hex(":"), str(self.ip) if self.ip is not None else ""


@dataclass(frozen=True, slots=True, kw_only=True)
class IpDeviceConfig(DeviceConfig):
    """One such device."""

    ip: IPv4Interface | None = None
    gateway: IPv4Address | None = None

    @classmethod
    def of(cls, common: DeviceConfig, group: IpDevices, step: int, macs: Macs, **own: Any) -> Self:
        """A described group's device number ``step``, whose name is counted already, with what only its bus has."""
        if group.described is None:
            raise InternalError(f"devices {group.name} are made before their file is read")
        return cls.extending(
            common,
            kinds=group.described.kinds,
            # another one than a drive of the same name, which is reported as that
            mac=macs.of(group, f"device:{common.name}", step),
            ip=nth_ip(group, step),
            gateway=group.gateway,
            described=group.described,
            **own,
        )

    def claims(self) -> Sequence[Claim]:
        return _claims(self.mac, self.ip)

    def addresses(self) -> Sequence[str]:
        return self.mac.hex(":"), str(self.ip) if self.ip is not None else ""


def _claims(mac: bytes, ip: IPv4Interface | None) -> list[Claim]:
    own: list[Claim] = [("mac", mac, format_mac(mac))]
    return own if ip is None else [*own, ("ip", ip.ip, str(ip.ip))]


def auto_mac(farm: str, station: str, salt: int = 0) -> bytes:
    """A stable, locally administered address (IEEE 802-2014 clause 8.4): ``02`` and 40 bits of a digest."""
    digest = hashlib.sha256(f"{farm}\0{station}\0{salt}".encode()).digest()
    return b"\x02" + digest[:5]


class Macs:
    """Gives each station its address; those that the file names are never given to another."""

    def __init__(self, farm: str, groups: Sequence[DriveGroup | DeviceGroup], own: Iterable[bytes]) -> None:
        """``own``: those of the controllers."""
        self._farm = farm
        self._taken = {mac for group in groups if isinstance(group, IpGroup) for mac in _explicit(group)}
        self._taken.update(own)
        #: Salts that each name has used up, so that a name given thousands of times costs no search each.
        self._tried: dict[str, int] = {}

    def of(self, group: IpGroup, name: str, step: int) -> bytes:
        """The address of a group's drive number ``step``."""
        if isinstance(group.mac, bytes):
            return mac_from_int((mac_to_int(group.mac) + step) % (1 << 48))
        return self.auto(name)

    def auto(self, name: str) -> bytes:
        """A stable address for the drive that no other station has."""
        salt = self._tried.get(name, 0)
        while (mac := auto_mac(self._farm, name, salt)) in self._taken:
            salt += 1
        self._tried[name] = salt + 1
        self._taken.add(mac)
        return mac


def _explicit(group: IpGroup) -> Iterator[bytes]:
    if isinstance(group.mac, bytes):
        first = mac_to_int(group.mac)
        for value in range(first, min(first + group.count, 1 << 48)):
            yield mac_from_int(value)


def nth_ip(group: IpGroup, step: int) -> IPv4Interface | None:
    """The address of a group's drive number ``step``."""
    if group.ip is None:
        return None
    return IPv4Interface(((int(group.ip) + step) & 0xFFFF_FFFF, group.ip.network.prefixlen))


def check_addresses(at: Location, group: IpGroup, report: Report) -> None:
    if isinstance(group.mac, bytes):
        last = mac_to_int(group.mac) + group.count - 1
        if last >> 48 or is_group(mac_from_int(last)):
            report(
                (*at, "mac"),
                f"counts {group.count} {group.members} up into multicast addresses",
                "a lower first address",
            )
    if group.ip is None:
        if group.gateway is not None:
            report((*at, "gateway"), "is given without `ip`", "ip: ADDRESS/PREFIX beside it")
        return
    network = group.ip.network
    first, last = hosts_of(network)
    start = int(group.ip)
    if start < first:
        report((*at, "ip"), f"{group.ip.ip} is the address of the network {network}", _hosts(first, last))
    elif start > last:
        report((*at, "ip"), f"{group.ip.ip} is the broadcast address of {network}", _hosts(first, last))
    elif start + group.count - 1 > last:
        name = expand_name(group.name, group.start + last + 1 - start)
        report((*at, "ip"), f"counts past the end of {network} at {shown(name)}", _hosts(first, last))
    if group.gateway is None:
        return
    gateway = int(group.gateway)
    if not first <= gateway <= last:
        report(
            (*at, "gateway"),
            f"{group.gateway} is not a host of the {group.members}' subnet {network}",
            _hosts(first, last),
        )
    elif start <= gateway < start + group.count:
        name = expand_name(group.name, group.start + gateway - start)
        report(
            (*at, "gateway"),
            f"{group.gateway} is the address of the {group.members[:-1]} {shown(name)}",
            _hosts(first, last),
        )


def hosts_of(network: IPv4Network) -> tuple[int, int]:
    """The first and the last address of a subnet that a station can have."""
    return int(network.network_address) + 1, int(network.broadcast_address) - 1


def check_host(at: Location, ip: IPv4Interface | None, report: Report) -> None:
    """Whether an address is one that a station can have."""
    if ip is None:
        return
    first, last = hosts_of(ip.network)
    if not first <= int(ip) <= last:
        report(at, f"{ip.ip} is the network's or the broadcast address of {ip.network}", _hosts(first, last))


def check_controller_host(ip: IPv4Interface | None, groups: Iterable[tuple[str, IpDrives]], report: Report) -> None:
    """Whether a controller has an address that a station can have, and reaches each group, given with its label."""
    if ip is None:
        return
    at: Location = ("controller", "ip")
    check_host(at, ip, report)
    for label, group in groups:
        if group.ip is not None and group.gateway is None and group.ip.ip not in ip.network:
            what = f"{ip} cannot reach {label}, {group.ip}, which has no gateway"
            report(at, what, f"an address in {group.ip.network}")


def _hosts(first: int, last: int) -> str:
    return f"{IPv4Address(first)} to {IPv4Address(last)}"
