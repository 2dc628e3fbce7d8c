"""``sets/NAME.toml``: what a maker's drives do, as far as a public source says so.

A set chooses readings of the model's open points, and gives the model's faults the codes and texts that a PLC sees of
that maker's drives; each entry has its source.  What no source says stays the model's own.  ``gaps`` says what that is.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pnfarm.drives.description.files import read_toml, required
from pnfarm.drives.description.parts import REACTIONS, BehaviourSet, Fact, MakersFault
from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from pnfarm.drives.description.files import ModelFiles
    from pnfarm.drives.description.model import Model
    from pnfarm.drives.description.parts import Fault, Point

__all__ = ["SET", "read_sets", "with_set"]

#: The key of the farm file's ``behaviour`` that names a set.
SET = "set"
FOLDER = "sets"
_KEYS = {"title", "gaps", "sources", "behaviour", "fault"}
_FAULT_KEYS = {"fault", "code", "name", "reaction", "diagnosis", "source"}


def read_sets(
    files: ModelFiles, points: Sequence[Point], faults: Mapping[int, Fault], diagnoses: Mapping[int, int]
) -> dict[str, BehaviourSet]:
    """The model's sets by name, none without the folder; raises :class:`ConfigError` that names the entry."""
    known = {point.name: point for point in points}
    paths = [path for folder in files.folders for path in sorted((folder / FOLDER).glob("*.toml"))]
    return {path.stem: _read(path, known, faults, diagnoses) for path in paths}


def _read(
    path: Path, points: Mapping[str, Point], faults: Mapping[int, Fault], diagnoses: Mapping[int, int]
) -> BehaviourSet:
    data = read_toml(path)
    if unknown := sorted(data.keys() - _KEYS):
        raise ConfigError(f"{path}, {unknown[0]}: unknown; allowed are {', '.join(sorted(_KEYS))}")
    readings: dict[str, Fact] = {}
    for name, entry in data.get("behaviour", {}).items():
        where = f"{path}, behaviour.{name}"
        reading = required(entry, "reading", where)
        if name not in points or reading not in points[name].readings:
            raise ConfigError(f"{where}: the model has no such point, or no reading {reading!r} of it")
        readings[name] = Fact(reading, required(entry, "source", where))
    entries = tuple(
        _fault(entry, f"{path}, fault {place}", faults, diagnoses)
        for place, entry in enumerate(data.get("fault", ()), 1)
    )
    if len({one.fault for one in entries}) != len(entries):
        raise ConfigError(f"{path}, fault: one is given twice")
    return BehaviourSet(
        path.stem,
        str(required(data, "title", str(path))),
        str(required(data, "gaps", str(path))),
        data.get("sources", {}),
        readings,
        entries,
    )


def _fault(
    entry: Mapping[str, Any], where: str, faults: Mapping[int, Fault], diagnoses: Mapping[int, int]
) -> MakersFault:
    if unknown := sorted(entry.keys() - _FAULT_KEYS):
        raise ConfigError(f"{where}, {unknown[0]}: unknown; allowed are {', '.join(sorted(_FAULT_KEYS))}")
    number, code, name, source = (required(entry, key, where) for key in ("fault", "code", "name", "source"))
    if number not in faults:
        raise ConfigError(f"{where}, fault: the model has no fault {number!r}")
    if type(code) is not int or not 0 < code <= 0xFFFF:
        raise ConfigError(f"{where}, code: {code!r} is not within 1..65535")
    if faults[number].warning and code in faults:
        raise ConfigError(f"{where}, code: {code} is the number of another fault of the model")
    reaction = entry.get("reaction")
    if reaction is not None and (faults[number].warning or reaction not in REACTIONS):
        raise ConfigError(f"{where}, reaction: {reaction!r} is not one of {', '.join(REACTIONS)}, of a fault")
    diagnosis = entry.get("diagnosis")
    if diagnosis is not None and (number not in diagnoses or type(diagnosis) is not int or not diagnosis >> 16 == 0):
        raise ConfigError(f"{where}, diagnosis: not a ChannelErrorType, or the model's fault has none")
    return MakersFault(number, code, name, source, None if reaction is None else REACTIONS[reaction], diagnosis)


def with_set(model: Model, name: str) -> Model:
    """The model with the faults of a set; a warning gets the maker's number, a fault keeps its own and the code."""
    faults: dict[int, Fault] = {}
    made = {one.fault: one for one in model.behaviour_sets[name].faults}
    for number, fault in model.faults.items():
        own = made.get(number)
        if own is not None:
            source, reaction = f"{name}: {own.source}", fault.reaction if own.reaction is None else own.reaction
            fault = replace(fault, name=own.name, word=own.code, reaction=reaction, source=source, note="")
            if fault.warning:
                fault = replace(fault, number=own.code)
        faults[fault.number] = fault
    diagnoses = {one.fault: one.diagnosis for one in made.values() if one.diagnosis is not None}
    return replace(model, faults=faults, diagnoses={**model.diagnoses, **diagnoses})
