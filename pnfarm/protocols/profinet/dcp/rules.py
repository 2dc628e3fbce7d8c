"""DCP of a device apart from its state machine: identity, events, rules and tables.

Sources: IEC 61158-6-10 (DCP; CMINA, the device's name and address), IEC 61158-5-10 (6.3.11, the services).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum, StrEnum
from ipaddress import IPv4Address, IPv4Interface
from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.wire.dcp.blocks import ResetMode
from pnfarm.protocols.profinet.wire.dcp.pdu import MAXIMUM_DELAY_FACTOR

if TYPE_CHECKING:
    from pnfarm.protocols.profinet.errors import RtaError

__all__ = [
    "NO_DNS",
    "RESET_CLEARS",
    "RESET_MODES",
    "AbortRequired",
    "DcpDeviceEvent",
    "DcpIdentity",
    "Dns",
    "FactoryReset",
    "HelloMode",
    "HelloSettings",
    "IpSet",
    "NameSet",
    "SignalBegan",
    "SignalEnded",
    "Stored",
    "check_ip_suite",
    "response_delay_ns",
    "router_of",
]

#: Unit of the response delay (IEC 61158-6-10, 4.3.1.3.5).
DELAY_STEP_NS = 10**7

#: Four name servers, 0.0.0.0 for none.
Dns = tuple[IPv4Address, ...]

_NONE = IPv4Address(0)
NO_DNS: Dns = (_NONE, _NONE, _NONE, _NONE)


# -- what a reset clears -----------------------------------------------------------------------------------------------


class Stored(StrEnum):
    """Kinds of data that a device keeps over a power cycle."""

    APPLICATION = "application"  # the drive's parameters
    IDENTIFICATION = "identification"  # what users wrote into I&M1 to I&M4
    COMMUNICATION = "communication"  # name and IP suite
    INTERFACE = "interface"  # records of interface and ports, Hello among them
    MANAGEMENT = "management"  # what SNMP managers wrote


_EVERYTHING = frozenset(Stored)

#: IEC 61158-5-10, 6.3.11.3.2.  The data of SNMP goes with every mode, as PI's conformance tests require; a drive
#: keeps no engineering data.
RESET_CLEARS: dict[ResetMode, frozenset[Stored]] = {
    ResetMode.APPLICATION: frozenset({Stored.APPLICATION, Stored.IDENTIFICATION, Stored.MANAGEMENT}),
    ResetMode.COMMUNICATION: frozenset({Stored.COMMUNICATION, Stored.INTERFACE, Stored.MANAGEMENT}),
    ResetMode.ENGINEERING: frozenset({Stored.MANAGEMENT}),
    ResetMode.ALL: _EVERYTHING,
    ResetMode.DEVICE: _EVERYTHING,
    ResetMode.DEVICE_AND_RESTORE: _EVERYTHING,
}
#: Modes that a drive has.  It keeps no engineering data and no older firmware, so modes 3 and 9 are not among them.
RESET_MODES = frozenset({ResetMode.APPLICATION, ResetMode.COMMUNICATION, ResetMode.ALL, ResetMode.DEVICE})
#: Modes after which the device restarts.
REBOOTS = frozenset({ResetMode.DEVICE, ResetMode.DEVICE_AND_RESTORE})


# -- Hello -------------------------------------------------------------------------------------------------------------


class HelloMode(IntEnum):
    """Coding of the field FSHelloMode."""

    OFF = 0
    ON_LINK_UP = 1
    ON_LINK_UP_DELAYED = 2


@dataclass(frozen=True, slots=True)
class HelloSettings:
    """When a device sends Hello; the defaults are those of the standard's fast start-up.

    ``count`` frames (FSHelloRetry), ``interval_ns`` apart; in the delayed mode the first waits for ``delay_ns``.
    """

    mode: HelloMode = HelloMode.ON_LINK_UP
    interval_ns: int = 30_000_000
    count: int = 3
    delay_ns: int = 0

    @property
    def first_ns(self) -> int:
        """From link-up to the first Hello."""
        return self.delay_ns if self.mode is HelloMode.ON_LINK_UP_DELAYED else 0


# -- identity and events -----------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class DcpIdentity:
    """What never changes about a device."""

    station_type: str
    vendor_id: int
    device_id: int
    instance: tuple[int, int] = (0, 1)
    role: int = 1
    oem: tuple[int, int] | None = None


@dataclass(frozen=True, slots=True)
class NameSet:
    """The station name became ``name`` ("": none); a temporary one also deletes the stored one."""

    name: str
    permanent: bool


@dataclass(frozen=True, slots=True)
class IpSet:
    """The address became ``interface`` (None: none); a temporary one also deletes the stored one."""

    interface: IPv4Interface | None
    gateway: IPv4Address | None
    permanent: bool
    dns: Dns = NO_DNS


@dataclass(frozen=True, slots=True)
class SignalBegan:
    """The lamp flashes: 1 Hz, three seconds after the last request."""


@dataclass(frozen=True, slots=True)
class SignalEnded:
    """The lamp is as it was."""


@dataclass(frozen=True, slots=True)
class AbortRequired:
    """Every AR has to end with this error: the name or address that it was set up with is gone."""

    reason: RtaError


@dataclass(frozen=True, slots=True)
class FactoryReset:
    """A reset was ordered: ``clears`` is to be forgotten now, and the device restarted if ``reboots``.

    Name and address have events of their own.
    """

    mode: ResetMode
    clears: frozenset[Stored]

    @property
    def reboots(self) -> bool:
        """Whether the device restarts once it has answered."""
        return self.mode in REBOOTS


DcpDeviceEvent = NameSet | IpSet | SignalBegan | SignalEnded | AbortRequired | FactoryReset


# -- rules -------------------------------------------------------------------------------------------------------------


def response_delay_ns(mac: bytes, factor: int) -> int:
    """How long a device with this MAC address waits before it answers an Identify (IEC 61158-6-10, 4.3.1.3.5).

    The last two octets of the address mod ``factor``, times 10 ms; factors 0 and above 6400 are reserved: at once.
    """
    if not 0 < factor <= MAXIMUM_DELAY_FACTOR:
        return 0
    return int.from_bytes(mac[4:6], "big") % factor * DELAY_STEP_NS


def router_of(address: IPv4Interface | None, gateway: IPv4Address | None) -> IPv4Address | None:
    """The router that a gateway means: the own address stands for none, as no gateway does."""
    return None if address is not None and gateway == address.ip else gateway


def check_ip_suite(address: IPv4Address, mask: IPv4Address, gateway: IPv4Address) -> str | None:
    """What is wrong with an IP parameter block, as a sentence, or None (IEC 61158-6-10, 4.3.1.4.21).

    All three 0.0.0.0 are valid: no address.  The gateway is 0.0.0.0 or the own address for none.
    """
    host_mask = ~int(mask) & 0xFFFF_FFFF
    if host_mask & (host_mask + 1):
        return f"the mask {mask} has a gap"
    if address == _NONE:
        return None if mask == gateway == _NONE else "mask and gateway need an address"
    if address.packed[0] in {0, 127} or address.packed[0] >= 224:
        return f"{address} is not an address for a device"
    if int(address) & host_mask in {0, host_mask}:
        return f"{address} with mask {mask} is a network's or a broadcast address"
    if gateway != _NONE and (int(gateway) ^ int(address)) & int(mask):
        return f"the gateway {gateway} lies outside of the subnet of {address}"
    return None
