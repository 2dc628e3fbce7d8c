"""Ethernet Link object, class 0xF6 (CIP volume 2, chapter 5-5)."""

from __future__ import annotations

from collections.abc import Callable, Sequence  # noqa: TC003 - fields of a dataclass
from dataclasses import dataclass, field
from typing import Final

from pnfarm.protocols.enip.object import Attribute, AttributeObject
from pnfarm.protocols.enip.objects.identity import class_attributes
from pnfarm.protocols.enip.objects.tcp_ip import ETHERNET_LINK
from pnfarm.protocols.enip.wire.data_types import DWORD, SHORT_STRING, UDINT, USINT
from pnfarm.wire.octets import Writer

__all__ = ["EthernetLinkData", "ethernet_link_object"]

#: Attributes 4 and 5: interface counters and media counters, in their order.
_INTERFACE_COUNTERS, _MEDIA_COUNTERS = 11, 12
_LINK_UP: Final = 0x01
_FULL_DUPLEX: Final = 0x02
#: Bits 2 to 4 of the flags: speed and duplex were negotiated.
_NEGOTIATED: Final = 3 << 2


@dataclass(slots=True)
class EthernetLinkData:
    """``counters`` gives octets in, unicast in, other in, discards, errors, unknown protocols, and the same out."""

    mac: bytes
    speed_mbps: int = 100
    up: bool = True
    label: str = "X11"
    counters: Callable[[], Sequence[int]] = field(default=lambda: (), repr=False)


def ethernet_link_object(data: EthernetLinkData) -> AttributeObject:
    attributes = {
        1: Attribute(UDINT, lambda: data.speed_mbps),
        2: Attribute(DWORD, lambda: (_LINK_UP if data.up else 0) | _FULL_DUPLEX | _NEGOTIATED),
        3: Attribute(None, lambda: data.mac),
        4: Attribute(None, lambda: _counts(data.counters(), _INTERFACE_COUNTERS)),
        5: Attribute(None, lambda: bytes(4 * _MEDIA_COUNTERS)),
        # negotiation on, no forced speed
        6: Attribute(None, lambda: Writer(little=True).u16(1).u16(0).getvalue()),
        7: Attribute(USINT, lambda: 2),  # twisted pair
        8: Attribute(USINT, lambda: 1 if data.up else 2),  # enabled, disabled
        9: Attribute(USINT, lambda: 1),  # not administratively down
        10: Attribute(SHORT_STRING, lambda: data.label.encode("latin-1", "replace")[:64]),
    }
    return AttributeObject(ETHERNET_LINK, {0: class_attributes(3), 1: attributes}, {1: (1, 2, 3, 4, 5, 6, 7, 8, 9, 10)})


def _counts(numbers: Sequence[int], wanted: int) -> bytes:
    w = Writer(little=True)
    for number in [*numbers, *([0] * wanted)][:wanted]:
        w.u32(number & 0xFFFFFFFF)
    return w.getvalue()
