"""The items with which a device answers ListIdentity and ListServices (CIP volume 2, tables 2-4.4 and 2-4.3)."""

from __future__ import annotations

from dataclasses import dataclass
from ipaddress import IPv4Address
from typing import Final

from pnfarm.wire.octets import Reader, Writer

__all__ = ["CIP_OVER_TCP", "CIP_OVER_UDP", "COMMUNICATIONS", "IdentityItem", "ServiceItem"]

#: Capability flags of the service Communications: explicit messages over TCP, class 0 and 1 over UDP.
CIP_OVER_TCP: Final = 0x0020
CIP_OVER_UDP: Final = 0x0100
COMMUNICATIONS: Final = b"Communications\0\0"


@dataclass(frozen=True, slots=True)
class IdentityItem:
    """Who a device is: its socket address, and attributes 1 to 8 of its Identity object.

    ``revision`` is major and minor, ``status`` the 16 bits of attribute 5, ``state`` attribute 8 (255: not there).
    ``name`` are octets, at most 255 (ISO 8859-1).
    """

    address: IPv4Address
    vendor_id: int
    device_type: int
    product_code: int
    revision: tuple[int, int]
    status: int
    serial: int
    name: bytes
    state: int
    port: int = 44818
    version: int = 1
    family: int = 2

    @classmethod
    def parse(cls, r: Reader) -> IdentityItem:
        """Raises ``short``."""
        version, family, port, address = r.u16le(), r.u16(), r.u16(), IPv4Address(r.u32())
        r.skip(8)
        vendor, device_type, product = r.u16le(), r.u16le(), r.u16le()
        revision, status, serial = (r.u8(), r.u8()), r.u16le(), r.u32le()
        name, state = r.bytes(r.u8()), r.u8()
        return cls(address, vendor, device_type, product, revision, status, serial, name, state, port, version, family)

    def emit(self) -> bytes:
        w = Writer().u16le(self.version).u16(self.family).u16(self.port).u32(int(self.address)).zeros(8)
        w.u16le(self.vendor_id).u16le(self.device_type).u16le(self.product_code)
        w.u8(self.revision[0]).u8(self.revision[1]).u16le(self.status).u32le(self.serial)
        return w.u8(len(self.name)).bytes(self.name).u8(self.state).getvalue()


@dataclass(frozen=True, slots=True)
class ServiceItem:
    """A service that the device offers over the encapsulation; ``name`` has 16 octets, padded with zeros."""

    capabilities: int = CIP_OVER_TCP | CIP_OVER_UDP
    version: int = 1
    name: bytes = COMMUNICATIONS

    @classmethod
    def parse(cls, r: Reader) -> ServiceItem:
        """Raises ``short``."""
        version, capabilities = r.u16le(), r.u16le()
        return cls(capabilities, version, r.bytes(16))

    def emit(self) -> bytes:
        if len(self.name) != len(COMMUNICATIONS):
            raise ValueError(f"the name of a service has 16 octets, not {len(self.name)}")
        return Writer().u16le(self.version).u16le(self.capabilities).bytes(self.name).getvalue()
