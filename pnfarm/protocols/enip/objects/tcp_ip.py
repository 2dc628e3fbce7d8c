"""TCP/IP Interface object, class 0xF5 (CIP volume 2, chapter 5-4)."""

from __future__ import annotations

from collections.abc import Callable  # noqa: TC003 - fields of a dataclass
from dataclasses import dataclass, field
from ipaddress import IPv4Address, IPv4Interface
from typing import Final

from pnfarm.protocols.enip.object import Attribute, AttributeObject
from pnfarm.protocols.enip.objects.identity import class_attributes
from pnfarm.protocols.enip.status import GeneralStatus
from pnfarm.protocols.enip.wire.data_types import BOOL, DWORD, UINT, USINT, Value
from pnfarm.protocols.enip.wire.epath import emit_epath, logical_path
from pnfarm.wire.octets import Writer

__all__ = ["ETHERNET_LINK", "TCP_IP", "TcpIpData", "multicast_address", "tcp_ip_object"]

TCP_IP: Final = 0xF5
ETHERNET_LINK: Final = 0xF6
#: Multicast addresses by the standard's algorithm: 32 for each host, from here (CIP volume 2, 3-5.3).
_FIRST_MULTICAST: Final = IPv4Address("239.192.1.0")
_HOSTS_MASK: Final = 0x3FF
_LAST_CONFLICT_OCTETS: Final = 1 + 6 + 28
_LONGEST_TIMEOUT_S: Final = 3600


def multicast_address(interface: IPv4Interface) -> IPv4Address:
    """The first address on which a device with this address produces."""
    host = int(interface.ip) & int(interface.hostmask)
    return _FIRST_MULTICAST + (((host - 1) & _HOSTS_MASK) << 5)


@dataclass(slots=True)
class TcpIpData:
    """``status`` 1 says that attribute 5 is valid; ``capability`` bit 4: hard-wired, bit 7: conflict detection.

    ``last_conflict`` is attribute 11: activity, MAC, ARP PDU.  ``inactivity_timeout_s`` 0 is none.  ``changed`` hears
    of every write, and says whether it could be stored.
    """

    interface: IPv4Interface
    gateway: IPv4Address = IPv4Address(0)  # noqa: RUF009 - a value that does not change
    host_name: str = ""
    status: int = 1
    capability: int = 0x80
    control: int = 0
    ttl: int = 1
    conflict_detection: bool = True
    last_conflict: bytes = bytes(_LAST_CONFLICT_OCTETS)
    inactivity_timeout_s: int = 120
    changed: Callable[[], bool] = field(default=lambda: True, repr=False)

    def configuration(self) -> bytes:
        """Attribute 5: address, mask, gateway, two name servers, domain name."""
        w = Writer(little=True).u32(int(self.interface.ip)).u32(int(self.interface.netmask)).u32(int(self.gateway))
        return w.u32(0).u32(0).u16(0).getvalue()

    def multicast(self) -> bytes:
        """Attribute 9: the default allocation, one address, the first of them."""
        return Writer(little=True).u8(0).u8(0).u16(1).u32(int(multicast_address(self.interface))).getvalue()

    def link(self) -> bytes:
        path = emit_epath(logical_path(ETHERNET_LINK, 1))
        return Writer(little=True).u16(len(path) // 2).bytes(path).getvalue()

    def host_name_octets(self) -> bytes:
        """A STRING, padded to whole words."""
        name = self.host_name.encode("latin-1", "replace")[:64]
        return Writer(little=True).u16(len(name)).bytes(name).zeros(len(name) % 2).getvalue()


def tcp_ip_object(data: TcpIpData, timeout_written: Callable[[int], None]) -> AttributeObject:
    """Written are attributes 10 (conflict detection) and 13 (inactivity timeout, seconds), which acts at once."""

    def set_conflict_detection(value: Value) -> int:
        before, data.conflict_detection = data.conflict_detection, bool(value)
        if not data.changed():
            data.conflict_detection = before
            return GeneralStatus.STORE_OPERATION_FAILURE
        return GeneralStatus.SUCCESS

    def set_inactivity_timeout(value: Value) -> int:
        assert isinstance(value, int)
        if not 0 <= value <= _LONGEST_TIMEOUT_S:
            return GeneralStatus.INVALID_ATTRIBUTE_VALUE
        before, data.inactivity_timeout_s = data.inactivity_timeout_s, value
        if not data.changed():
            data.inactivity_timeout_s = before
            return GeneralStatus.STORE_OPERATION_FAILURE
        timeout_written(value)
        return GeneralStatus.SUCCESS

    attributes = {
        1: Attribute(DWORD, lambda: data.status),
        2: Attribute(DWORD, lambda: data.capability),
        3: Attribute(DWORD, lambda: data.control),
        4: Attribute(None, data.link),
        5: Attribute(None, data.configuration),
        6: Attribute(None, data.host_name_octets),
        8: Attribute(USINT, lambda: data.ttl),
        9: Attribute(None, data.multicast),
        10: Attribute(BOOL, lambda: data.conflict_detection, set_conflict_detection),
        11: Attribute(None, lambda: data.last_conflict),
        13: Attribute(UINT, lambda: data.inactivity_timeout_s, set_inactivity_timeout),
    }
    return AttributeObject(TCP_IP, {0: class_attributes(4), 1: attributes}, {1: (1, 2, 3, 4, 5, 6)})
