"""A drive's identity out of its maker's GSDML file, so that a project that holds the file connects to the drive.

Vendor, device, order number and the access point's idents are taken as they are.  A telegram's module is the one whose
data have the telegram's lengths and whose name has its number; where no name has it, the only one with these lengths.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from pnfarm.buses.described import DescribedIdentity

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pnfarm.drives.description.model import Model
    from pnfarm.drives.telegrams.telegram import Telegram
    from pnfarm.protocols.profinet.gsdml.document import Dap, Gsdml, ModuleItem, SubmoduleItem

    #: A module, and its submodule with the telegram's data.
    _Pair = tuple[ModuleItem, SubmoduleItem]

__all__ = ["identity_of", "numbers_in"]

#: Longest order number of I&M0, octets.
ORDER_NUMBER = 20
#: Words of a telegram's name before its number, in makers' languages and abbreviations.
_NUMBERED = re.compile(
    r"(?:tele?gramm?|tele?gr?\.?|tlg\.?|tel\.?|ppo|dp_?v?\d?|standard|std\.?)[\s_:#-]*0*(\d+)(?![\d.])", re.IGNORECASE
)
_ANY_NUMBER = re.compile(r"(?<![\d.])0*(\d+)(?![\d.])")
#: Makers have a telegram once for each class of frames.
_CLASS = re.compile(r"\bI?RT\b|isochron|taktsynchron", re.IGNORECASE)


def identity_of(document: Gsdml, model: Model, dap_ident: int | None = None) -> DescribedIdentity:
    """What the farm file's ``identity`` would hold; ``dap_ident`` chooses one of several access points.

    ``notes`` say what the file does not have, or what the drive cannot take from it.
    """
    notes = [*document.remarks]
    dap, matched = _access_point(document, model, dap_ident, notes)
    found: dict[str, Any] = {"vendor": document.vendor_id, "device": document.device_id}
    if dap is None:
        return DescribedIdentity(found, tuple(notes))
    found["dap"] = dap.ident
    order = dap.info.order_number.strip()
    if order and order.isascii() and len(order) <= ORDER_NUMBER:
        found["order_number"] = order
    elif order:
        notes.append(f"its order number {order[:40]!r} is not one of up to {ORDER_NUMBER} ASCII characters")
    submodules = _dap_submodules(dap, model, notes)
    if submodules:
        found["dap_submodules"] = submodules
    telegrams: dict[int, dict[str, Any]] = {}
    points: dict[int, int] = {}
    for number, pairs in matched.items():
        telegram = model.profidrive.telegrams[number]
        idents = [None if pair is None else {"module": pair[0].ident, "submodule": pair[1].ident} for pair in pairs]
        others = {place: ident for place, ident in enumerate(idents[1:]) if ident is not None}
        telegrams[number] = {**(idents[0] or {}), **({"others": others} if telegram.others else {})}
        for module, data in filter(None, pairs):
            _check_places(telegram, module, data, notes)
            without_data = [one for one in module.submodules if not one.input_octets and not one.output_octets]
            for point in without_data[:1]:
                points.setdefault(point.ident, number)
    if telegrams:
        found["telegrams"] = telegrams
    if points:
        found["access_point"] = next(iter(points))
        if len(points) > 1:
            told = ", ".join(f"0x{ident:X} (telegram {number})" for ident, number in points.items())
            notes.append(f"its modules have several parameter access points, {told}: the first one is taken")
    missing = [number for number in model.profidrive.telegrams if number not in matched]
    if missing:
        numbers = ", ".join(map(str, missing))
        notes.append(f"no module of it fits telegram{'s' if len(missing) > 1 else ''} {numbers} by length and name")
        if shared := _sharing(document, dap):
            notes.append(
                f"its {shared[0].info.name or shared[0].id} takes several submodules with data; a drive here has a "
                "module for each telegram, so that such submodules are not matched"
            )
    return DescribedIdentity(found, tuple(notes))


def _access_point(
    document: Gsdml, model: Model, wanted: int | None, notes: list[str]
) -> tuple[Dap | None, dict[int, list[_Pair | None]]]:
    """The one with the most telegrams and of the drive's submodules, the last of several; and its modules by telegram.

    Makers of older files have a second one for controllers that know no interfaces and ports.
    """
    daps = [dap for dap in document.daps if wanted is None or dap.ident == wanted]
    if not daps:
        known = ", ".join(f"0x{dap.ident:X}" for dap in document.daps) or "none"
        notes.append(f"no access point of it has the ident 0x{wanted or 0:X}; it has {known}")
        return None, {}
    found = [(dap, _matched(document, dap, model)) for dap in daps]
    own = {submodule.subslot for submodule in model.dap.submodules}
    dap, matched = max(reversed(found), key=lambda pair: (len(pair[1]), _in_common(pair[0], own)))
    if len(daps) > 1:
        name = dap.info.name or dap.id
        notes.append(f"of its {len(daps)} access points, {name} (0x{dap.ident:X}) is taken; `dap:` chooses another")
    return dap, matched


def _matched(document: Gsdml, dap: Dap, model: Model) -> dict[int, list[_Pair | None]]:
    """Of each telegram that is found, the module for each of the drive's modules, the one to use first."""
    offered = list(_offered(document, dap))
    found: dict[int, list[_Pair | None]] = {}
    taken: set[int] = set()
    for number, telegram in model.profidrive.telegrams.items():
        lengths = _lengths(telegram)
        fitting = [pair for pair in offered if pair[0].ident not in taken and _data_lengths(pair[1]) == lengths]
        named = [pair for pair in fitting if number in _numbers(*pair)]
        if not named and _is_alone(model, lengths):
            named = [pair for pair in fitting if not _NUMBERED.search(_words(*pair))]
        chosen = _variants(telegram, named)
        if chosen[0] is not None:
            taken |= {pair[0].ident for pair in chosen if pair is not None}
            found[number] = chosen
    return found


def _variants(telegram: Telegram, pairs: Sequence[_Pair]) -> list[_Pair | None]:
    """For each module of the drive's the only one for the same class of frames; for the first, that for RT else."""
    by_class: dict[str, list[_Pair]] = {}
    for pair in pairs:
        by_class.setdefault(_frame_class(_words(*pair)), []).append(pair)
    only = {name: found[0] for name, found in by_class.items() if len(found) == 1}
    usual, *others = (_frame_class(module.name) for module in telegram.modules)
    first = next((name for name in (usual, "RT", *only) if name in only), None)
    return [None if first is None else only[first], *(only.get(name) if name != first else None for name in others)]


def _frame_class(words: str) -> str:
    found = _CLASS.search(words)
    return "" if found is None else "RT" if found[0].upper() == "RT" else "IRT"


def _offered(document: Gsdml, dap: Dap) -> Iterator[_Pair]:
    """Modules that the access point takes and that have data in one submodule, with that submodule."""
    targets = {ref.target for ref in dap.modules}
    for module in document.modules:
        if targets and module.id not in targets:
            continue
        data = [one for one in module.submodules if one.input_octets or one.output_octets]
        if len(data) == 1:
            yield module, data[0]


def _sharing(document: Gsdml, dap: Dap) -> list[ModuleItem]:
    """Modules of the access point whose submodule with data is one of several."""
    targets = {ref.target for ref in dap.modules}
    with_data = {one.id for one in document.submodules if one.input_octets or one.output_octets}
    return [
        module
        for module in document.modules
        if (not targets or module.id in targets) and len({ref.target for ref in module.useable} & with_data) > 1
    ]


def _words(module: ModuleItem, data: SubmoduleItem) -> str:
    return f"{module.info.name} | {data.info.name}"


def numbers_in(words: str) -> set[int]:
    """Numbers that a module's name gives its telegram: behind a word for it, else any."""
    found = _NUMBERED.findall(words) or _ANY_NUMBER.findall(words)
    return {int(number) for number in found if len(number) < 6}


def _numbers(module: ModuleItem, data: SubmoduleItem) -> set[int]:
    return numbers_in(_words(module, data))


def _data_lengths(data: SubmoduleItem) -> tuple[int, int]:
    return data.input_octets, data.output_octets


def _lengths(telegram: Telegram) -> tuple[int, int]:
    return 2 * len(telegram.input), 2 * len(telegram.output)


def _is_alone(model: Model, lengths: tuple[int, int]) -> bool:
    return sum(_lengths(telegram) == lengths for telegram in model.profidrive.telegrams.values()) == 1


def _in_common(dap: Dap, own: set[int]) -> int:
    """How many of these subslots it has a submodule for."""
    system = {interface.subslot for interface in dap.interfaces} | {port.subslot for port in dap.ports}
    return len(own & system) + sum(subslot in one.fixed for one in dap.submodules for subslot in own)


def _dap_submodules(dap: Dap, model: Model, notes: list[str]) -> dict[int, int]:
    """Idents by subslot, of those that the drive has."""
    described = {subslot: one.ident for one in dap.submodules for subslot in one.fixed}
    described |= {interface.subslot: interface.ident for interface in dap.interfaces}
    described |= {port.subslot: port.ident for port in dap.ports}
    own = {submodule.subslot for submodule in model.dap.submodules}
    if missing := sorted(own - described.keys()):
        told = ", ".join(f"0x{subslot:04X}" for subslot in missing)
        notes.append(f"its access point has no submodule in {told}, where the drive has one")
    if more := sorted(described.keys() - own):
        told = ", ".join(f"0x{subslot:04X}" for subslot in more)
        notes.append(f"its access point has submodules in {told}, which the drive does not have")
    return {subslot: described[subslot] for subslot in sorted(own & described.keys())}


def _check_places(telegram: Telegram, module: ModuleItem, data: SubmoduleItem, notes: list[str]) -> None:
    own = max(submodule.subslot for submodule in telegram.module.submodules)
    if own not in data.fixed:
        places = ", ".join(f"0x{place:X}" for place in data.fixed) or "none"
        name = f"telegram {telegram.number} ({module.info.name or module.id})"
        notes.append(f"{name} has its data in subslot {places}, the drive in 0x{own:X}")
