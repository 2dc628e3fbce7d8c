"""What the Connects of a capture say together of one device: what is plugged where, its parameters, what contradicts.

The last connection counts, and one that the device accepted more than one that it refused.  Where its answer says that
something else is plugged (ModuleDiffBlock) the device has that; a substitute that exchanges data counts as what it
stands in for, because a description file has no substitutes.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.records.directory import Access, Part, find_record
from pnfarm.protocols.profinet.wire.cm.expected import DataDirection, IdentInfo, ModuleState

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from pnfarm.buses.profinet.decode.observed import RecordPlace, SeenConnection
    from pnfarm.protocols.profinet.wire.cm.expected import DiffModule, ExpectedApi, ExpectedSubmodule

__all__ = ["SYSTEM", "SeenDevice", "SeenModule", "SeenSubmodule", "few", "is_interface", "seen_device"]

#: Subslots of interfaces and their ports (IEC 61158-6-10, coding of SubslotNumber).
SYSTEM = range(0x8000, 0x9000)

#: Sentences of one kind that a user reads.
_FEW = 12
_USABLE = (IdentInfo.OK, IdentInfo.SUBSTITUTE)


@dataclass(frozen=True, slots=True)
class SeenSubmodule:
    """``inputs`` and ``outputs`` are octets, the controller's."""

    api: int
    ident: int
    inputs: int = 0
    outputs: int = 0

    def __str__(self) -> str:
        return f"0x{self.ident:08X} with {self.inputs} octets in and {self.outputs} out, API 0x{self.api:X}"


@dataclass(slots=True)
class SeenModule:
    """``is_there``: not pulled when its controller connected."""

    ident: int
    submodules: dict[int, SeenSubmodule] = field(default_factory=dict)
    is_there: bool = True


@dataclass(slots=True)
class SeenDevice:
    """Modules by slot, parameter records by (slot, subslot), sentences for a user; ``head`` is the access point's slot.

    ``lax``: what it takes beyond those records, which a device with strict limits refuses.
    """

    modules: dict[int, SeenModule] = field(default_factory=dict)
    head: int = 0
    parameters: dict[tuple[int, int], dict[int, bytes]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    lax: list[str] = field(default_factory=list)


def few(sentences: Sequence[str]) -> list[str]:
    """The first of many."""
    more = len(sentences) - _FEW
    return [*sentences[:_FEW], *([f"and {more} more of these"] if more > 0 else [])]


def seen_device(connections: Iterable[SeenConnection]) -> SeenDevice:
    """The device of these connections, given in their order."""
    device, notes = SeenDevice(), list[str]()
    ordered = sorted(connections, key=lambda one: (one.accepted is not False) + (one.accepted is True))
    for connection in ordered:
        diff = connection.difference
        real = {(api.api, one.slot): one for api in (diff.apis if diff else ()) for one in api.modules}
        for expected in connection.apis:
            _plug(device, expected, real.get((expected.api, expected.slot)), notes)
    device.notes += few(list(dict.fromkeys(notes)))
    _keep_earlier(device, ordered)
    _choose_head(device)
    for connection in ordered:
        _take_parameters(device, connection)
    return device


def _keep_earlier(device: SeenDevice, ordered: Sequence[SeenConnection]) -> None:
    """A module that no controller's last connection has is plugged all the same."""
    last = {connection.controller: connection for connection in ordered}
    asked = {api.slot for connection in last.values() for api in connection.apis}
    earlier = [f"slot {slot}" for slot in sorted(device.modules) if slot not in asked]
    if earlier:
        device.notes.append(f"only an earlier connection has {', '.join(few(earlier))}: what was there stays")


def is_interface(subslot: int) -> bool:
    return subslot in SYSTEM and not subslot & 0xFF


def _choose_head(device: SeenDevice) -> None:
    """The slot of the access point: the first that has an interface, else 0; it has a submodule, for its I&M data."""
    slots = (slot for slot, module in sorted(device.modules.items()) if any(map(is_interface, module.submodules)))
    device.head = next(slots, 0)
    head = device.modules.setdefault(device.head, SeenModule(1))
    if not head.submodules:
        head.submodules[1] = SeenSubmodule(0, 1)
        device.notes.append(f"slot {device.head} is in no connection: its access point is assumed")


def _plug(device: SeenDevice, expected: ExpectedApi, real: DiffModule | None, notes: list[str]) -> None:
    slot, ident = expected.slot, expected.module_ident
    there = real is None or real.state != ModuleState.NO_MODULE
    if real is not None and not there:
        notes.append(f"slot {slot} was empty: `slots: {{{slot}: null}}`; its file has the module that was asked for")
    wrong = real is not None and there and real.state != ModuleState.PROPER_MODULE
    if real is not None and wrong and _stands_in(real):
        notes.append(
            f"slot {slot}: the device had module 0x{real.module_ident:08X} as a substitute for 0x{ident:08X}; "
            "the farm's has the one that was asked for, the fault module-wrong with `substitute` plugs the other"
        )
    elif real is not None and wrong:
        notes.append(f"slot {slot}: module 0x{real.module_ident:08X} was there in place of 0x{ident:08X}")
        ident = real.module_ident
    known = device.modules.get(slot)
    if known is None or known.ident != ident:
        if known is not None:
            notes.append(
                f"slot {slot}: module 0x{known.ident:08X} by one connection, 0x{ident:08X} by another, which counts"
            )
        known = device.modules[slot] = SeenModule(ident)
    known.is_there = there
    really = {one.subslot: one for one in real.submodules} if real is not None and there else {}
    for wanted in expected.submodules:
        found = really.get(wanted.subslot)
        state = IdentInfo.OK if found is None else found.ident_info
        if state == IdentInfo.NO_SUBMODULE:
            notes.append(f"slot {slot} had nothing in subslot 0x{wanted.subslot:04X}")
            known.submodules.pop(wanted.subslot, None)
            continue
        has = _submodule(wanted, expected.api, None if found is None or state in _USABLE else found.submodule_ident)
        before = known.submodules.get(wanted.subslot)
        if before not in {None, has}:
            notes.append(
                f"slot {slot}, subslot 0x{wanted.subslot:04X}: {before} by one connection, {has} by another, "
                "which counts"
            )
        known.submodules[wanted.subslot] = has


def _stands_in(real: DiffModule) -> bool:
    """A substitute whose submodules exchange data, by what it says of them, if anything."""
    usable = [one.ident_info in _USABLE for one in real.submodules]
    return real.state == ModuleState.SUBSTITUTE and (not usable or any(usable))


def _submodule(expected: ExpectedSubmodule, api: int, other: int | None) -> SeenSubmodule:
    lengths = expected.length(DataDirection.INPUT), expected.length(DataDirection.OUTPUT)
    return SeenSubmodule(api, expected.submodule_ident if other is None else other, *lengths)


# -- parameter records -------------------------------------------------------------------------------------------------


def _take_parameters(device: SeenDevice, connection: SeenConnection) -> None:
    unknown, changed, lengths, running = list[str](), list[str](), list[str](), list[str]()
    for place, data in connection.parameters.items():
        if _holder(device, place) is None:
            continue
        if not _is_known(place):
            unknown.append(_shown(place))
        if not _is_application(place):
            continue
        records = device.parameters.setdefault(place[1:3], {})
        before = records.get(place[3], data)
        if place in connection.rewritten or before != data:
            changed.append(_shown(place))
        if not data or len({len(data), len(before), connection.rewritten.get(place, len(data))}) > 1:
            lengths.append(_shown(place))
        if data:
            records[place[3]] = data
    for place, length in connection.later.items():
        own = device.parameters.get(place[1:3], {}).get(place[3], b"")
        if _is_application(place) and len(own) != length:
            running.append(_shown(place))
    for sentences, what, places in (
        (device.notes, "records that no device of a farm has were written", unknown),
        (device.notes, "records were written with several values, of which the last counts", changed),
        (device.notes, "records that the device refused were written", list(map(_shown, connection.refused))),
        (device.lax, "records of several lengths, or without octets, were written", lengths),
        (device.lax, "records were written to the running device", running),
    ):
        if places:
            sentences.append(f"{what}: {', '.join(few(places))}")


def _holder(device: SeenDevice, place: RecordPlace) -> SeenSubmodule | None:
    api, slot, subslot, _ = place
    module = device.modules.get(slot)
    found = None if module is None else module.submodules.get(subslot)
    return found if found is not None and found.api == api else None


def _is_application(place: RecordPlace) -> bool:
    """Whether the description file is where the farm's device has such a record from."""
    known = find_record(place[3])
    return known is not None and known.part is Part.APPLICATION


def _is_known(place: RecordPlace) -> bool:
    known = find_record(place[3])
    return known is not None and bool(known.access & Access.ANY_WRITE)


def _shown(place: RecordPlace) -> str:
    _, slot, subslot, index = place
    return f"{index} (0x{index:04X}) of slot {slot}, subslot 0x{subslot:04X}"
