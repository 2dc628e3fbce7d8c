"""A drive's identity out of its maker's GSD file, so that a project that holds the file configures the drive.

A telegram's module is the one whose identifiers have the telegram's lengths and whose name has its number; where no
name has it, the only one with these lengths and without the number of another.  Its identifiers are those of a station
with this module alone, in the first slot that takes it, beside what the file puts into each new project.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.described import DescribedIdentity
from pnfarm.buses.profibus.device.extended_diagnosis import extended_octets
from pnfarm.buses.profibus.device.product import Product
from pnfarm.buses.telegram_names import is_numbered, numbers_in
from pnfarm.errors import DecodeError
from pnfarm.protocols.profibus.gsd.station import plug_slave
from pnfarm.protocols.profibus.gsd.values import PlugError, listed
from pnfarm.protocols.profibus.wire.dp import HEAD_OCTETS, parse_identifiers

if TYPE_CHECKING:
    from pnfarm.drives.description.model import Model
    from pnfarm.drives.telegrams.telegram import Telegram
    from pnfarm.protocols.profibus.gsd.document import Gsd, ModuleItem
    from pnfarm.protocols.profibus.gsd.station import PluggedSlave

    #: Octets of outputs and of inputs.
    _Lengths = tuple[int, int]

__all__ = ["identity_of"]

#: Key of ``identity`` -> attribute of the file, and its most characters.
_TEXTS = {"order_number": ("order_number", 20), "station_type": ("model", 25)}


def identity_of(gsd: Gsd, model: Model) -> DescribedIdentity:
    """What the farm file's ``identity`` would hold.

    ``notes`` say what the file does not have, or what the drive cannot take from it.
    """
    found: dict[str, Any] = {"device": gsd.ident}
    notes: list[str] = []
    for key, (attribute, most) in _TEXTS.items():
        text = str(getattr(gsd, attribute)).strip()
        if text.isascii() and text.isprintable() and 0 < len(text) <= most:
            found[key] = text
        elif text:
            notes.append(f"its {key.replace('_', ' ')} {text[:40]!r} is not one of up to {most} ASCII characters")
    telegrams = _telegrams(gsd, model, notes)
    missing = [number for number in model.profidrive.telegrams if number not in telegrams]
    if missing:
        numbers, several, it = ", ".join(map(str, missing)), "s"[: len(missing) - 1], "them" if missing[1:] else "it"
        what = f"it has no module for telegram{several} {numbers} by length and name"
        notes.append(what + (f"; the drive does not have {it}" if telegrams else ""))
    if telegrams:
        found |= {
            "telegrams": {number: slave.identifiers.hex(" ") for number, slave in telegrams.items()},
            "without": missing,
        }
        if user := next(iter(telegrams.values())).station_user:
            found["parameters"] = user.hex(" ")
    diagnosis = HEAD_OCTETS + extended_octets(Product.of(model))
    if gsd.most_diagnosis < diagnosis:
        notes.append(f"the drive's diagnosis has up to {diagnosis} octets, the file allows {gsd.most_diagnosis}")
    if not gsd.v1:
        notes.append("it is of a slave without DP-V1, whose parameters no record has")
    return DescribedIdentity(found, tuple(notes))


def _telegrams(gsd: Gsd, model: Model, notes: list[str]) -> dict[int, PluggedSlave]:
    """The station with each telegram that is found, by its number."""
    by_lengths: dict[_Lengths, list[ModuleItem]] = {}
    for module in gsd.modules:
        if not module.safety and (lengths := _module_lengths(module)) is not None:
            by_lengths.setdefault(lengths, []).append(module)
    wanted = [_lengths(telegram) for telegram in model.profidrive.telegrams.values()]
    found: dict[int, PluggedSlave] = {}
    owners: dict[bytes, int] = {}
    for number, telegram in model.profidrive.telegrams.items():
        lengths = _lengths(telegram)
        fitting = by_lengths.get(lengths, [])
        named = [module for module in fitting if number in numbers_in(module.name)]
        named.sort(key=lambda module: not is_numbered(module.name))
        if not named and wanted.count(lengths) == 1:
            named = [module for module in fitting if not numbers_in(module.name) & model.profidrive.telegrams.keys()]
            named = named if len(named) == 1 else []
        slave = None if not named else _plugged(gsd, named[0], notes)
        if slave is None:
            continue
        if len({module.identifiers for module in named}) > 1:
            others = listed([module.name for module in named[1:]])
            notes.append(f"of its modules for telegram {number}, {named[0].name!r} is taken, and not {others}")
        if (owner := owners.setdefault(slave.identifiers, number)) != number:
            notes.append(
                f"its module for telegram {number} has the identifiers of telegram {owner}, and means that one"
            )
            continue
        found[number] = slave
    return found


def _plugged(gsd: Gsd, module: ModuleItem, notes: list[str]) -> PluggedSlave | None:
    """The station with this module, None where the file does not permit it."""
    slot = next((slot for slot, one in sorted(gsd.slots.items()) if one.takes(module.number)), 1)
    try:
        slave = plug_slave(gsd, {slot: module.name if module.number is None else module.number})
    except PlugError as exc:
        notes.append(f"its module {module.name!r} is left out: {exc}")
        return None
    if (slave.outputs, slave.inputs) != _module_lengths(module):
        notes.append(f"its module {module.name!r} is left out: other modules of each station have data, too")
        return None
    return slave


def _lengths(telegram: Telegram) -> _Lengths:
    return 2 * len(telegram.output), 2 * len(telegram.input)


def _module_lengths(module: ModuleItem) -> _Lengths | None:
    """None for identifiers that are cut off."""
    try:
        parts = parse_identifiers(module.identifiers)
    except DecodeError:
        return None
    return sum(part.outputs for part in parts), sum(part.inputs for part in parts)
