"""Who a device says that it is: its Identity object (CIP volume 1, chapter 5A-2)."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.protocols.enip.status import Service
from pnfarm.protocols.enip.wire.epath import logical_path
from pnfarm.protocols.enip.wire.message import message_request
from pnfarm.wire.octets import Reader

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.protocols.enip.wire.epath import ElectronicKey

__all__ = ["READ_IDENTITY", "Identification", "differences", "parse_identification"]

READ_IDENTITY = message_request(Service.GET_ATTRIBUTES_ALL, logical_path(0x01, 1))


@dataclass(frozen=True, slots=True)
class Identification:
    """Attributes 1 to 7."""

    vendor_id: int
    device_type: int
    product_code: int
    revision: tuple[int, int]
    status: int
    serial: int
    name: str

    def as_dict(self) -> dict[str, Any]:
        return asdict(self) | {"revision": list(self.revision)}


def parse_identification(data: bytes) -> Identification:
    """The answer to Get_Attributes_All, which may have more after it.  Raises ``short``."""
    r = Reader(data, little=True)
    vendor, device_type, product = r.u16(), r.u16(), r.u16()
    revision, status, serial = (r.u8(), r.u8()), r.u16(), r.u32()
    return Identification(vendor, device_type, product, revision, status, serial, r.bytes(r.u8()).decode("latin-1"))


def differences(found: Identification, planned: ElectronicKey) -> Iterator[tuple[str, str, str]]:
    """What is not as planned: what, found, planned.  Numbers that are planned as 0 are any."""
    revision = (planned.major_revision, planned.minor_revision)
    for what, here, there in (
        ("vendor", found.vendor_id, planned.vendor_id),
        ("device type", found.device_type, planned.device_type),
        ("product code", found.product_code, planned.product_code),
    ):
        if there and here != there:
            yield what, str(here), str(there)
    if revision[0] and found.revision != revision:
        yield "revision", "{}.{}".format(*found.revision), "{}.{}".format(*revision)
