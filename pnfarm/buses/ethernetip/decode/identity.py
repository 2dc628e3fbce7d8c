"""The model of a station by the numbers of its Identity object."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from pnfarm.buses.ethernetip.device.product import Product
from pnfarm.drives.catalogue import model, models

if TYPE_CHECKING:
    from pnfarm.captures.stations import Stations
    from pnfarm.drives.description.model import Model

__all__ = ["learn_identity"]


@cache
def _known() -> dict[tuple[int, int, int], Model]:
    """The first model of each vendor, device type and product code."""
    found: dict[tuple[int, int, int], Model] = {}
    for entry in models().values():
        if entry.bus == "ethernetip":
            product = Product.of(model(entry.name))
            found.setdefault((product.vendor_id, product.device_type, product.product_code), model(entry.name))
    return found


def learn_identity(stations: Stations, mac: bytes, vendor_id: int, device_type: int, product_code: int) -> None:
    """As ListIdentity, the Identity object, and the key of an accepted Forward_Open have it."""
    if (found := _known().get((vendor_id, device_type, product_code))) is not None:
        stations.suppose(mac, found)
