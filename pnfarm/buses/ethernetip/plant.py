"""An EtherNet/IP station as it can be compared: of a farm file, and as it answers ListIdentity.

ListIdentity has the attributes 1 to 8 of the Identity object (CIP volume 2, 2-4.3.2), so that no session is opened.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.ethernetip.device.product import Product
from pnfarm.buses.plant import PlantAnswer, StationFacts, readable

if TYPE_CHECKING:
    from pnfarm.buses.ethernetip.controller.device_plan import DevicePlan
    from pnfarm.drives.description.model import Model
    from pnfarm.protocols.enip.identity_search import IdentitySearch

__all__ = ["facts_of", "planned_facts", "seen"]


def facts_of(config: Any, model: Model | None) -> StationFacts:
    """The serial number is not compared: each device has its own."""
    if model is None:
        known = config.described.identity(0)
        return _facts(config.name, str(config.ip.ip), known, known.name)
    product = Product.of(model)
    return _facts(config.name, str(config.ip.ip), product, product.product_name)


def planned_facts(plan: DevicePlan) -> StationFacts:
    """A plan has the electronic key, whose revision a compatible device may exceed."""
    key = plan.key
    known = {
        "vendor": key.vendor_id,
        "device type": key.device_type,
        "product code": key.product_code,
        "major revision": key.major_revision,
    }
    return StationFacts(plan.name, str(plan.ip.ip), {what: str(number) for what, number in known.items()})


def _facts(name: str, address: str, known: Any, product: str) -> StationFacts:
    major, minor = known.revision
    return StationFacts(
        name,
        address,
        {
            "vendor": str(known.vendor_id),
            "device type": str(known.device_type),
            "product code": str(known.product_code),
            "major revision": str(major),
        },
        {"minor revision": str(minor), "product name": readable(product)},
    )


def seen(search: IdentitySearch) -> PlantAnswer:
    """Devices by their addresses."""
    stations = [
        _facts(name, str(one.peer[0]), one.identity, name)
        for one in sorted(search.found.values(), key=lambda one: one.peer)
        for name in [readable(one.identity.name.decode("latin-1"))]
    ]
    return PlantAnswer(stations)
