"""Connect as text, and what it determines for the cyclic frames: their layout, cycle and watchdog."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from pnfarm.buses.profinet.decode.channels import Channel, make_template, telegrams_of
from pnfarm.buses.profinet.decode.identity import learn_identity
from pnfarm.buses.profinet.decode.observed import cr_cycle_ns, expected_apis
from pnfarm.captures.packet import Description
from pnfarm.protocols.profinet.cm.ar import IocrLayout, LayoutError, compute_layout, expected_submodules
from pnfarm.protocols.profinet.cm.device.diff import expected_idents
from pnfarm.protocols.profinet.wire.cm.connect import ArBlockReq, ArBlockRes, ArProperties, ArServerBlock, ArType
from pnfarm.protocols.profinet.wire.cm.expected import ExpectedApi, IdentInfo, ModuleDiffBlock, ModuleState
from pnfarm.protocols.profinet.wire.cm.iocr import FRAME_ID_ASSIGN, IocrBlockReq, IocrBlockRes, IocrType
from pnfarm.protocols.profinet.wire.rpc.pdu import device_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from pnfarm.buses.profinet.decode.shared import Shared
    from pnfarm.captures.packet import Packet
    from pnfarm.protocols.profinet.wire.block import Block
    from pnfarm.protocols.profinet.wire.rpc.pdu import RpcPdu

__all__ = ["connect_request", "connect_response", "forget_asked"]

_AR_TYPES: Mapping[int, str] = {
    ArType.IOCAR_SINGLE: "",
    ArType.IOSAR: "supervisor ",
    ArType.IOCAR_SINGLE_RT_CLASS_3: "RT class 3 ",
    ArType.IOCAR_SR: "redundant ",
}
_DIRECTIONS: Mapping[int, str] = {IocrType.INPUT: "input", IocrType.OUTPUT: "output"}


def connect_request(blocks: tuple[Block, ...], pdu: RpcPdu, packet: Packet, shared: Shared) -> Description:
    """The controller's request.

    A device may send cyclic data before its response, so the requested layouts are kept from here on.
    """
    _ask(blocks, packet, shared)
    ar = next((b for b in blocks if isinstance(b, ArBlockReq)), None)
    if ar is None:
        return Description("Connect.req", "without an AR block", {}, {"connects": ""})
    shared.stations.learn(packet.source, name=ar.station_name.decode("latin-1"))
    _, device, vendor = device_of(pdu.object_uuid)
    learn_identity(shared.stations, packet.destination, vendor, device)
    startup = "advanced" if ar.properties & ArProperties.STARTUP_MODE_ADVANCED else "legacy"
    kind = _AR_TYPES.get(ar.ar_type, f"type 0x{ar.ar_type:04X} ")
    parts = [f"{kind}AR {str(ar.ar_uuid)[:8]}, {startup} start-up"]
    iocrs = [b for b in blocks if isinstance(b, IocrBlockReq)]
    parts += dict.fromkeys(_cycle(iocr) for iocr in iocrs)
    parts.append(_expected(expected_apis(blocks), packet.destination, shared))
    parts += [
        f"{_DIRECTIONS[c.iocr_type]} frame id 0x{c.frame_id:04X}"
        for c in iocrs
        if c.frame_id != FRAME_ID_ASSIGN and c.iocr_type in _DIRECTIONS
    ]
    details = {"ar": str(ar.ar_uuid), "session": ar.session_key, "startup": startup}
    return Description("Connect.req", ", ".join(part for part in parts if part), details, {"connects": ""})


def _ask(blocks: tuple[Block, ...], packet: Packet, shared: Shared) -> None:
    """Channels whose frame id is in the request."""
    expected = expected_submodules(expected_apis(blocks))
    layouts = []
    for iocr in (b for b in blocks if isinstance(b, IocrBlockReq) and b.frame_id != FRAME_ID_ASSIGN):
        with suppress(LayoutError):  # reported with the response
            layouts.append(compute_layout(iocr, expected))
    for key, channel in _channels(layouts, expected_apis(blocks), packet.source, packet.destination, shared):
        shared.asked[key] = channel


def forget_asked(request: tuple[Block, ...], controller: bytes, device: bytes, shared: Shared) -> None:
    """The Connect was refused: forget its channels."""
    for iocr in (b for b in request if isinstance(b, IocrBlockReq)):
        for ends in ((controller, device), (device, controller)):
            shared.asked.pop((*ends, iocr.frame_id), None)


def _cycle(iocr: IocrBlockReq) -> str:
    return f"cycle {cr_cycle_ns(iocr) / 1e6:g} ms, watchdog {iocr.watchdog_factor} x"


def _expected(apis: tuple[ExpectedApi, ...], device: bytes, shared: Shared) -> str:
    telegrams = telegrams_of(expected_idents(apis), shared.stations.model(device))
    idents = {api.slot: api.module_ident for api in apis}
    if telegrams:
        several = len(telegrams) > 1
        modules = [
            (f"slot {slot} " if several else "") + f"telegram {telegram.number} (module 0x{idents[slot]:X})"
            for shift, telegram in telegrams.items()
            for slot in (telegram.module.slot + shift,)
        ]
    else:
        modules = [f"slot {api.slot} module 0x{api.module_ident:X}" for api in apis]
    shown = modules[:8] + ([f"and {len(modules) - 8} more"] if len(modules) > 8 else [])
    return ", ".join(dict.fromkeys(shown))


def connect_response(
    request: tuple[Block, ...], answer: tuple[Block, ...], controller: bytes, device: bytes, shared: Shared
) -> Description:
    """The device's response; from here on the cyclic frames can be decoded."""
    texts = ["OK"]
    if shared.observed is not None:
        shared.observed.answered(controller, device, answer)
    for block in answer:
        match block:
            case ArServerBlock(name):
                shared.stations.learn(device, name=name.decode("latin-1"))
            case ArBlockRes():
                if block.responder_mac != device:
                    texts.append(f"from MAC {block.responder_mac.hex(':')}")
            case ModuleDiffBlock():
                texts.append(_diff(block))
    layouts: list[IocrLayout] = []
    problems: list[str] = []
    expected = expected_submodules(expected_apis(request))
    given = {b.iocr_reference: b.frame_id for b in answer if isinstance(b, IocrBlockRes)}
    for iocr in (b for b in request if isinstance(b, IocrBlockReq)):
        try:
            layouts.append(compute_layout(iocr, expected, given.get(iocr.iocr_reference)))
        except LayoutError as exc:
            problems.append(f"layout of CR {iocr.iocr_reference} is impossible: {exc.detail}")
    texts += [f"{_DIRECTIONS[c.iocr_type]} frame id 0x{c.frame_id:04X}" for c in layouts]
    _open(layouts, expected_apis(request), controller, device, shared)
    return Description("Connect.res", ", ".join([*texts, *problems]))


def _open(
    layouts: list[IocrLayout], apis: tuple[ExpectedApi, ...], controller: bytes, device: bytes, shared: Shared
) -> None:
    opened: dict[bool, Channel] = {}
    for key, channel in _channels(layouts, apis, controller, device, shared):
        before = shared.channels.get(key)
        asked = shared.asked.pop(key, None)
        # frames before the response have already started it
        if before is not None and before is asked:
            channel = before
        elif before is not None:
            channel.inherit(before)
        shared.channels[key] = channel
        template = channel.template
        # of several channels in a direction, one that has a telegram's words
        if template is not None and (template.axes or template.layout.is_input not in opened):
            opened[template.layout.is_input] = channel
    if len(opened) == 2:
        opened[True].partner, opened[False].partner = opened[False], opened[True]


def _channels(
    layouts: Iterable[IocrLayout], apis: tuple[ExpectedApi, ...], controller: bytes, device: bytes, shared: Shared
) -> Iterator[tuple[tuple[bytes, bytes, int], Channel]]:
    """A channel for each layout, with its key: destination, source, frame id."""
    model = shared.stations.model(device)
    telegrams = telegrams_of(expected_idents(apis), model)
    for layout in layouts:
        to, source = (controller, device) if layout.is_input else (device, controller)
        yield (to, source, layout.frame_id), Channel(layout.frame_id, make_template(layout, telegrams, model))


def _diff(block: ModuleDiffBlock) -> str:
    texts = []
    for api in block.apis:
        for module in api.modules:
            if module.state != ModuleState.PROPER_MODULE:
                texts.append(f"slot {module.slot} {_enum(ModuleState, module.state)}")
            texts += [
                f"slot {module.slot} subslot 0x{sub.subslot:04X} {_enum(IdentInfo, sub.ident_info)}"
                for sub in module.submodules
                if sub.ident_info != IdentInfo.OK
            ]
    return f"module difference: {', '.join(texts) or 'states only'}"


def _enum(kind: type[ModuleState | IdentInfo], value: int) -> str:
    try:
        return kind(value).name.lower().replace("_", " ")
    except ValueError:
        return f"state {value}"
