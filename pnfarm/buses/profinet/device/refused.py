"""What a controller configured and a PROFINET station does not have so, in sentences, with the key of the farm file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.cm.device.diff import expected_idents
from pnfarm.protocols.profinet.cm.device.events import RecordRefused, RecordWritten
from pnfarm.protocols.profinet.errors import ConnectFault, describe_status
from pnfarm.protocols.profinet.wire.cm.expected import ArInfo, IdentInfo, ModuleState
from pnfarm.protocols.profinet.wire.rpc.pdu import device_of
from pnfarm.station.visits import Refusal

if TYPE_CHECKING:
    from collections.abc import Iterator
    from uuid import UUID

    from pnfarm.buses.profinet.device.kind import Kind
    from pnfarm.protocols.profinet.cm.ar import Ar
    from pnfarm.protocols.profinet.description import DeviceDescription, ModuleDescription
    from pnfarm.protocols.profinet.errors import PnioStatus
    from pnfarm.protocols.profinet.wire.cm.expected import DiffModule, DiffSubmodule

__all__ = ["of_connect", "of_device", "of_modules", "of_record"]

#: What a submodule is that another controller has; the connection works without it.
_LOCKED = {
    ArInfo.SUPERORDINATED_LOCKED: "is locked by a superior",
    ArInfo.LOCKED_BY_IO_CONTROLLER: "belongs to another controller",
    ArInfo.LOCKED_BY_IO_SUPERVISOR: "belongs to a supervisor",
}


def of_connect(status: PnioStatus, detail: str) -> Refusal:
    """A Connect was refused as a whole; lax limits let more cycles pass."""
    key = ("limits",) if status.error_code1 == ConnectFault.IOCR_BLOCK else ()
    return Refusal(f"Connect refused: {detail}, {describe_status(status)}", key)


def of_device(asked: UUID, description: DeviceDescription) -> Refusal:
    """The object UUID of a Connect names another device."""
    expects = _device(*device_of(asked))
    own = _device(description.instance, description.device_id, description.vendor_id)
    return Refusal(f"the controller expects {expects}, this is {own}", ("gsdml",))


def _device(instance: int, device: int, vendor: int) -> str:
    return f"device 0x{device:04X} of vendor 0x{vendor:04X}" + (f", instance {instance}" if instance != 1 else "")


def of_modules(ar: Ar, description: DeviceDescription, kind: Kind) -> list[Refusal]:
    """The ModuleDiffBlock of an AR: what is wrong, missing or a substitute, with what is expected and what is there."""
    expected = expected_idents(ar.expected)
    own = {module.slot: module for module in (description.dap, *description.modules)}
    found: list[Refusal] = []
    for api in ar.module_diff.apis if ar.module_diff is not None else ():
        for module in api.modules:
            found += _of_module(module, expected[module.slot], own.get(module.slot), kind)
    return found


def _of_module(
    module: DiffModule, expected: tuple[int, dict[int, int]], own: ModuleDescription | None, kind: Kind
) -> Iterator[Refusal]:
    wanted, submodules = expected
    key = kind.key_of(module.slot)
    text = f"slot {module.slot}: the controller expects module {_ident(wanted, kind)}"
    if own is not None and own.module_ident == wanted and module.state != ModuleState.PROPER_MODULE:
        # the farm file has it
        yield Refusal(f"{text}, which was pulled or exchanged since power-on", (), str(module.slot))
    elif module.state == ModuleState.NO_MODULE:
        yield Refusal(f"{text}, the slot is empty", key, str(module.slot))
    elif module.state != ModuleState.PROPER_MODULE:
        works = bool(module.submodules) and all(one.ident_info == IdentInfo.SUBSTITUTE for one in module.submodules)
        there = f"{'substitute ' if works else ''}module {_ident(module.module_ident, kind)} is plugged"
        yield Refusal(f"{text}, {there}", key, str(module.slot), works=works)
    else:
        for one in module.submodules:
            its_key = kind.key_of(module.slot, one.subslot)
            if (refusal := _of_submodule(one, module.slot, submodules.get(one.subslot, 0), its_key)) is not None:
                yield refusal


def _of_submodule(one: DiffSubmodule, slot: int, wanted: int, key: tuple[str | int, ...]) -> Refusal | None:
    place = f"{slot}.{one.subslot}"
    text = f"submodule {slot}.0x{one.subslot:04X}: "
    if (locked := _LOCKED.get(ArInfo(one.ar_info))) is not None:
        return Refusal(f"{text}{locked}", (), place, works=True)
    expects = f"{text}the controller expects submodule 0x{wanted:08X}"
    match one.ident_info:
        case IdentInfo.NO_SUBMODULE:
            return Refusal(f"{expects}, nothing is plugged", key, place)
        case IdentInfo.WRONG:
            return Refusal(f"{expects}, submodule 0x{one.submodule_ident:08X} is plugged", key, place)
        case IdentInfo.SUBSTITUTE:
            substitute = f"{expects}, substitute submodule 0x{one.submodule_ident:08X} is plugged"
            return Refusal(substitute, key, place, works=True)
        case _:
            # waits for its parameters, or has a diagnosis
            return None


def _ident(ident: int, kind: Kind) -> str:
    name = kind.module_name(ident)
    return f"0x{ident:08X}" + (f" ({name})" if name else "")


def of_record(event: RecordRefused | RecordWritten, kind: Kind) -> Refusal | None:
    """A parameter record of the start-up that was refused, or accepted although it is wrong."""
    works = isinstance(event, RecordWritten)
    why = kind.record_complaint(event.slot, event.subslot, event.index)
    # lax limits take what the file does not allow
    key = ("limits",) if why and not works else ()
    if not why and not isinstance(event, RecordWritten):
        why = f"record {event.index}: {describe_status(event.status)}"
    if not why:
        return None
    end = "taken though they are wrong" if works else "refused"
    text = f"parameters of submodule {event.slot}.0x{event.subslot:04X} {end}: {why}"
    return Refusal(text, key, f"{event.slot}.{event.subslot}", works)
