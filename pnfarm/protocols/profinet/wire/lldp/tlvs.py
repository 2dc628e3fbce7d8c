"""What an LLDPDU is made of: identifiers and TLVs (IEEE 802.1AB-2016 clause 8; IEC 61158-6-10, LLDP).

PROFINET has TLVs of its own organisation (00-0E-CF) and requires the MAC/PHY status of IEEE 802.3 (00-12-0F).
"""

from collections.abc import Mapping
from contextlib import suppress
from enum import IntEnum
from ipaddress import IPv4Address
from typing import Annotated, Any, ClassVar, Self

from pnfarm.errors import DecodeError
from pnfarm.wire.layout import Mac, Octets8, Outside, Rest, RestBut, Structure, UInt8, UInt16, UInt32, Uuid
from pnfarm.wire.octets import Reader, Writer

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

#: Octets of a text, or of an identifier after its subtype.
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


class Tlv(Structure):
    """A TLV by its value, after organisation and subtype in those of an organisation."""

    #: Type, and the octets that a value of this kind begins with.
    KIND: ClassVar[tuple[int, bytes]]
    KINDS: ClassVar[dict[tuple[int, bytes], type["Tlv"]]] = {}

    def __init_subclass__(
        cls, *, tlv: int = 0, prefix: bytes = b"", profinet: ProfinetSubtype | None = None, **more: Any
    ) -> None:
        super().__init_subclass__(**more)
        if profinet is not None:
            prefix = OUI_PROFINET + bytes((profinet,))
        if tlv or prefix:
            cls.KIND = tlv or TlvType.ORGANIZATION, prefix
            cls.KINDS[cls.KIND] = cls


class _BoundedText(RestBut):
    """Up to 255 octets."""

    def read(self, r: Reader, values: Mapping[str, Any]) -> bytes:
        if r.remaining > LONGEST_TEXT:
            raise DecodeError("bad-length")
        return super().read(r, values)

    def write(self, w: Writer, value: bytes) -> None:
        if len(value) > LONGEST_TEXT:
            raise ValueError(f"a text of {len(value)} octets: {LONGEST_TEXT} fit")
        super().write(w, value)


class _TextTlv(Tlv):
    """Up to 255 octets, UTF-8."""

    value: Annotated[bytes, _BoundedText(0)]

    @property
    def text(self) -> str:
        return text_of(self.value)


class _Identifier(Structure):
    """``value`` has 1 to 255 octets."""

    MAC: ClassVar[int]
    subtype: UInt8
    value: Rest

    def __init_subclass__(cls, *, mac_subtype: int, **more: Any) -> None:
        super().__init_subclass__(**more)
        cls.MAC = mac_subtype

    @property
    def text(self) -> str:
        """As people read it: a MAC address with dashes, else the octets as text."""
        return mac_name(self.value) if self.subtype == self.MAC and len(self.value) == 6 else text_of(self.value)


class ChassisId(_Identifier, mac_subtype=ChassisIdSubtype.MAC_ADDRESS):
    """What names the sender."""


class PortId(_Identifier, mac_subtype=PortIdSubtype.MAC_ADDRESS):
    """What names the sender's port."""


class PortDescription(_TextTlv, tlv=TlvType.PORT_DESCRIPTION):
    """Of the sender's port."""


class SystemName(_TextTlv, tlv=TlvType.SYSTEM_NAME):
    """Of the sender."""


class SystemDescription(_TextTlv, tlv=TlvType.SYSTEM_DESCRIPTION):
    """Of the sender."""


class SystemCapabilities(Tlv, tlv=TlvType.SYSTEM_CAPABILITIES):
    """Bits of :class:`Capability`."""

    supported: UInt16
    enabled: UInt16


class ManagementAddress(Tlv, tlv=TlvType.MANAGEMENT_ADDRESS):
    """``address`` has 1 to 31 octets, ``oid`` up to 128 (ASN.1 BER contents)."""

    subtype: Outside[int]
    address: Outside[bytes]
    interface_subtype: UInt8 = 1
    interface_number: UInt32 = 0
    oid: Octets8 = b""

    @classmethod
    def read(cls, r: Reader, **_outside: Any) -> Self:
        length = r.u8()
        if not 2 <= length <= 32:
            raise DecodeError("bad-length")
        value = super().read(r, subtype=r.u8(), address=r.bytes(length - 1))
        if len(value.oid) > 128:
            raise DecodeError("bad-length")
        return value

    def write(self, w: Writer) -> None:
        if not (1 <= len(self.address) <= 31 and len(self.oid) <= 128):
            raise ValueError("a management address has 1 to 31 octets, its object identifier up to 128")
        super().write(w.u8(len(self.address) + 1).u8(self.subtype).bytes(self.address))


class MacPhyStatus(Tlv, prefix=OUI_IEEE_802_3 + bytes((_SUBTYPE_MAC_PHY,))):
    """``autonegotiation``: bit 0 supported, bit 1 enabled; ``advertised``: ifMauAutoNegCapAdvertisedBits;
    ``mau_type``: dot3MauType."""

    autonegotiation: UInt8
    advertised: UInt16
    mau_type: UInt16


class MeasuredDelays(Tlv, profinet=ProfinetSubtype.DELAY):
    """LLDP_PNIO_DELAY, nanoseconds; 0 for not measured."""

    rx_local: UInt32 = 0
    rx_remote: UInt32 = 0
    tx_local: UInt32 = 0
    tx_remote: UInt32 = 0
    cable_local: UInt32 = 0


class PortStatus(Tlv, profinet=ProfinetSubtype.PORT_STATUS):
    """LLDP_PNIO_PORTSTATUS: RTClass2_PortStatus and RTClass3_PortStatus; 0 is off."""

    rtclass2: UInt16 = 0
    rtclass3: UInt16 = 0


class PortAlias(Tlv, profinet=ProfinetSubtype.ALIAS):
    """LLDP_PNIO_ALIAS."""

    value: Rest


class MrpPortStatus(Tlv, profinet=ProfinetSubtype.MRP_PORT_STATUS):
    """LLDP_PNIO_MRPPORTSTATUS."""

    domain: Uuid
    status: UInt16


class ChassisMac(Tlv, profinet=ProfinetSubtype.CHASSIS_MAC):
    """LLDP_PNIO_CHASSIS_MAC: the MAC address of the interface that the port belongs to."""

    mac: Mac


class PtcpStatus(Tlv, profinet=ProfinetSubtype.PTCP_STATUS):
    """LLDP_PNIO_PTCPSTATUS; the three periods have a valid bit (31) and a value in nanoseconds."""

    master: Mac
    subdomain: Uuid
    ir_data: Uuid
    length_of_period: UInt32
    red_period_begin: UInt32
    orange_period_begin: UInt32
    green_period_begin: UInt32


class MauTypeExtension(Tlv, profinet=ProfinetSubtype.MAU_TYPE_EXTENSION):
    """LLDP_PNIO_MAUTypeExtension: which kind of fibre or pair carries the MAU type."""

    extension: UInt16


class MrpInterconnectionPortStatus(Tlv, profinet=ProfinetSubtype.MRP_IC_PORT_STATUS):
    """LLDP_PNIO_MRPICPORTSTATUS."""

    domain_id: UInt16
    role: UInt16
    interconnection_id: UInt16


class RawTlv(Tlv):
    """Any other TLV, and one whose value does not have its type's shape."""

    tlv_type: Outside[int]
    value: Rest


def shape_tlv(kind: int, value: bytes) -> Tlv:
    """The TLV after the first three; one whose value does not have its type's shape stays raw."""
    prefix = value[:4] if kind == TlvType.ORGANIZATION and len(value) >= 4 else b""
    if (shape := Tlv.KINDS.get((kind, prefix))) is not None:
        with suppress(DecodeError):
            return shape.parse(value[len(prefix) :])
    return RawTlv(kind, value)


def tlv_value(tlv: Tlv) -> tuple[int, bytes]:
    """Type and value of a TLV."""
    if not isinstance(tlv, RawTlv):
        return tlv.KIND[0], tlv.KIND[1] + tlv.emit()
    if tlv.tlv_type <= TlvType.TIME_TO_LIVE:
        raise ValueError(f"TLV {tlv.tlv_type} has its place at the beginning or the end")
    return tlv.tlv_type, tlv.value


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
