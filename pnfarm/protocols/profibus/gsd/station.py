"""A slave as a GSD file and a choice of modules make it: identifiers, octets of Set_Prm, lengths of data.

A master's plan and a virtual slave are both made of a :class:`PluggedSlave`.  Inputs go to the master.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from pnfarm.errors import DecodeError
from pnfarm.protocols.profibus.gsd.statements import gsd_number
from pnfarm.protocols.profibus.gsd.values import MOST_USER, PlugError, listed
from pnfarm.protocols.profibus.wire.dp import parse_identifiers
from pnfarm.vocabulary.quoting import did_you_mean

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pnfarm.protocols.profibus.gsd.document import Gsd, ModuleItem
    from pnfarm.protocols.profibus.gsd.values import UserParameters
    from pnfarm.protocols.profibus.wire.dp import Identifier

__all__ = ["EMPTY_SLOT", "STATION", "PluggedModule", "PluggedSlave", "plug_slave"]

#: The identifier of a slot without a module, and the most octets of Chk_Cfg and of Data_Exchange each way.
EMPTY_SLOT: Final = b"\0"
MOST_IDENTIFIERS: Final = 244
MOST_DATA: Final = 244
#: Slot 0 stands for the station itself.
STATION: Final = 0


@dataclass(frozen=True, slots=True)
class PluggedModule:
    """``user``: its octets of Set_Prm."""

    slot: int
    item: ModuleItem
    user: bytes
    parts: tuple[Identifier, ...]

    @property
    def inputs(self) -> int:
        return sum(part.inputs for part in self.parts)

    @property
    def outputs(self) -> int:
        return sum(part.outputs for part in self.parts)


@dataclass(frozen=True, slots=True)
class PluggedSlave:
    """``modules`` in the order of their slots; ``station_user``: the station's own octets of Set_Prm."""

    gsd: Gsd
    modules: tuple[PluggedModule, ...]
    station_user: bytes

    @property
    def identifiers(self) -> bytes:
        """Those of Chk_Cfg: a slot without a module before one with a module has :data:`EMPTY_SLOT`."""
        found = b""
        slot = 1
        for module in self.modules:
            found += EMPTY_SLOT * (module.slot - slot) + module.item.identifiers
            slot = module.slot + 1
        return found

    def difference(self, identifiers: bytes) -> tuple[int, str]:
        """The first slot where other identifiers differ, and the name of a module of the file that has those there."""
        place, slot = 0, 1
        for module in self.modules:
            own = EMPTY_SLOT * (module.slot - slot) + module.item.identifiers
            if identifiers[place : place + len(own)] != own:
                empty = identifiers[place : place + module.slot - slot]
                same = len(empty) - len(empty.lstrip(EMPTY_SLOT))
                place, slot = place + same, slot + same
                if place >= len(identifiers):
                    slot = module.slot
                break
            place, slot = place + len(own), module.slot + 1
        rest = identifiers[place:]
        fitting = [one for one in self.gsd.modules if one.identifiers and rest.startswith(one.identifiers)]
        longest = max(fitting, key=lambda one: len(one.identifiers), default=None)
        return slot, "" if longest is None else longest.name

    @property
    def user(self) -> bytes:
        """The user's octets of Set_Prm: the station's, then the modules'."""
        return self.station_user + b"".join(module.user for module in self.modules)

    @property
    def inputs(self) -> int:
        return sum(module.inputs for module in self.modules)

    @property
    def outputs(self) -> int:
        return sum(module.outputs for module in self.modules)

    def takes(self, identifiers: bytes) -> bool:
        """Whether a Chk_Cfg names these modules; empty slots after the last one may be named or not."""
        wanted = self.identifiers
        return identifiers.startswith(wanted) and not identifiers[len(wanted) :].strip(EMPTY_SLOT)

    def complaint(self, user: bytes) -> str | None:
        """What is wrong with the user's octets of a Set_Prm; None if they fit.

        Octets after those of the modules are taken as far as the file allows so many (assumed: blocks that a master
        adds).
        """
        wanted, most = len(self.user), self.gsd.most_parameters
        if len(user) < wanted:
            return f"{len(user)} octets of parameters instead of {wanted}"
        if most is not None and len(user) > max(most, wanted):
            return f"{len(user)} octets of parameters, the file allows {max(most, wanted)}"
        place = 0
        parts: list[tuple[str, UserParameters, int]] = [("", self.gsd.parameters, len(self.station_user))]
        parts += [(f"slot {one.slot}, ", one.item.parameters, len(one.user)) for one in self.modules]
        for name, parameters, length in parts:
            wrong = parameters.complaint(user[place : place + length])
            if wrong is not None:
                return name + wrong
            place += length
        return None


def plug_slave(
    gsd: Gsd,
    modules: Mapping[int, str | int | None],
    parameters: Mapping[int, Mapping[str, str | float]] | None = None,
) -> PluggedSlave:
    """A slave with a module by name or number in each of these slots, which count from 1; None for an empty one.

    What the file puts into a slot of a new project is there where ``modules`` does not name the slot, and the only
    module of a slave that has one.  ``parameters``: values by name, by slot; slot 0 stands for the station itself.
    Raises :class:`PlugError`.
    """
    wrong = next((slot for slot in modules if not 1 <= slot <= gsd.most_modules), None)
    if wrong is not None:
        raise PlugError(f"slot {wrong} is given, the station has {_slots(gsd)}", slot=wrong)
    chosen: dict[int, ModuleItem] = {}
    for slot, wanted in (_usual(gsd, modules) | dict(modules)).items():
        if wanted is not None:
            chosen[slot] = _find(gsd, slot, wanted)
    if not chosen and not gsd.modular:
        raise PlugError(f"the file has {len(gsd.modules)} modules, and one is to be named: {_listed(gsd.modules)}")
    given = parameters or {}
    for slot in given:
        if slot != STATION and slot not in chosen:
            raise PlugError(f"slot {slot} has parameters and no module", slot=slot, parameter=True)
    found = PluggedSlave(
        gsd,
        tuple(_plugged(slot, chosen[slot], given.get(slot, {})) for slot in sorted(chosen)),
        _changed(gsd.parameters, given.get(STATION, {}), STATION),
    )
    _check_lengths(found)
    return found


def _slots(gsd: Gsd) -> str:
    return "slot 1 only" if gsd.most_modules == 1 else f"slots 1 to {gsd.most_modules}"


def _listed(modules: Sequence[ModuleItem]) -> str:
    """Names, and numbers where names are not unique."""
    count = Counter(module.name for module in modules)
    names = (repr(one.name) if count[one.name] == 1 else f"{one.name!r} ({one.number})" for one in modules)
    return listed(list(names)) or "none"


def _usual(gsd: Gsd, named: Mapping[int, object]) -> dict[int, str | int | None]:
    """What a new project has, by the numbers of its modules or their names."""
    if gsd.slots:
        there = {module.number for module in gsd.modules}
        return {
            slot: one.default
            for slot, one in gsd.slots.items()
            if 1 <= slot <= gsd.most_modules and one.default in there
        }
    if len(gsd.modules) == 1 and not named:
        return {1: gsd.modules[0].name}
    preset = [one for one in gsd.modules if one.preset][: gsd.most_modules]
    return {slot: one.name if one.number is None else one.number for slot, one in enumerate(preset, 1)}


def _find(gsd: Gsd, slot: int, wanted: str | int) -> ModuleItem:
    """By its name in upper or lower case, else by its number; an integer by its number first."""
    word = str(wanted).strip()
    number = wanted if isinstance(wanted, int) else gsd_number(word)
    by_name = [module for module in gsd.modules if module.name.strip().casefold() == word.casefold()]
    by_number = [module for module in gsd.modules if number is not None and module.number == number]
    found = (by_number or by_name) if isinstance(wanted, int) else (by_name or by_number)
    if not found:
        hint = did_you_mean(word, [module.name for module in gsd.modules])
        raise PlugError(f"the file has no module {word!r}; it has {_listed(gsd.modules)}{hint}", slot=slot)
    place = gsd.slots.get(slot)
    if place is not None:
        taken = [module for module in found if place.takes(module.number)]
        if not taken:
            allowed = [module for module in gsd.modules if place.takes(module.number)]
            raise PlugError(f"slot {slot} takes no module {word!r}; it takes {_listed(allowed)}", slot=slot)
        found = taken
    if len({(one.identifiers, one.parameters.octets) for one in found}) > 1:
        numbers = ", ".join(str(one.number) for one in found)
        raise PlugError(f"the file has {len(found)} modules {word!r}, choose one by its number: {numbers}", slot=slot)
    return found[0]


def _plugged(slot: int, item: ModuleItem, given: Mapping[str, str | float]) -> PluggedModule:
    try:
        parts = parse_identifiers(item.identifiers)
    except DecodeError as exc:
        raise PlugError(f"the identifiers of {item.name!r} are cut off: {exc.detail}", slot=slot) from exc
    return PluggedModule(slot, item, _changed(item.parameters, given, slot), tuple(parts))


def _changed(parameters: UserParameters, given: Mapping[str, str | float], slot: int) -> bytes:
    try:
        return parameters.changed(given)
    except PlugError as exc:
        raise PlugError(f"slot {slot}: {exc}" if slot else str(exc), slot=slot, parameter=True) from exc


def _check_lengths(slave: PluggedSlave) -> None:
    gsd, inputs, outputs = slave.gsd, slave.inputs, slave.outputs
    user = len(slave.user)
    for what, octets, *limits in (
        ("inputs", inputs, MOST_DATA, gsd.most_inputs),
        ("outputs", outputs, MOST_DATA, gsd.most_outputs),
        ("inputs and outputs", inputs + outputs, gsd.most_data),
        ("identifiers", len(slave.identifiers), MOST_IDENTIFIERS),
        ("parameters", user, MOST_USER, gsd.most_parameters),
    ):
        most = min((limit for limit in limits if limit), default=octets)
        if octets > most:
            raise PlugError(f"{octets} octets of {what}, the station has room for {most}")
