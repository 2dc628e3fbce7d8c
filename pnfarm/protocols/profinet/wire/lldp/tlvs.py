"""What an LLDPDU is made of: identifiers and TLVs (IEEE 802.1AB-2016 clause 8; IEC 61158-6-10, LLDP).

PROFINET has TLVs of its own organisation (00-0E-CF) and requires the MAC/PHY status of IEEE 802.3 (00-12-0F).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, TypeAlias
from uuid import UUID

from pnfarm.errors import DecodeError
from pnfarm.wire.octets import Reader, Writer

if TYPE_CHECKING:
    from collections.abc import Callable
    from ipaddress import IPv4Address

__all__ = [
    "LONGEST_TEXT",
    "MAU_100BASE_TX_FULL_DUPLEX",
    "OUI_IEEE_802_3",
    "OUI_PROFINET",
    "AddressFamily",
    "Capability",
    "ChassisId",
    "ChassisIdSubtype",
    "ChassisMac",
    "MacPhyStatus",
    "ManagementAddress",
    "MauTypeExtension",
    "MeasuredDelays",
    "MrpInterconnectionPortStatus",
    "MrpPortStatus",
    "PortAlias",
    "PortDescription",
    "PortId",
    "PortIdSubtype",
    "PortStatus",
    "ProfinetSubtype",
    "PtcpStatus",
    "RawTlv",
    "SystemCapabilities",
    "SystemDescription",
    "SystemName",
    "Tlv",
    "TlvType",
    "ipv4_management",
    "mac_management",
    "mac_name",
    "shape_tlv",
    "tlv_value",
]

OUI_PROFINET = bytes.fromhex("000ecf")
OUI_IEEE_802_3 = bytes.fromhex("00120f")
#: IEEE 802.3.1 (formerly IEEE 802.3-2018 annex 79): MAC/PHY configuration and status.
_SUBTYPE_MAC_PHY = 1
#: dot3MauType 16.
MAU_100BASE_TX_FULL_DUPLEX = 0x0010

#: Octets of a text, or of an identifier behind its subtype.
LONGEST_TEXT = 255


class TlvType(IntEnum):
    """IEEE 802.1AB-2016 table 8-1."""

    END = 0
    CHASSIS_ID = 1
    PORT_ID = 2
    TIME_TO_LIVE = 3
    PORT_DESCRIPTION = 4
    SYSTEM_NAME = 5
    SYSTEM_DESCRIPTION = 6
    SYSTEM_CAPABILITIES = 7
    MANAGEMENT_ADDRESS = 8
    ORGANIZATION = 127


class ChassisIdSubtype(IntEnum):
    """IEEE 802.1AB-2016 table 8-2."""

    CHASSIS_COMPONENT = 1
    INTERFACE_ALIAS = 2
    PORT_COMPONENT = 3
    MAC_ADDRESS = 4
    NETWORK_ADDRESS = 5
    INTERFACE_NAME = 6
    LOCAL = 7


class PortIdSubtype(IntEnum):
    """IEEE 802.1AB-2016 table 8-3."""

    INTERFACE_ALIAS = 1
    PORT_COMPONENT = 2
    MAC_ADDRESS = 3
    NETWORK_ADDRESS = 4
    INTERFACE_NAME = 5
    AGENT_CIRCUIT_ID = 6
    LOCAL = 7


class Capability(IntEnum):
    """Bits of IEEE 802.1AB-2016 table 8-4."""

    OTHER = 0x0001
    REPEATER = 0x0002
    BRIDGE = 0x0004
    WLAN_ACCESS_POINT = 0x0008
    ROUTER = 0x0010
    TELEPHONE = 0x0020
    DOCSIS = 0x0040
    STATION = 0x0080


class AddressFamily(IntEnum):
    """Subtype of a management address: IANA address family numbers."""

    IPV4 = 1
    MAC = 6


class ProfinetSubtype(IntEnum):
    """IEC 61158-6-10, coding of the field LLDP_PNIO_SubType."""

    DELAY = 1
    PORT_STATUS = 2
    ALIAS = 3
    MRP_PORT_STATUS = 4
    CHASSIS_MAC = 5
    PTCP_STATUS = 6
    MAU_TYPE_EXTENSION = 7
    MRP_IC_PORT_STATUS = 8


# -- TLVs ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class ChassisId:
    """``value`` has 1 to 255 octets."""

    subtype: int
    value: bytes

    @property
    def text(self) -> str:
        """As people read it: a MAC address with dashes, else the octets as text."""
        if self.subtype == ChassisIdSubtype.MAC_ADDRESS and len(self.value) == 6:
            return mac_name(self.value)
        return text_of(self.value)


@dataclass(frozen=True, slots=True)
class PortId:
    """``value`` has 1 to 255 octets."""

    subtype: int
    value: bytes

    @property
    def text(self) -> str:
        """As people read it: a MAC address with dashes, else the octets as text."""
        if self.subtype == PortIdSubtype.MAC_ADDRESS and len(self.value) == 6:
            return mac_name(self.value)
        return text_of(self.value)


@dataclass(frozen=True, slots=True)
class PortDescription:
    """Up to 255 octets, UTF-8."""

    value: bytes

    @property
    def text(self) -> str:
        return text_of(self.value)


@dataclass(frozen=True, slots=True)
class SystemName:
    """Up to 255 octets, UTF-8."""

    value: bytes

    @property
    def text(self) -> str:
        return text_of(self.value)


@dataclass(frozen=True, slots=True)
class SystemDescription:
    """Up to 255 octets, UTF-8."""

    value: bytes

    @property
    def text(self) -> str:
        return text_of(self.value)


@dataclass(frozen=True, slots=True)
class SystemCapabilities:
    """Bits of :class:`Capability`."""

    supported: int
    enabled: int


@dataclass(frozen=True, slots=True)
class ManagementAddress:
    """``address`` has 1 to 31 octets, ``oid`` up to 128 (ASN.1 BER contents)."""

    subtype: int
    address: bytes
    interface_subtype: int = 1
    interface_number: int = 0
    oid: bytes = b""


@dataclass(frozen=True, slots=True)
class MacPhyStatus:
    """``autonegotiation``: bit 0 supported, bit 1 enabled; ``advertised``: ifMauAutoNegCapAdvertisedBits;
    ``mau_type``: dot3MauType."""

    autonegotiation: int
    advertised: int
    mau_type: int


@dataclass(frozen=True, slots=True)
class MeasuredDelays:
    """LLDP_PNIO_DELAY, nanoseconds; 0 for not measured."""

    rx_local: int = 0
    rx_remote: int = 0
    tx_local: int = 0
    tx_remote: int = 0
    cable_local: int = 0


@dataclass(frozen=True, slots=True)
class PortStatus:
    """LLDP_PNIO_PORTSTATUS: RTClass2_PortStatus and RTClass3_PortStatus; 0 is off."""

    rtclass2: int = 0
    rtclass3: int = 0


@dataclass(frozen=True, slots=True)
class PortAlias:
    """LLDP_PNIO_ALIAS."""

    value: bytes


@dataclass(frozen=True, slots=True)
class MrpPortStatus:
    """LLDP_PNIO_MRPPORTSTATUS."""

    domain: UUID
    status: int


@dataclass(frozen=True, slots=True)
class ChassisMac:
    """LLDP_PNIO_CHASSIS_MAC: the MAC address of the interface that the port belongs to."""

    mac: bytes


@dataclass(frozen=True, slots=True)
class PtcpStatus:
    """LLDP_PNIO_PTCPSTATUS; the three periods have a valid bit (31) and a value in nanoseconds."""

    master: bytes
    subdomain: UUID
    ir_data: UUID
    length_of_period: int
    red_period_begin: int
    orange_period_begin: int
    green_period_begin: int


@dataclass(frozen=True, slots=True)
class MauTypeExtension:
    """LLDP_PNIO_MAUTypeExtension: which kind of fibre or pair carries the MAU type."""

    extension: int


@dataclass(frozen=True, slots=True)
class MrpInterconnectionPortStatus:
    """LLDP_PNIO_MRPICPORTSTATUS."""

    domain_id: int
    role: int
    interconnection_id: int


@dataclass(frozen=True, slots=True)
class RawTlv:
    """Any other TLV, and one whose value does not have its type's shape."""

    tlv_type: int
    value: bytes


Tlv: TypeAlias = (
    PortDescription
    | SystemName
    | SystemDescription
    | SystemCapabilities
    | ManagementAddress
    | MacPhyStatus
    | MeasuredDelays
    | PortStatus
    | PortAlias
    | MrpPortStatus
    | ChassisMac
    | PtcpStatus
    | MauTypeExtension
    | MrpInterconnectionPortStatus
    | RawTlv
)


# -- parse -----------------------------------------------------------------------------------------------------------


def shape_tlv(kind: int, value: bytes) -> Tlv:
    """The TLV behind the first three; one whose value does not have its type's shape stays raw."""
    parser = _PARSERS.get((kind, b"", 0))
    body = value
    if kind == TlvType.ORGANIZATION and len(value) >= 4:
        parser = _PARSERS.get((kind, value[:3], value[3]))
        body = value[4:]
    if parser is None:
        return RawTlv(kind, value)
    reader = Reader(body)
    try:
        tlv = parser(reader)
        reader.expect_end()
    except DecodeError:
        return RawTlv(kind, value)
    return tlv


def _read_management(r: Reader) -> Tlv:
    length = r.u8()
    if not 2 <= length <= 32:
        raise DecodeError("bad-length")
    subtype, address = r.u8(), r.bytes(length - 1)
    interface_subtype, number, size = r.u8(), r.u32(), r.u8()
    if size > 128:
        raise DecodeError("bad-length")
    return ManagementAddress(subtype, address, interface_subtype, number, r.bytes(size))


def _read_text(kind: Callable[[bytes], Tlv]) -> Callable[[Reader], Tlv]:
    def read(r: Reader) -> Tlv:
        if r.remaining > LONGEST_TEXT:
            raise DecodeError("bad-length")
        return kind(r.rest())

    return read


def _read_uuid(r: Reader) -> UUID:
    return UUID(bytes=r.bytes(16))


_PARSERS: dict[tuple[int, bytes, int], Callable[[Reader], Tlv]] = {
    (TlvType.PORT_DESCRIPTION, b"", 0): _read_text(PortDescription),
    (TlvType.SYSTEM_NAME, b"", 0): _read_text(SystemName),
    (TlvType.SYSTEM_DESCRIPTION, b"", 0): _read_text(SystemDescription),
    (TlvType.SYSTEM_CAPABILITIES, b"", 0): lambda r: SystemCapabilities(r.u16(), r.u16()),
    (TlvType.MANAGEMENT_ADDRESS, b"", 0): _read_management,
    (TlvType.ORGANIZATION, OUI_IEEE_802_3, _SUBTYPE_MAC_PHY): lambda r: MacPhyStatus(r.u8(), r.u16(), r.u16()),
    (TlvType.ORGANIZATION, OUI_PROFINET, ProfinetSubtype.DELAY): lambda r: MeasuredDelays(
        r.u32(), r.u32(), r.u32(), r.u32(), r.u32()
    ),
    (TlvType.ORGANIZATION, OUI_PROFINET, ProfinetSubtype.PORT_STATUS): lambda r: PortStatus(r.u16(), r.u16()),
    (TlvType.ORGANIZATION, OUI_PROFINET, ProfinetSubtype.ALIAS): lambda r: PortAlias(r.rest()),
    (TlvType.ORGANIZATION, OUI_PROFINET, ProfinetSubtype.MRP_PORT_STATUS): lambda r: MrpPortStatus(
        _read_uuid(r), r.u16()
    ),
    (TlvType.ORGANIZATION, OUI_PROFINET, ProfinetSubtype.CHASSIS_MAC): lambda r: ChassisMac(r.bytes(6)),
    (TlvType.ORGANIZATION, OUI_PROFINET, ProfinetSubtype.PTCP_STATUS): lambda r: PtcpStatus(
        r.bytes(6), _read_uuid(r), _read_uuid(r), r.u32(), r.u32(), r.u32(), r.u32()
    ),
    (TlvType.ORGANIZATION, OUI_PROFINET, ProfinetSubtype.MAU_TYPE_EXTENSION): lambda r: MauTypeExtension(r.u16()),
    (TlvType.ORGANIZATION, OUI_PROFINET, ProfinetSubtype.MRP_IC_PORT_STATUS): lambda r: MrpInterconnectionPortStatus(
        r.u16(), r.u16(), r.u16()
    ),
}


# -- emit ------------------------------------------------------------------------------------------------------------


def tlv_value(tlv: Tlv) -> tuple[int, bytes]:
    """Type and value of a TLV."""
    w = Writer()
    match tlv:
        case RawTlv(kind, value):
            if kind <= TlvType.TIME_TO_LIVE:
                raise ValueError(f"TLV {kind} has its place at the beginning or the end")
            return kind, value
        case PortDescription(value):
            return TlvType.PORT_DESCRIPTION, _bounded(value)
        case SystemName(value):
            return TlvType.SYSTEM_NAME, _bounded(value)
        case SystemDescription(value):
            return TlvType.SYSTEM_DESCRIPTION, _bounded(value)
        case SystemCapabilities(supported, enabled):
            return TlvType.SYSTEM_CAPABILITIES, w.u16(supported).u16(enabled).getvalue()
        case ManagementAddress():
            return TlvType.MANAGEMENT_ADDRESS, _management_value(tlv)
        case MacPhyStatus(autonegotiation, advertised, mau_type):
            w.bytes(OUI_IEEE_802_3).u8(_SUBTYPE_MAC_PHY).u8(autonegotiation).u16(advertised).u16(mau_type)
        case MeasuredDelays(a, b, c, d, e):
            _profinet(w, ProfinetSubtype.DELAY).u32(a).u32(b).u32(c).u32(d).u32(e)
        case PortStatus(rtclass2, rtclass3):
            _profinet(w, ProfinetSubtype.PORT_STATUS).u16(rtclass2).u16(rtclass3)
        case PortAlias(value):
            _profinet(w, ProfinetSubtype.ALIAS).bytes(value)
        case MrpPortStatus(domain, status):
            _profinet(w, ProfinetSubtype.MRP_PORT_STATUS).bytes(domain.bytes).u16(status)
        case ChassisMac(mac):
            _profinet(w, ProfinetSubtype.CHASSIS_MAC).bytes(_mac(mac))
        case PtcpStatus(master, subdomain, ir_data, length, red, orange, green):
            _profinet(w, ProfinetSubtype.PTCP_STATUS).bytes(_mac(master)).bytes(subdomain.bytes).bytes(ir_data.bytes)
            w.u32(length).u32(red).u32(orange).u32(green)
        case MauTypeExtension(extension):
            _profinet(w, ProfinetSubtype.MAU_TYPE_EXTENSION).u16(extension)
        case MrpInterconnectionPortStatus(domain_id, role, interconnection_id):
            _profinet(w, ProfinetSubtype.MRP_IC_PORT_STATUS).u16(domain_id).u16(role).u16(interconnection_id)
    return TlvType.ORGANIZATION, w.getvalue()


def _profinet(writer: Writer, subtype: ProfinetSubtype) -> Writer:
    return writer.bytes(OUI_PROFINET).u8(subtype)


def _management_value(tlv: ManagementAddress) -> bytes:
    if not (1 <= len(tlv.address) <= 31 and len(tlv.oid) <= 128):
        raise ValueError("a management address has 1 to 31 octets, its object identifier up to 128")
    w = Writer().u8(len(tlv.address) + 1).u8(tlv.subtype).bytes(tlv.address)
    return w.u8(tlv.interface_subtype).u32(tlv.interface_number).u8(len(tlv.oid)).bytes(tlv.oid).getvalue()


def _bounded(value: bytes) -> bytes:
    if len(value) > LONGEST_TEXT:
        raise ValueError(f"a text of {len(value)} octets: {LONGEST_TEXT} fit")
    return value


def _mac(value: bytes) -> bytes:
    if len(value) != 6:
        raise ValueError("a MAC address has six octets")
    return value


# -- texts and addresses ---------------------------------------------------------------------------------------------


def text_of(value: bytes) -> str:
    """UTF-8 without trailing zeros; invalid UTF-8 is replaced."""
    return value.rstrip(b"\0").decode("utf-8", "replace")


def mac_name(mac: bytes) -> str:
    """How PROFINET writes a MAC address where a name belongs: ``00-0E-CF-12-34-56`` (IEC 61158-6-10, LLDP)."""
    return mac.hex("-").upper()


def ipv4_management(address: IPv4Address, interface_number: int) -> ManagementAddress:
    """The address by which SNMP reaches the sender; interface numbering by ifIndex."""
    return ManagementAddress(AddressFamily.IPV4, address.packed, 2, interface_number)


def mac_management(mac: bytes, interface_number: int) -> ManagementAddress:
    """For a sender without an IP address (IEEE 802.1AB-2016 8.5.9.4)."""
    return ManagementAddress(AddressFamily.MAC, mac, 2, interface_number)
