"""The format of each value in a drive's non-volatile memory, checked before a drive boots with it.

A memory in another format was written by another program, or by hand.  It is refused as a whole and left unchanged: a
drive that booted with half of it would overwrite the other half with its next save.  Unknown keys are kept unchanged.
"""

from __future__ import annotations

from ipaddress import AddressValueError, IPv4Address, IPv4Interface, NetmaskValueError
from typing import TYPE_CHECKING, Any

from pnfarm.protocols.profinet.dcp.rules import check_ip_suite
from pnfarm.protocols.profinet.records.pdev import MOST_OCTETS
from pnfarm.protocols.profinet.snmp.view import SystemText
from pnfarm.protocols.profinet.wire.names import check_station_name
from pnfarm.station.kept_values import FAULTS, Shape, check_shapes, drive_shape, is_address, is_number

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["check_kept"]

_U16, _U32 = 0xFFFF, 0xFFFF_FFFF
#: Characters of a text that a manager writes.
_MOST_TEXT = 255
#: Parts of a record's key: slot, subslot, index.
_RECORD_PARTS = 3
#: DNS servers of DCP's full IP suite; FSHelloMode, interval, retry and delay.
_DNS_SERVERS, _HELLO_PARTS = 4, 4


def _is_own_address(value: Any) -> bool:
    if value == "":
        return True
    try:
        interface = IPv4Interface(value) if isinstance(value, str) else None
    except (AddressValueError, NetmaskValueError, ValueError):
        return False
    return interface is not None and check_ip_suite(interface.ip, interface.netmask, IPv4Address(0)) is None


def _is_name(value: Any) -> bool:
    return isinstance(value, str) and (value == "" or check_station_name(value) is None)


def _is_records(value: Any) -> bool:
    return isinstance(value, dict) and all(
        isinstance(key, str) and _is_record_key(key) and isinstance(data, bytes) and len(data) <= MOST_OCTETS
        for key, data in value.items()
    )


def _is_record_key(key: str) -> bool:
    parts = key.split(".")
    return len(parts) == _RECORD_PARTS and all(
        part.isascii() and part.isdigit() and len(part) <= len(str(_U16)) and int(part) <= _U16 for part in parts
    )


#: Key of the memory -> its check, and a description of the value.
_SHAPES: Mapping[str, Shape] = {
    "name": (_is_name, "a station name, or an empty text"),
    "ip": (_is_own_address, "an address such as 10.77.0.11/24, or an empty text"),
    "gateway": (lambda value: value == "" or is_address(value), "an address such as 10.77.0.1, or an empty text"),
    "dns": (
        lambda value: isinstance(value, list) and len(value) == _DNS_SERVERS and all(map(is_address, value)),
        "four addresses",
    ),
    "hello": (
        lambda value: (
            isinstance(value, list) and len(value) == _HELLO_PARTS and all(is_number(part, _U32) for part in value)
        ),
        "four numbers: mode, interval, retries and delay",
    ),
    "im": (_is_records, "octets by slot.subslot.index"),
    "pdev": (_is_records, "octets by slot.subslot.index"),
    "snmp": (
        lambda value: (
            isinstance(value, dict)
            and value.keys() <= SystemText.__members__.keys()
            and all(isinstance(text, str) and len(text) <= _MOST_TEXT for text in value.values())
        ),
        "texts by " + ", ".join(SystemText.__members__),
    ),
    "faults": FAULTS,
    "drive": drive_shape(octets=4),
}


def check_kept(values: Mapping[str, Any]) -> None:
    """Raises :class:`KeptValueError` that names the first key with a wrong value, and that value."""
    check_shapes(values, _SHAPES)
