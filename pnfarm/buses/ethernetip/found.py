"""Adapters of a capture as drives of a farm file: which model stands for each, and under which identity.

A model is chosen by vendor, device type and product code, else by its vendor and the sizes of its connection; what is
not sure has a note.  Everything that is no drive of a known kind is listed with what was seen of it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.decoding.identity import models_by
from pnfarm.buses.ethernetip.decode.channels import octets_behind
from pnfarm.buses.ethernetip.decode.identity import numbers_of
from pnfarm.buses.ethernetip.device.product import Product
from pnfarm.buses.imports import Found, FoundDrive, FoundStation, drives_first
from pnfarm.drives.catalogue import models_on
from pnfarm.vocabulary.durations import format_duration
from pnfarm.wire.mac import format_mac

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.buses.ethernetip.decode.decoder import EthernetIpDecoder
    from pnfarm.buses.ethernetip.decode.observed import SeenAdapter, SeenOpening
    from pnfarm.drives.description.model import Model

__all__ = ["found"]

#: No frame says how long an address's prefix is.
PREFIX = 24


def found(decoder: EthernetIpDecoder, *, models: bool = True) -> Iterator[Found]:
    """Drives first, then other adapters; originators are named by their adapters."""
    observed = decoder.shared.observed
    if observed is None:
        return iter(())
    openings: dict[Any, SeenOpening] = {}
    for (_, device), opening in observed.openings.items():
        # an owner's says more than a listener's, and one that was accepted more than one that was refused
        known = openings.get(device)
        if known is None or _weight(opening) >= _weight(known):
            openings[device] = opening
    return drives_first(_station(seen, openings.get(seen.ip), models=models) for seen in observed.adapters.values())


def _weight(opening: SeenOpening) -> tuple[bool, int]:
    return opening.refused == "", opening.request.o_to_t.size


def _station(seen: SeenAdapter, opening: SeenOpening | None, *, models: bool) -> FoundDrive | FoundStation:
    facts = tuple(_facts(seen, opening))
    chosen = _model(seen, opening) if models else None
    if chosen is None:
        return FoundStation(seen.product_name or str(seen.ip), facts)
    drive_model, notes = chosen
    keys: dict[str, Any] = {"mac": format_mac(seen.mac), "ip": f"{seen.ip}/{PREFIX}"}
    notes.append(f"the length of its address's prefix is in no frame: /{PREFIX} is assumed")
    product = Product.of(drive_model)
    identity: dict[str, Any] = {}
    for key, field, value in (
        ("vendor", "vendor_id", seen.vendor),
        ("device_type", "device_type", seen.device_type),
        ("product_code", "product_code", seen.product_code),
        ("product_name", "product_name", seen.product_name),
        ("revision", "revision", seen.revision if any(seen.revision) else None),
    ):
        if value and value != getattr(product, field):
            identity[key] = ".".join(map(str, value)) if isinstance(value, tuple) else value
    if identity:
        keys["identity"] = identity
    if opening is not None:
        rpi_ns = opening.request.t_to_o_rpi_us * 1000
        keys["rpi"] = format_duration(rpi_ns)
        if rpi_ns < product.min_rpi_ns:
            keys["limits"] = "lax"
            notes.append(f"its interval of {format_duration(rpi_ns)} is shorter than the manual's: limits are lax")
        if opening.refused:
            notes.append(f"its connection was refused in the capture: {opening.refused}")
    octets = seen.ip.packed
    return FoundDrive(f"drive-{octets[2]}-{octets[3]}", drive_model.name, keys, (*notes, *facts))


def _model(seen: SeenAdapter, opening: SeenOpening | None) -> tuple[Model, list[str]] | None:
    asked = (seen.vendor, seen.device_type, seen.product_code)
    same = models_by("ethernetip", numbers_of).get(asked)
    if same is not None:
        return same, []
    for one in models_on("ethernetip"):
        if Product.of(one).vendor_id == seen.vendor and (opening is None or _fits(one, opening)):
            return one, [f"chosen by its vendor: product code {seen.product_code} is none of a model"]
    return None


def _fits(one: Model, opening: SeenOpening) -> bool:
    back, _, _ = octets_behind(opening.request.t_to_o.size, one, from_device=True)
    return back == Product.of(one).input_size


def _facts(seen: SeenAdapter, opening: SeenOpening | None) -> Iterator[str]:
    if seen.vendor:
        yield f"vendor {seen.vendor}, device type {seen.device_type}, product code {seen.product_code}"
    if any(seen.revision):
        yield f"{seen.product_name!r}, revision {seen.revision[0]}.{seen.revision[1]}"
    yield f"MAC {format_mac(seen.mac)}, IP {seen.ip}"
    if opening is not None:
        request = opening.request
        points = f", assemblies {' and '.join(map(str, opening.points))}" if opening.points else ""
        yield (
            f"connected by {opening.originator}: {request.o_to_t.size} octets to it every "
            f"{request.o_to_t_rpi_us / 1000:g} ms, {request.t_to_o.size} from it every "
            f"{request.t_to_o_rpi_us / 1000:g} ms, timeout {opening.multiplier} intervals{points}"
        )
