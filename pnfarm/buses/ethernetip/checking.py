"""An EtherNet/IP station as it can be compared: of a farm file, and as it answers ListIdentity.

ListIdentity has the attributes 1 to 8 of the Identity object (CIP volume 2, 2-4.3.2), so that no session is opened.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pnfarm.buses.checking import CheckAnswer, StationFacts, readable
from pnfarm.buses.ethernetip.device.product import Product

if TYPE_CHECKING:
    from pnfarm.buses.ethernetip.controller.device_plan import DevicePlan
    from pnfarm.buses.ethernetip.described.station import DescribedStation
    from pnfarm.drives.description.model import Model
    from pnfarm.protocols.enip.identity_search import IdentitySearch

__all__ = ["facts_of", "planned_facts", "seen"]


def facts_of(config: Any, model: Model | None, *, asked: bool = False) -> StationFacts:
    """The serial number is not compared: each device has its own."""
    if model is None:
        known = config.described.identity(0)
        facts = _facts(config.name, str(config.ip.ip), known, known.name)
        return replace(facts, modules={"connection": _connections(config.described, asked=asked)})
    product = Product.of(model)
    return _facts(config.name, str(config.ip.ip), product, product.product_name)


def _connections(described: DescribedStation, *, asked: bool) -> tuple[str, ...]:
    """Assemblies of outputs and inputs with their octets, where these are fixed; those that are asked for both ways."""
    if asked:
        points = "{}/{}".format(*described.connection.points[-2:])
        return f"{points}, {described.sizes[0]}/{described.sizes[1]} octets", points
    found = []
    for one in described.offered:
        points, ways = "{}/{}".format(*one.points[-2:]), (one.outputs.size, one.inputs.size)
        is_fixed = all(size.least == size.most for size in ways)
        found.append(f"{points}, {ways[0].most}/{ways[1].most} octets" if is_fixed else points)
    return tuple(dict.fromkeys(found))


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


def seen(search: IdentitySearch) -> CheckAnswer:
    """Devices by their addresses."""
    stations = [
        _facts(name, str(one.peer[0]), one.identity, name)
        for one in sorted(search.found.values(), key=lambda one: one.peer)
        for name in [readable(one.identity.name.decode("latin-1"))]
    ]
    return CheckAnswer(stations)
