"""Forward_Open, Forward_Close and their answers in words; what they say of cyclic channels is kept."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from pnfarm.buses.ethernetip.decode.channels import Channel, Template, octets_behind
from pnfarm.buses.ethernetip.decode.identity import learn_identity
from pnfarm.buses.ethernetip.decode.names import octets_text, path_text
from pnfarm.captures.packet import Description
from pnfarm.errors import DecodeError
from pnfarm.protocols.enip.connection_check import ASSEMBLY
from pnfarm.protocols.enip.status import ConnectionStatus, GeneralStatus, Service, status_text
from pnfarm.protocols.enip.wire.cpf import SocketAddress
from pnfarm.protocols.enip.wire.epath import ElectronicKey, Logical, LogicalSegment, parse_epath
from pnfarm.protocols.enip.wire.forward_open import (
    ConnectionType,
    ForwardClose,
    ForwardCloseReply,
    ForwardOpen,
    ForwardOpenReply,
    ForwardRefusal,
    NetworkParameters,
    Priority,
    Triad,
    parse_forward_open,
)

if TYPE_CHECKING:
    from pnfarm.buses.ethernetip.decode.shared import Route, Shared
    from pnfarm.protocols.enip.wire.cpf import Item
    from pnfarm.protocols.enip.wire.message import MessageReply, MessageRequest

__all__ = ["OPENS", "close_answered", "close_asked", "open_answered", "open_asked"]

#: Services that open a connection.
OPENS: Final = frozenset({Service.FORWARD_OPEN, Service.LARGE_FORWARD_OPEN})
_TRIGGERS: Final = ("cyclic", "change of state", "application")
_SIZES: Final = frozenset(
    {ConnectionStatus.O_TO_T_SIZE, ConnectionStatus.T_TO_O_SIZE, ConnectionStatus.INVALID_CONNECTION_SIZE}
)
#: The connection path of an assembly: consumed, then produced point, after the configuration.
_POINTS: Final = frozenset({Logical.INSTANCE, Logical.CONNECTION_POINT})


def _triad(triad: Triad) -> str:
    return f"serial 0x{triad.serial:04X} of originator {triad.vendor_id}/0x{triad.originator_serial:08X}"


def _direction(name: str, connection_id: int, parameters: NetworkParameters, rpi_us: int) -> str:
    kind = ConnectionType(parameters.kind).name.lower().replace("_", "-")
    more = [kind, f"{parameters.size} octets", "variable" if parameters.variable else "fixed"]
    more += [f"priority {Priority(parameters.priority).name.lower()}", f"RPI {rpi_us / 1000:g} ms"]
    if parameters.redundant_owner:
        more.append("redundant owner")
    return f"{name} 0x{connection_id:08X} {', '.join(more)}"


def _parameters(parameters: NetworkParameters) -> dict[str, Any]:
    return {
        "type": ConnectionType(parameters.kind).name.lower().replace("_", "-"),
        "size": parameters.size,
        "variable": parameters.variable,
        "priority": Priority(parameters.priority).name.lower(),
        "redundant_owner": parameters.redundant_owner,
    }


def _named(triad: Triad) -> dict[str, Any]:
    return {
        "connection_serial": triad.serial,
        "originator_vendor": triad.vendor_id,
        "originator_serial": triad.originator_serial,
    }


def open_asked(what: str, request: MessageRequest, route: Route, shared: Shared) -> Description:
    """Raises :class:`DecodeError`."""
    asked = parse_forward_open(request.data, large=request.service == Service.LARGE_FORWARD_OPEN)
    transport = asked.transport
    if shared.observed is not None and transport.transport == 1:
        key, points = _points(asked.path)
        shared.observed.asked(
            route.originator, route.device, route.device_mac, asked, key, tuple(points), _multiplier(asked)
        )
    trigger = _TRIGGERS[transport.trigger] if transport.trigger < len(_TRIGGERS) else f"trigger {transport.trigger}"
    server = " server" if transport.server else ""
    model = shared.stations.model(route.device_mac)
    text = "; ".join(
        (
            _triad(asked.triad),
            f"class {transport.transport} {trigger}{server}",
            _direction("O->T", asked.o_to_t_id, asked.o_to_t, asked.o_to_t_rpi_us),
            _direction("T->O", asked.t_to_o_id, asked.t_to_o, asked.t_to_o_rpi_us),
            f"timeout {_multiplier(asked)} x RPI",
            path_text(asked.path, model),
        )
    )
    details = {
        **_named(asked.triad),
        "transport_class": transport.transport,
        "trigger": trigger,
        "server": transport.server,
        "o_to_t": _parameters(asked.o_to_t)
        | {"connection_id": asked.o_to_t_id, "rpi_seconds": asked.o_to_t_rpi_us / 1e6},
        "t_to_o": _parameters(asked.t_to_o)
        | {"connection_id": asked.t_to_o_id, "rpi_seconds": asked.t_to_o_rpi_us / 1e6},
        "timeout_multiplier": _multiplier(asked),
        "request_timeout_seconds": (asked.ticks << (asked.tick_time & 0x0F)) / 1e3,
        "path": asked.path.hex(),
    }
    return Description(what, text, details, {"connects": ""}, family="cip")


def _multiplier(asked: ForwardOpen) -> int:
    """Beyond 7 the value is reserved; it is shown as it would count."""
    return 4 << min(asked.timeout_multiplier, 16)


def open_answered(
    what: str,
    request: MessageRequest | None,
    reply: MessageReply,
    route: Route,
    items: tuple[Item, ...],
    shared: Shared,
) -> Description:
    """Raises :class:`DecodeError`."""
    refused = reply.status != GeneralStatus.SUCCESS
    asked = None if request is None else _parsed(request)
    if refused:
        if shared.observed is not None and asked is not None:
            why = status_text(reply.status, reply.extended)
            shared.observed.answered(route.originator, route.device, asked.triad, why)
        return _refused(what, reply)
    found = ForwardOpenReply.parse(reply.data)
    if shared.observed is not None:
        shared.observed.answered(route.originator, route.device, found.triad, "")
    text = (
        f"OK, {_triad(found.triad)}; O->T 0x{found.o_to_t_id:08X} API {found.o_to_t_api_us / 1000:g} ms; "
        f"T->O 0x{found.t_to_o_id:08X} API {found.t_to_o_api_us / 1000:g} ms"
    )
    if found.application:
        text += f"; application data {octets_text(found.application)}"
    for item in items:
        if isinstance(item, SocketAddress):
            text += f"; {'O->T' if item.o_to_t else 'T->O'} to {item.address}:{item.port}"
    details = {
        **_named(found.triad),
        "o_to_t": {"connection_id": found.o_to_t_id, "api_seconds": found.o_to_t_api_us / 1e6},
        "t_to_o": {"connection_id": found.t_to_o_id, "api_seconds": found.t_to_o_api_us / 1e6},
    }
    if asked is not None:
        ids = (found.o_to_t_id, found.t_to_o_id)
        _keep(asked, ids, (found.o_to_t_api_us, found.t_to_o_api_us), route, shared)
    return Description(what, text, details, family="cip")


def _parsed(request: MessageRequest) -> ForwardOpen | None:
    try:
        return parse_forward_open(request.data, large=request.service == Service.LARGE_FORWARD_OPEN)
    except DecodeError:
        return None


def _refused(what: str, reply: MessageReply) -> Description:
    text = status_text(reply.status, reply.extended)
    shown = text
    if len(reply.extended) > 1 and reply.extended[0] in _SIZES:
        shown += f", {reply.extended[1]} octets of data would be right"
    details: dict[str, Any] = {"status": reply.status, "extended_status": list(reply.extended)}
    try:
        refusal = ForwardRefusal.parse(reply.data)
    except DecodeError:
        pass  # shorter where the refusal comes from a router: it says no more than the status
    else:
        shown += f"; {_triad(refusal.triad)}"
        details |= _named(refusal.triad)
    return Description(what, shown, details, {"refused": text}, family="cip")


def _points(path: bytes) -> tuple[ElectronicKey | None, list[int]]:
    """The electronic key, and consumed and produced assembly, as far as a path names them."""
    try:
        segments = parse_epath(path)
    except DecodeError:
        return None, []
    key = next((segment for segment in segments if isinstance(segment, ElectronicKey)), None)
    logical = [segment for segment in segments if isinstance(segment, LogicalSegment)]
    if not any(segment.kind == Logical.CLASS and segment.value == ASSEMBLY for segment in logical):
        return key, []
    points = [segment.value for segment in logical if segment.kind in _POINTS]
    return key, points[-2:] if len(points) > 1 else []


def _keep(asked: ForwardOpen, ids: tuple[int, int], intervals: tuple[int, int], route: Route, shared: Shared) -> None:
    """The channels of a connection that was accepted: in force are the answer's ids and intervals."""
    key, points = _points(asked.path)
    if key is not None:
        learn_identity(shared.stations, route.device_mac, key.vendor_id, key.device_type, key.product_code)
    if asked.transport.transport == 1:
        device, originator = route.device, route.originator
        multicast = asked.t_to_o.kind == ConnectionType.MULTICAST
        keys = (originator, device, ids[0]), (device, None if multicast else originator, ids[1])
        for place, (parameters, from_device) in enumerate(((asked.o_to_t, False), (asked.t_to_o, True))):
            if parameters.kind == ConnectionType.NULL:
                continue
            model = shared.stations.model(route.device_mac)
            octets, header, whole = octets_behind(parameters.size, model, from_device=from_device)
            api_ns = intervals[place] * 1000
            template = Template(
                from_device, octets, header, api_ns, api_ns * _multiplier(asked),
                points[place] if points else None, model if whole else None, parameters.variable,
            )  # fmt: skip
            known = shared.channels.get(keys[place])
            if known is not None and known.template == template and from_device and multicast:
                continue  # one more that listens
            channel = shared.channels[keys[place]] = Channel(ids[place], template)
            if known is not None:
                channel.inherit(known)


def close_asked(what: str, request: MessageRequest, route: Route, shared: Shared) -> Description:
    """Raises :class:`DecodeError`."""
    asked = ForwardClose.parse(request.data)
    text = f"{_triad(asked.triad)}; {path_text(asked.path, shared.stations.model(route.device_mac))}"
    return Description(what, text, {**_named(asked.triad), "path": asked.path.hex()}, {"releases": ""}, family="cip")


def close_answered(what: str, reply: MessageReply) -> Description:
    """Raises :class:`DecodeError`."""
    if reply.status != GeneralStatus.SUCCESS:
        return _refused(what, reply)
    found = ForwardCloseReply.parse(reply.data)
    return Description(what, f"OK, {_triad(found.triad)}", _named(found.triad), family="cip")
