"""Adapters of a capture as drives of a farm file: which model simulates each, and under which identity.

A model is chosen by vendor, device type and product code, else by its vendor and the sizes of its connection; what is
not sure has a note.  One that is no drive of a known kind is a device, by an EDS file made of its connection, if it has
one to assemblies of its own; else it is listed with what was seen of it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.decoding.identity import models_by
from pnfarm.buses.ethernetip.decode.channels import COUNT, HEADER, octets_behind
from pnfarm.buses.ethernetip.decode.identity import numbers_of
from pnfarm.buses.ethernetip.device.product import Product
from pnfarm.buses.ethernetip.eds_file import read_eds
from pnfarm.buses.ethernetip.made_eds import MadeConnection, made_eds
from pnfarm.buses.imports import Found, FoundDevice, FoundDrive, FoundStation, Said, drives_first
from pnfarm.buses.projects.description_folders import DescriptionFile
from pnfarm.drives.catalogue import models_on
from pnfarm.errors import ConfigError
from pnfarm.protocols.enip.connection_check import ASSEMBLY, Refusal, read_path
from pnfarm.protocols.enip.wire.epath import emit_epath, logical_path
from pnfarm.vocabulary.durations import format_duration
from pnfarm.wire.mac import format_mac

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pnfarm.buses.ethernetip.decode.decoder import EthernetIpDecoder
    from pnfarm.buses.ethernetip.decode.observed import SeenAdapter, SeenOpening
    from pnfarm.drives.description.model import Model

__all__ = ["found", "said_of"]

#: No frame has the prefix length of an address.
PREFIX = 24
#: Further connections of one device that a user reads of.
_FEW = 12


def found(decoder: EthernetIpDecoder, *, models: bool = True) -> Iterator[Found]:
    """Drives first, then other adapters; originators are named by their adapters."""
    observed = decoder.shared.observed
    if observed is None:
        return iter(())
    openings: dict[Any, list[SeenOpening]] = {}
    for (_, device, *_), opening in observed.openings.items():
        openings.setdefault(device, []).append(opening)
    vlans = decoder.shared.stations.vlans
    return drives_first(
        _station(seen, openings.get(seen.ip, []), vlans(seen.mac), models=models) for seen in observed.adapters.values()
    )


def _weight(opening: SeenOpening) -> tuple[bool, int]:
    return opening.refused == "", opening.request.o_to_t.size


def _station(seen: SeenAdapter, openings: Sequence[SeenOpening], vlans: str, *, models: bool) -> Found:
    # an owner's says more than a listener's, one that was accepted more than one that was refused, and the last one
    opening = max(reversed(openings), key=_weight, default=None)
    facts = tuple(_facts(seen, openings, opening, vlans))
    chosen = _model(seen, opening) if models else None
    keys: dict[str, Any] = {"mac": format_mac(seen.mac), "ip": f"{seen.ip}/{PREFIX}"}
    numbers = (seen.vendor, seen.device_type, seen.product_code)
    said = said_of(
        "", numbers if seen.vendor else None, ".".join(map(str, seen.revision)) if any(seen.revision) else ""
    )
    assumed = f"no frame has its prefix length: /{PREFIX} is assumed"
    if chosen is None:
        return _device(seen, opening, keys, assumed, facts, said)
    drive_model, notes = chosen
    notes.append(assumed)
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
    return FoundDrive(f"drive-{octets[2]}-{octets[3]}", drive_model.name, keys, tuple(notes), facts, said=said)


def _device(
    seen: SeenAdapter,
    opening: SeenOpening | None,
    keys: dict[str, Any],
    assumed: str,
    facts: tuple[str, ...],
    said: Said,
) -> FoundDevice | FoundStation:
    """By an EDS file that has its identity and its connection, if there is one that a file can have."""
    named = seen.product_name or str(seen.ip)
    if opening is None:
        return FoundStation(named, facts, keys=keys, said=said)
    try:
        octets = _eds(seen, opening)
    except (ConfigError, Refusal) as exc:
        why = exc if isinstance(exc, ConfigError) else "its path names no assemblies of its own"
        return FoundStation(named, (f"no device can be made of its connection: {why}", *facts), keys=keys, said=said)
    keys["rpi"] = format_duration(opening.request.t_to_o_rpi_us * 1000)
    notes = [assumed, "its data are octets, because a capture does not describe them: name them in `signals`"]
    if not seen.vendor:
        notes.append("its product is not known: a scanner that checks the identity refuses it")
    if opening.refused:
        notes.append(f"its connection was refused in the capture: {opening.refused}")
    place = seen.ip.packed
    file = DescriptionFile("eds", "pnfarm-{name}.eds", octets)
    return FoundDevice(f"device-{place[2]}-{place[3]}", file, keys, tuple(notes), facts, said=said)


def _eds(seen: SeenAdapter, opening: SeenOpening) -> bytes:
    """Raises :class:`Refusal` for a path to something else, and :class:`ConfigError` for what no file can have."""
    request = opening.request
    path = read_path(request.path)
    if path.class_id != ASSEMBLY or len(path.points) < 2:
        raise Refusal
    instance, points = (path.points[0], path.points[1:]) if len(path.points) > 2 else (None, path.points)
    owner = request.o_to_t.size >= COUNT + HEADER
    connection = MadeConnection(
        "Connection",
        emit_epath(logical_path(ASSEMBLY, instance, None, *points)),
        request.o_to_t.size - COUNT - HEADER if owner else 0,
        max(0, request.t_to_o.size - COUNT),
        owner=owner,
        configuration=len(path.configuration),
        trigger=request.transport.trigger,
        variable_outputs=request.o_to_t.variable,
        variable_inputs=request.t_to_o.variable,
    )
    numbers = seen.vendor, seen.device_type, seen.product_code, seen.revision[0] or 1, seen.revision[1] or 1
    octets = made_eds(numbers, seen.product_name, "a capture", connection)
    if len(read_eds(octets, "the file made of it").connection().points) < 2:
        raise Refusal
    return octets


def said_of(name: str, numbers: tuple[int, ...] | None, revision: str) -> Said:
    """What a capture or a project says of an adapter, in words that are the same.

    ``numbers`` are vendor, device type and product code; no revision is "".
    """
    identity = {} if numbers is None else {"vendor, type and code": ", ".join(map(str, numbers))}
    return Said(name=name, identity=identity | ({"revision": revision} if revision else {}))


def _model(seen: SeenAdapter, opening: SeenOpening | None) -> tuple[Model, list[str]] | None:
    asked = (seen.vendor, seen.device_type, seen.product_code)
    same = models_by("ethernetip", numbers_of).get(asked)
    if same is not None:
        return same, []
    for one in models_on("ethernetip"):
        if Product.of(one).vendor_id == seen.vendor and (opening is None or _fits(one, opening)):
            return one, [f"chosen by its vendor: no model has product code {seen.product_code}"]
    return None


def _fits(one: Model, opening: SeenOpening) -> bool:
    back, _, _ = octets_behind(opening.request.t_to_o.size, one, from_device=True)
    return back == Product.of(one).input_size


def _facts(
    seen: SeenAdapter, openings: Sequence[SeenOpening], opening: SeenOpening | None, vlans: str
) -> Iterator[str]:
    if seen.vendor:
        yield f"vendor {seen.vendor}, device type {seen.device_type}, product code {seen.product_code}"
    if any(seen.revision):
        yield f"{seen.product_name!r}, revision {seen.revision[0]}.{seen.revision[1]}"
    yield f"MAC {format_mac(seen.mac)}, IP {seen.ip}"
    if seen.others:
        told = ", ".join(format_mac(mac) for mac in seen.others)
        yield f"its address was at MAC {told}, too: another device in its place, or on another network"
    if vlans:
        yield f"on {vlans}: the farm's link has to be in it"
    if opening is not None:
        yield f"connected by {_connection(opening)}"
    for other in [one for one in openings if one is not opening][-_FEW:]:
        yield f"also connected by {_connection(other)}" + (f"; refused: {other.refused}" if other.refused else "")


def _connection(opening: SeenOpening) -> str:
    request = opening.request
    points = f", assemblies {' and '.join(map(str, opening.points))}" if opening.points else ""
    return (
        f"{opening.originator}: {request.o_to_t.size} octets to it every {request.o_to_t_rpi_us / 1000:g} ms, "
        f"{request.t_to_o.size} from it every {request.t_to_o_rpi_us / 1000:g} ms, "
        f"timeout {opening.multiplier} intervals{points}"
    )
