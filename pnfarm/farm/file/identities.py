"""``gsdml: FILE`` or ``gsd: FILE`` of a drive, also in ``identity``: a maker's file in place of keys."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from pnfarm.buses.described import AccessPointError, DescribedBus
from pnfarm.errors import ConfigError
from pnfarm.farm.file.choice import bus_of
from pnfarm.vocabulary.quoting import shown
from pnfarm.vocabulary.regular_file import beside

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from pnfarm.config.drive import DriveGroup
    from pnfarm.config.known import Known
    from pnfarm.vocabulary.issues import Location

__all__ = ["with_identities"]

_KEYS = ("gsdml", "gsd")
_ALLOWED = "the maker's file, its name relative to the folder of this file"


def with_identities(
    groups: Sequence[DriveGroup], folder: Path, known: Known, report: Callable[[Location, str, str], None]
) -> tuple[list[DriveGroup], list[str]]:
    """The groups with what the files say in place of their names, and sentences about what they do not say.

    Files that cannot be read are reported at their key.
    """
    found: list[DriveGroup] = []
    notes: list[str] = []
    for number, group in enumerate(groups):
        at = partial(_report_at, report, ("drives", number))
        asked: dict[Location, Any] = {("identity", key): group.identity[key] for key in _KEYS if key in group.identity}
        asked |= {(key,): file for key in _KEYS if (file := getattr(group, key, None)) is not None}
        if not asked and getattr(group, "access_point", None) is not None:
            at(("access_point",), "is that of a maker's file, and there is none", f"{_KEYS[0]}: FILE beside it")
        if len(asked) > 1:
            at(("identity", *next(iter(asked))[1:]), "is given twice", "the file once, as a key of the drive")
        for place, file in list(asked.items())[-1:]:
            identity, described = _resolved(group, place, file, folder, known, at, notes)
            group = group.model_copy(update={"identity": identity}).adopting(described)
        found.append(group)
    return found, notes


def _report_at(
    report: Callable[[Location, str, str], None], at: Location, place: Location, what: str, allowed: str
) -> None:
    report((*at, *place), what, allowed)


def _resolved(
    group: DriveGroup,
    place: Location,
    file: Any,
    folder: Path,
    known: Known,
    report: Callable[[Location, str, str], None],
    notes: list[str],
) -> tuple[dict[str, Any], Any]:
    """``identity`` with what the file says, and what else a running drive has of the file."""
    own = {name: value for name, value in group.identity.items() if name not in _KEYS}
    model, bus = known.model(group.model), bus_of(group)
    if not isinstance(bus, DescribedBus) or bus.description_key != place[-1]:
        report(place, f"is no key of a drive on {bus.title}", "the keys of `identity` for this model")
        return own, None
    if not isinstance(file, str) or not file:
        report(place, f"is {shown(file)}", _ALLOWED)
        return own, None
    described = None if model is None else model.described
    if described is None:
        return own, None
    path = beside(folder, file)
    try:
        found = bus.described_identity(path, described, own, getattr(group, "access_point", None))
    except AccessPointError as exc:
        chosen: Location = ("access_point",) if getattr(group, "access_point", None) is not None else place
        report(chosen, f"{path.name}: {exc}", "an access point of the file")
        return own, None
    except ConfigError as exc:
        report(place, str(exc), _ALLOWED)
        return own, None
    notes += [f"{group.name}: {path.name}: {note}" for note in found.notes]
    return _merged(found.overrides, own), found.file


def _merged(found: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """The farm file's own keys count; of two mappings, each of its entries."""
    merged = dict(found)
    for key, value in own.items():
        known = merged.get(key)
        merged[key] = _merged(known, value) if isinstance(known, Mapping) and isinstance(value, Mapping) else value
    return merged
