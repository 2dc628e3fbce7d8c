"""CIP requests and replies in words.  A reply names neither object nor attribute: its request is remembered."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from pnfarm.buses.ethernetip.controller.identity import parse_identification
from pnfarm.buses.ethernetip.decode.identity import learn_identity
from pnfarm.buses.ethernetip.decode.names import (
    CONNECTION_MANAGER,
    Place,
    attribute_name,
    octets_text,
    path_text,
    place_of,
    place_text,
    service_name,
    value_text,
)
from pnfarm.buses.ethernetip.decode.opening import OPENS, close_answered, close_asked, open_answered, open_asked
from pnfarm.buses.ethernetip.decode.shared import Asked
from pnfarm.captures.packet import Description
from pnfarm.errors import DecodeError
from pnfarm.protocols.enip.status import GeneralStatus, Service, status_text
from pnfarm.protocols.enip.wire.forward_open import UnconnectedSend
from pnfarm.protocols.enip.wire.message import (
    REPLY,
    MessageReply,
    MessageRequest,
    parse_multiple_service,
    parse_reply,
    parse_request,
)
from pnfarm.wire.octets import Reader

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.buses.ethernetip.decode.shared import AskedKey, Route, Shared
    from pnfarm.drives.description.model import Model
    from pnfarm.protocols.enip.wire.cpf import Item

__all__ = ["message"]

IDENTITY: Final = 0x01
#: Messages of a packet of several that are shown and remembered, and attributes of a list.
MOST_SEVERAL: Final = 32
_READS: Final = frozenset({Service.GET_ATTRIBUTE_SINGLE, Service.GET_ATTRIBUTES_ALL, Service.GET_ATTRIBUTE_LIST})
_WRITES: Final = frozenset({Service.SET_ATTRIBUTE_SINGLE, Service.SET_ATTRIBUTES_ALL, Service.SET_ATTRIBUTE_LIST})
#: A reply to a request for an attribute that is not there has its path, else only what is wrong.
_FINE: Final = frozenset({GeneralStatus.SUCCESS, GeneralStatus.PARTIAL_TRANSFER})


def message(
    octets: bytes, key: AskedKey, route: Route, items: tuple[Item, ...], shared: Shared
) -> Iterator[Description]:
    """One message; raises :class:`DecodeError`."""
    if not octets:
        raise DecodeError("short", "an empty message")
    if octets[0] & REPLY:
        reply = parse_reply(octets)
        asked = shared.answered(key, reply.service)
        yield from _reply(reply, asked, route, items, shared)
        return
    request = parse_request(octets)
    yield from _request(request, key, route, shared)


# -- requests


def _request(request: MessageRequest, key: AskedKey, route: Route, shared: Shared) -> Iterator[Description]:
    place = place_of(request.path)
    if request.service == Service.UNCONNECTED_SEND and _of_manager(place):
        sent = UnconnectedSend.parse(request.data)
        inner = parse_request(sent.message)
        shared.ask(key, _asked(inner, route.time_ns, routed=True))
        text = f"by {path_text(sent.route)}" if sent.route else "to this device itself"
        yield Description("Unconnected_Send.req", text, {"route": sent.route.hex()}, family="cip")
        yield from _described(inner, route, shared)
        return
    shared.ask(key, _asked(request, route.time_ns))
    yield from _described(request, route, shared)


def _of_manager(place: Place | None) -> bool:
    return place is not None and place.class_id == CONNECTION_MANAGER


def _asked(request: MessageRequest, now: int, *, routed: bool = False) -> Asked:
    several: tuple[MessageRequest | None, ...] = ()
    if request.service == Service.MULTIPLE_SERVICE_PACKET:
        several = tuple(_parsed(octets) for octets in _parts(request.data))
    return Asked(request, now, several, routed)


def _parts(data: bytes) -> tuple[bytes, ...]:
    try:
        return parse_multiple_service(data)[:MOST_SEVERAL]
    except DecodeError:
        return ()


def _parsed(octets: bytes) -> MessageRequest | None:
    try:
        return parse_request(octets)
    except DecodeError:
        return None


def _described(request: MessageRequest, route: Route, shared: Shared, *, inside: bool = False) -> Iterator[Description]:
    place = place_of(request.path)
    what = f"{service_name(request.service, place)}.req"
    model = shared.stations.model(route.device_mac)
    if _of_manager(place):
        if request.service in OPENS:
            yield open_asked(what, request, route, shared)
            return
        if request.service == Service.FORWARD_CLOSE:
            yield close_asked(what, request, route, shared)
            return
    if request.service == Service.MULTIPLE_SERVICE_PACKET and not inside:
        parts = parse_multiple_service(request.data)
        text = f"{len(parts)} requests to {place_text(place, request.path, model)}"
        yield Description(what, text, {"requests": len(parts)}, family="cip")
        for part in parts[:MOST_SEVERAL]:
            yield from _described(parse_request(part), route, shared, inside=True)
        yield from _more(what, len(parts))
        return
    yield Description(what, *_request_text(request, place, model), family="cip")


def _more(what: str, count: int) -> Iterator[Description]:
    if count > MOST_SEVERAL:
        yield Description(what, f"and {count - MOST_SEVERAL} more", family="cip")


def _where(place: Place | None, service: int) -> dict[str, Any]:
    """What a line of JSON says of an object."""
    found: dict[str, Any] = {"service": service}
    if place is not None:
        named = (("class", place.class_id), ("instance", place.instance), ("attribute", place.attribute))
        found |= {key: value for key, value in named if value is not None}
    return found


def _request_text(
    request: MessageRequest, place: Place | None, model: Model | None
) -> tuple[str, dict[str, Any], dict[str, str]]:
    text = place_text(place, request.path, model)
    details = _where(place, request.service)
    counts = {"writes": ""} if request.service in _WRITES else {"reads": ""} if request.service in _READS else {}
    if request.service == Service.GET_ATTRIBUTE_LIST and place is not None:
        numbers = _attribute_list(request.data)
        names = ", ".join(attribute_name(place, number, model) for number in numbers[:MOST_SEVERAL])
        return f"{text}: {names}", details | {"attributes": numbers}, counts
    if request.service == Service.SET_ATTRIBUTE_SINGLE:
        value = value_text(request.data, place, place.attribute if place is not None else None, model)
        return f"{text} = {value}", details | {"data": request.data.hex()}, counts
    if request.data:
        text += f": {octets_text(request.data)}"
        details["data"] = request.data.hex()
    return text, details, counts


def _attribute_list(data: bytes) -> list[int]:
    r = Reader(data, little=True)
    return [r.u16() for _ in range(r.u16())]


# -- replies


def _reply(
    reply: MessageReply, asked: Asked | None, route: Route, items: tuple[Item, ...], shared: Shared, *,
    inside: bool = False,
) -> Iterator[Description]:  # fmt: skip
    request = asked.request if asked is not None else None
    place = place_of(request.path) if request is not None else None
    routed = asked is not None and asked.routed and reply.service == Service.UNCONNECTED_SEND
    manager = _of_manager(place) or request is None or routed
    name = "Unconnected_Send" if routed else _reply_name(reply.service, place, manager=manager)
    what = f"{name}.res"
    if manager and not routed:
        if reply.service in OPENS:
            yield open_answered(what, request, reply, route, items, shared)
            return
        if reply.service == Service.FORWARD_CLOSE:
            yield close_answered(what, reply)
            return
    model = shared.stations.model(route.device_mac)
    if reply.service == Service.MULTIPLE_SERVICE_PACKET and not inside and reply.data:
        yield from _several(what, reply, asked, route, items, shared)
        return
    where = place_text(place, request.path, model) if request is not None else "its request is not in the capture"
    details = _where(place, reply.service) | {"status": reply.status}
    if reply.status not in _FINE:
        text = status_text(reply.status, reply.extended)
        details["extended_status"] = list(reply.extended)
        yield Description(what, f"{text} (0x{reply.status:02X}), {where}", details, {"errors": text}, family="cip")
        return
    _learn(reply, place, route, shared)
    text = f"OK, {where}"
    if reply.status != GeneralStatus.SUCCESS:
        text = f"{status_text(reply.status, reply.extended)}, {where}"
    if reply.data:
        details["data"] = reply.data.hex()
        text += f": {_reply_text(reply, request, place, model)}"
    yield Description(what, text, details, family="cip")


def _reply_name(service: int, place: Place | None, *, manager: bool) -> str:
    if place is None and manager:
        # the request is not there: what the number means at the Connection Manager, which most often has it
        manager_path = place_of(bytes((0x20, CONNECTION_MANAGER)))
        return service_name(service, manager_path)
    return service_name(service, place)


def _several(
    what: str, reply: MessageReply, asked: Asked | None, route: Route, items: tuple[Item, ...], shared: Shared
) -> Iterator[Description]:
    parts = parse_multiple_service(reply.data)
    status = "OK" if not reply.status else f"{status_text(reply.status, reply.extended)} (0x{reply.status:02X})"
    yield Description(
        what, f"{status}, {len(parts)} replies", {"replies": len(parts), "status": reply.status}, family="cip"
    )
    requests = asked.several if asked is not None else ()
    for place, octets in enumerate(parts[:MOST_SEVERAL]):
        part = parse_reply(octets)
        request = requests[place] if place < len(requests) else None
        fits = Asked(request) if request is not None and request.service == part.service else None
        yield from _reply(part, fits, route, items, shared, inside=True)
    yield from _more(what, len(parts))


def _learn(reply: MessageReply, place: Place | None, route: Route, shared: Shared) -> None:
    """Identity: who the device is."""
    if reply.service != Service.GET_ATTRIBUTES_ALL or place is None:
        return
    if (place.class_id, place.instance) != (IDENTITY, 1) or len(reply.data) < 6:
        return
    r = Reader(reply.data, little=True)
    learn_identity(shared.stations, route.device_mac, r.u16(), r.u16(), r.u16())


def _reply_text(reply: MessageReply, request: MessageRequest | None, place: Place | None, model: Model | None) -> str:
    if place is None or request is None:
        return octets_text(reply.data)
    if reply.service == Service.GET_ATTRIBUTE_SINGLE:
        return value_text(reply.data, place, place.attribute, model)
    if reply.service == Service.GET_ATTRIBUTES_ALL and (place.class_id, place.instance) == (IDENTITY, 1):
        return _identity(reply.data)
    return octets_text(reply.data)


def _identity(data: bytes) -> str:
    """Attributes 1 to 7 together."""
    try:
        found = parse_identification(data)
    except DecodeError:
        return octets_text(data)
    return (
        f"{found.name!r} vendor {found.vendor_id} type {found.device_type} product {found.product_code} "
        f"revision {'.'.join(map(str, found.revision))} status 0x{found.status:04X} serial 0x{found.serial:08X}"
    )
