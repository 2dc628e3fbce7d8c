"""Identity object, class 0x01 (CIP volume 1, chapter 5A-2)."""

from __future__ import annotations

from collections.abc import Callable  # noqa: TC003 - fields of a dataclass
from dataclasses import dataclass
from ipaddress import IPv4Address  # noqa: TC003 - the same
from typing import Final

from pnfarm.protocols.enip.object import Answer, Attribute, AttributeObject, refused
from pnfarm.protocols.enip.status import GeneralStatus, Service
from pnfarm.protocols.enip.wire.data_types import SHORT_STRING, UDINT, UINT, USINT, WORD
from pnfarm.protocols.enip.wire.epath import ElectronicKey
from pnfarm.protocols.enip.wire.identity import IdentityItem

__all__ = ["IDENTITY", "IdentityData", "class_attributes", "identity_item", "identity_key", "identity_object"]

IDENTITY: Final = 0x01


@dataclass(slots=True)
class IdentityData:
    """Attributes 1 to 8; ``reset`` carries out Reset of type 0, 1 or 2 and answers a general status."""

    vendor_id: int
    device_type: int
    product_code: int
    revision: tuple[int, int]
    serial: int
    name: str
    status: int = 0
    state: int = 3
    reset: Callable[[int], int] | None = None

    @property
    def name_octets(self) -> bytes:
        return self.name.encode("latin-1", "replace")[:32]


def class_attributes(revision: int = 1, instances: int = 1) -> dict[int, Attribute]:
    """Attributes 1 to 3 of a class: its revision, its highest instance, their number."""
    return {
        1: Attribute(UINT, lambda: revision),
        2: Attribute(UINT, lambda: instances),
        3: Attribute(UINT, lambda: instances),
    }


def identity_item(data: IdentityData, address: IPv4Address) -> IdentityItem:
    """What the device answers to ListIdentity."""
    return IdentityItem(
        address,
        data.vendor_id,
        data.device_type,
        data.product_code,
        data.revision,
        data.status,
        data.serial,
        data.name_octets,
        data.state,
    )


def identity_key(data: IdentityData) -> ElectronicKey:
    return ElectronicKey(data.vendor_id, data.device_type, data.product_code, *data.revision)


def identity_object(data: IdentityData) -> AttributeObject:
    attributes = {
        1: Attribute(UINT, lambda: data.vendor_id),
        2: Attribute(UINT, lambda: data.device_type),
        3: Attribute(UINT, lambda: data.product_code),
        4: Attribute(None, lambda: bytes(data.revision)),
        5: Attribute(WORD, lambda: data.status),
        6: Attribute(UDINT, lambda: data.serial),
        7: Attribute(SHORT_STRING, lambda: data.name_octets),
        8: Attribute(USINT, lambda: data.state),
    }

    def more(instance: int, service: int, octets: bytes) -> Answer:
        if service != Service.RESET or instance != 1 or data.reset is None:
            return refused(GeneralStatus.SERVICE_NOT_SUPPORTED)
        if len(octets) > 1:
            return refused(GeneralStatus.TOO_MUCH_DATA)
        kind = octets[0] if octets else 0
        return refused(data.reset(kind) if kind <= 2 else GeneralStatus.INVALID_PARAMETER)

    return AttributeObject(
        IDENTITY, {0: class_attributes(), 1: attributes}, {0: (1, 2, 3), 1: (1, 2, 3, 4, 5, 6, 7)}, more
    )
