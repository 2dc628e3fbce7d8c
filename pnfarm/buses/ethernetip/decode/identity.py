"""The model of a station by the numbers of its Identity object."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.decoding.identity import models_by
from pnfarm.buses.ethernetip.device.product import Product

if TYPE_CHECKING:
    from pnfarm.captures.stations import Stations
    from pnfarm.drives.description.model import Model

__all__ = ["learn_identity", "numbers_of"]


def numbers_of(model: Model) -> tuple[int, int, int]:
    """Vendor, device type and product code."""
    product = Product.of(model)
    return product.vendor_id, product.device_type, product.product_code


def learn_identity(stations: Stations, mac: bytes, vendor_id: int, device_type: int, product_code: int) -> None:
    """As ListIdentity, the Identity object, and the key of an accepted Forward_Open have it."""
    if (found := models_by("ethernetip", numbers_of).get((vendor_id, device_type, product_code))) is not None:
        stations.suppose(mac, found)
