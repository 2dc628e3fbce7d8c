"""``identity: {gsdml: FILE}``: a maker's file in place of the keys that it gives."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pnfarm.buses.described import DescribedBus
from pnfarm.errors import ConfigError
from pnfarm.farm.file.choice import bus_of
from pnfarm.vocabulary.quoting import shown

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pnfarm.config.drive import DriveGroup
    from pnfarm.config.known import Known
    from pnfarm.vocabulary.issues import Location

__all__ = ["with_identities"]

_KEYS = ("gsdml",)
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
        for key in _KEYS:
            if key in group.identity:
                at = partial(report, ("drives", number, "identity", key))
                identity = _resolved(group, key, folder, known, at, notes)
                group = group.model_copy(update={"identity": identity})
        found.append(group)
    return found, notes


def _resolved(
    group: DriveGroup,
    key: str,
    folder: Path,
    known: Known,
    report: Callable[[str, str], None],
    notes: list[str],
) -> dict[str, Any]:
    own = {name: value for name, value in group.identity.items() if name != key}
    model, bus, file = known.model(group.model), bus_of(group), group.identity[key]
    if not isinstance(bus, DescribedBus) or bus.description_key != key:
        report(f"is no key of a drive on {bus.title}", "the keys of `identity` for this model")
        return own
    if not isinstance(file, str) or not file:
        report(f"is {shown(file)}", _ALLOWED)
        return own
    described = None if model is None else model.described
    if described is None:
        return own
    path = folder / Path(file).expanduser()
    try:
        found = bus.described_identity(path, described, own)
    except ConfigError as exc:
        report(str(exc), _ALLOWED)
        return own
    notes += [f"{group.name}: {path.name}: {note}" for note in found.notes]
    return _merged(found.overrides, own)


def _merged(found: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """The farm file's own keys count; of two mappings, each of its entries."""
    merged = dict(found)
    for key, value in own.items():
        known = merged.get(key)
        merged[key] = {**known, **value} if isinstance(known, Mapping) and isinstance(value, Mapping) else value
    return merged
