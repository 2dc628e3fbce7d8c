"""A drive's identity out of its maker's GSDML file, so that a project that holds the file connects to the drive.

Vendor, device, order number and the access point's idents are taken as they are.  A telegram is a submodule with the
telegram's lengths and its number in its name, whether the file has a module for each telegram or one module (a drive
object) that takes them all; where a file has modules and no name has the number, it is the only one with these lengths.
Slots, subslots and the submodules without data beside it (parameter access point, placeholders) are the file's.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain, islice
from typing import TYPE_CHECKING, Any

from pnfarm.buses.described import AccessPointError, DescribedIdentity
from pnfarm.buses.profinet.maker_file import MakerFile
from pnfarm.buses.telegram_names import frame_class, is_numbered, numbers_in
from pnfarm.protocols.profinet.gsdml.choosing import listed, matching, name_of
from pnfarm.vocabulary.quoting import shown

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pnfarm.drives.description.model import Model
    from pnfarm.drives.telegrams.telegram import Telegram
    from pnfarm.protocols.profinet.gsdml.document import Dap, Gsdml, ItemRef, ModuleItem, SubmoduleItem

__all__ = ["identity_of"]

#: Longest order number of I&M0, octets.
ORDER_NUMBER = 20
#: Subslots of one submodule, and slots in which telegrams are searched; makers' files have up to 16.
PLACES = 64


@dataclass(frozen=True, slots=True)
class _Offer:
    """A module with one submodule with data in ``subslot``; ``beside``: idents of those without data, by subslot, and
    ``takes``: of others that can be plugged.  ``pluggable``: the module takes several submodules with data."""

    module: ModuleItem
    data: SubmoduleItem
    subslot: int
    beside: dict[int, int]
    takes: dict[int, list[int]]
    pluggable: bool

    @property
    def words(self) -> str:
        own = name_of(self.data) or self.data.id
        return own if self.pluggable else f"{self.module.info.name} | {own}"

    @property
    def lengths(self) -> tuple[int, int]:
        return self.data.input_octets, self.data.output_octets

    def keys(self, slot: int) -> dict[str, Any]:
        """Its entry of ``identity``."""
        return {
            "module": self.module.ident,
            "submodule": self.data.ident,
            "slot": slot,
            "subslot": self.subslot,
            "api": self.data.api,
            "beside": self.beside,
            "takes": self.takes,
        }


#: Of each telegram that is found, by number, what to use for each of the drive's own modules, and further ones.
_Found = dict[int, list[_Offer | None]]


def identity_of(document: Gsdml, model: Model, access_point: str | int | None = None) -> DescribedIdentity:
    """What the farm file's ``identity`` would hold; ``access_point`` chooses one of several.

    ``notes`` say what the file does not have, or what the drive cannot take from it.  Raises
    :class:`AccessPointError`.
    """
    notes = [*document.remarks]
    dap, slot, matched = _access_point(document, model, access_point, notes)
    found: dict[str, Any] = {"vendor": document.vendor_id, "device": document.device_id}
    if dap is None:
        return DescribedIdentity(found, tuple(notes))
    found["dap"] = dap.ident
    order = dap.info.order_number.strip()
    if order and order.isascii() and len(order) <= ORDER_NUMBER:
        found["order_number"] = order
    elif order:
        notes.append(f"its order number {order[:40]!r} is not one of up to {ORDER_NUMBER} ASCII characters")
    if submodules := _dap_submodules(dap, model, notes):
        found["dap_submodules"] = submodules
    telegrams: dict[int, dict[str, Any]] = {}
    for number, (first, *more) in matched.items():
        assert first is not None  # it is the one by which the telegram was found
        others = {place: offer.keys(slot) for place, offer in enumerate(more) if offer is not None}
        own = model.profidrive.telegrams[number].others
        telegrams[number] = {**first.keys(slot), **({"others": others} if own or others else {})}
    supplements = _supplements(document, model, matched, notes)
    if telegrams:
        found["telegrams"] = telegrams
    if supplements:
        found["supplements"] = supplements
    every = (*model.profidrive.telegrams, *model.profidrive.supplements)
    if missing := [number for number in every if number not in telegrams and number not in supplements]:
        numbers = ", ".join(map(str, missing))
        several, it = ("s", "them") if len(missing) > 1 else ("", "it")
        what = f"it has no module for telegram{several} {numbers} by length and name"
        notes.append(what + (f"; the drive does not have {it}" if telegrams else ""))
        if telegrams:
            found["without"] = missing
    notes += _unplayed(document, matched)
    return DescribedIdentity(found, tuple(notes), MakerFile(document, dap))


# the access point and its slot


def _access_point(
    document: Gsdml, model: Model, wanted: str | int | None, notes: list[str]
) -> tuple[Dap | None, int, _Found]:
    """The one with the most telegrams and of the drive's submodules, the last of several; and its modules by telegram.

    Makers of older files have a second one for controllers that know no interfaces and ports.
    """
    daps = document.daps if wanted is None else matching(wanted, document.daps, document.languages)
    # two of one ident are the same to a controller
    if wanted is not None and (not daps or (len(daps) > 1 and isinstance(wanted, str))):
        problem = "several access points are" if daps else "no access point is"
        name = f"0x{wanted:X}" if isinstance(wanted, int) else shown(wanted)
        raise AccessPointError(f"{problem} called {name}; it has {listed(daps or document.daps) or 'none'}")
    if not daps:
        notes.append("it has no access point")
        return None, 0, {}
    found = [(dap, *_matched_in_slot(document, dap, model)) for dap in daps]
    own = {submodule.subslot for submodule in model.dap.submodules}
    dap, slot, matched = max(reversed(found), key=lambda one: (len(one[2]), _in_common(one[0], own)))
    if len(daps) > 1:
        name = dap.info.name or dap.id
        notes.append(
            f"of its {len(daps)} access points, {name} (0x{dap.ident:X}) is taken; `access_point:` chooses another"
        )
    return dap, slot, matched


def _matched_in_slot(document: Gsdml, dap: Dap, model: Model) -> tuple[int, _Found]:
    """The slot with the most telegrams, the drive's own of several, and the telegrams that it takes."""
    own = model.profidrive.telegrams[model.profidrive.default_telegram].module.slot
    slots = sorted({own, *(place for ref in dap.modules if (place := _place(ref)) is not None)}, key=lambda s: s != own)
    found = [(slot, _matched(document, dap, slot, model)) for slot in slots[:PLACES]]
    return max(found, key=lambda one: len(one[1]))


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


# what the modules of a slot offer


def _place(ref: ItemRef) -> int | None:
    """Where it is at the start of a project, else the first place that it may have."""
    return next((place for places in (ref.used, ref.fixed, ref.allowed) for place in places), None)


def _modules(document: Gsdml, dap: Dap, slot: int) -> Iterator[ModuleItem]:
    """Those that the access point takes in the slot; all where it names none."""
    targets = {ref.target for ref in dap.modules if ref.takes(slot) or _place(ref) is None}
    yield from (module for module in document.modules if not dap.modules or module.id in targets)


def _offers(document: Gsdml, module: ModuleItem) -> Iterator[_Offer]:
    fixed = [one for one in module.submodules if _has_data(one)]
    plugged = [(ref, one) for ref in module.useable if (one := document.submodule(ref.target)) is not None]
    empty = (one for one in module.submodules if not _has_data(one))
    beside = {place: one.ident for one in empty for place in islice(one.fixed, PLACES)}
    takes: dict[int, list[int]] = {}
    for ref, one in plugged:
        if not _has_data(one):
            beside |= dict.fromkeys(islice(chain(ref.used, ref.fixed), PLACES), one.ident)
            for place in islice(ref.allowed, PLACES):
                takes.setdefault(place, []).append(one.ident)
    if len(fixed) == 1:
        own = next(iter(fixed[0].fixed), 1)
        yield _Offer(module, fixed[0], own, _without(beside, own), _without(takes, own), pluggable=False)
    for ref, one in plugged if not fixed else ():
        if _has_data(one) and (first := _place(ref)) is not None:
            yield _Offer(module, one, first, _without(beside, first), takes, pluggable=True)


def _without(places: dict[int, Any], place: int) -> dict[int, Any]:
    return {key: value for key, value in places.items() if key != place}


def _has_data(one: SubmoduleItem) -> bool:
    return bool(one.input_octets or one.output_octets)


# telegrams


def _lengths(telegram: Telegram) -> tuple[int, int]:
    return 2 * len(telegram.input), 2 * len(telegram.output)


def _matched(document: Gsdml, dap: Dap, slot: int, model: Model) -> _Found:
    """The telegrams that modules of the slot have."""
    offered = [offer for module in _modules(document, dap, slot) for offer in _offers(document, module)]
    every = [_lengths(telegram) for telegram in model.profidrive.telegrams.values()]
    found: _Found = {}
    taken: set[int] = set()
    for number, telegram in model.profidrive.telegrams.items():
        lengths = _lengths(telegram)
        fitting = [offer for offer in offered if offer.module.ident not in taken and offer.lengths == lengths]
        named = [offer for offer in fitting if number in numbers_in(offer.words)]
        if not named and every.count(lengths) == 1:
            named = [offer for offer in fitting if not offer.pluggable and not is_numbered(offer.words)]
        chosen = _variants(telegram, named)
        if chosen[0] is not None:
            found[number] = chosen
            taken |= {offer.module.ident for offer in chosen if offer is not None and not offer.pluggable}
    return found


def _variants(telegram: Telegram, offers: Sequence[_Offer]) -> list[_Offer | None]:
    """For each module of the drive's the only one for the same class of frames; for the first, that for RT else.

    A further drive object with the telegram follows.
    """
    by_class: dict[str, list[_Offer]] = {}
    for offer in offers:
        by_class.setdefault(frame_class(offer.words), []).append(offer)
    only = {name: found[0] for name, found in by_class.items() if len(found) == 1 or found[0].pluggable}
    usual, *others = (frame_class(module.name) for module in telegram.modules)
    first = next((name for name in (usual, "RT", *only) if name in only), None)
    if first is None:
        return [None]
    chosen = [only[first], *(only.get(name) if name != first else None for name in others)]
    more = {offer.module.ident: offer for offer in offers if offer.pluggable}
    known = {offer.module.ident for offer in chosen if offer is not None}
    return [*chosen, *(offer for ident, offer in more.items() if ident not in known)]


def _supplements(document: Gsdml, model: Model, matched: _Found, notes: list[str]) -> dict[int, dict[str, Any]]:
    """The supplementary telegrams that the modules of the others take: after them, at least as long as the drive's."""
    found: dict[int, dict[str, Any]] = {}
    offers = [first for first, *_ in matched.values() if first is not None]
    for module in {offer.module.id: offer.module for offer in offers}.values():
        least = max(offer.subslot for offer in offers if offer.module.id == module.id)
        for ref in module.useable:
            one, place = document.submodule(ref.target), _place(ref)
            if one is None or place is None or place <= least:
                continue
            for number in numbers_in(name_of(one) or one.id):
                telegram = model.profidrive.supplements.get(number)
                lengths = (0, 0) if telegram is None else _lengths(telegram)
                if telegram is None or one.input_octets < lengths[0] or one.output_octets < lengths[1]:
                    continue
                if (one.input_octets, one.output_octets) != lengths and number not in found:
                    notes.append(
                        f"its telegram {number} has {one.output_octets} octets out and {one.input_octets} in, the "
                        f"drive's {lengths[1]} and {lengths[0]}: further words have no effect"
                    )
                found.setdefault(
                    number,
                    {
                        "submodule": one.ident,
                        "subslot": place,
                        "api": one.api,
                        "input": one.input_octets,
                        "output": one.output_octets,
                    },
                )
    return found


def _unplayed(document: Gsdml, matched: _Found) -> Iterator[str]:
    """Submodules with data that are always in a drive object and that no telegram is."""
    objects = [offer.module for ones in matched.values() for offer in ones if offer is not None and offer.pluggable]
    for module in {module.id: module for module in objects}.values():
        for ref in module.useable:
            one = document.submodule(ref.target)
            if one is not None and ref.fixed and _has_data(one):
                name = name_of(one) or one.id
                yield f"its {name} has data and is always in {module.id}: the drive has no such submodule"
