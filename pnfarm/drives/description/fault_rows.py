"""``faults.csv``: the faults and warnings of a drive, each with its reaction and its source."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pnfarm.drives.description.files import integer, place_of, rows
from pnfarm.drives.description.parts import REACTIONS, Fault, fault_number
from pnfarm.drives.parameters.parameter import Backing
from pnfarm.errors import ConfigError
from pnfarm.table.axis_codes import FAULT_ACTIONS, FAULT_WORDS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pnfarm.drives.description.files import ModelFiles, Where
    from pnfarm.drives.description.model import Model
    from pnfarm.drives.parameters.numbers import ParameterNumbers
    from pnfarm.drives.parameters.parameter import Parameter

__all__ = ["number_of_fault", "read_faults", "with_faults"]

FILE = "faults.csv"


def number_of_fault(text: str, where: Where) -> int:
    """A fault's number as its manual writes it; raises :class:`ConfigError` for other text."""
    try:
        return fault_number(text)
    except ValueError:
        raise ConfigError(f"{place_of(where)}: {text!r} is not a number or a pair such as 32-1") from None


def read_faults(
    files: ModelFiles, without: frozenset[str], parameters: Mapping[int, Parameter], numbers: ParameterNumbers
) -> dict[int, Fault]:
    """Every fault by its number, in the order of the files; ``without`` are those that this model does not have."""
    found: dict[int, tuple[str, dict[str, str]]] = {}
    for path in files.wanted(FILE):
        here: set[int] = set()
        for where, row in rows(path):
            number = number_of_fault(row["number"], f"{where}, number")
            if number in here or not 0 < number < 1 << 24:
                raise ConfigError(f"{where}, number: {number} is given twice or is not within 1..{(1 << 24) - 1}")
            here.add(number)
            found[number] = where, row
    for label in without:
        if found.pop(number_of_fault(label, f"{files.folder}, without"), None) is None:
            raise ConfigError(f"{files.folder}, without: there is no fault {label}")
    faults = {number: _fault(number, row, where, parameters, numbers) for number, (where, row) in found.items()}
    if sum(fault.action > 0 for fault in faults.values()) > FAULT_ACTIONS:
        raise ConfigError(f"{files.folder / FILE}, action: more than {FAULT_ACTIONS} faults have one")
    return faults


def with_faults(model: Model, own: Sequence[Fault]) -> Model:
    """The model with these faults beside its own; one of the same number keeps what causes it, and its codes."""
    known = model.faults
    added = {fault.number: _in_place(known[fault.number], fault) if fault.number in known else fault for fault in own}
    return replace(model, faults=dict(known) | added) if own else model


def _in_place(known: Fault, own: Fault) -> Fault:
    return replace(known, name=own.name, warning=own.warning, reaction=own.reaction, source=own.source, note=own.note)


def _fault(
    number: int, row: Mapping[str, str], where: str, parameters: Mapping[int, Parameter], numbers: ParameterNumbers
) -> Fault:
    if row["kind"] not in {"fault", "warning"}:
        raise ConfigError(f"{where}, kind: {row['kind']!r} is neither fault nor warning")
    warning = row["kind"] == "warning"
    if row["reaction"] not in ({""} if warning else REACTIONS):
        raise ConfigError(
            f"{where}, reaction: {row['reaction']!r} is not one of {', '.join(REACTIONS)} (empty for a warning)"
        )
    if not row["source"] or (row["source"] == "assumed" and not row["note"]):
        raise ConfigError(f"{where}, source: a fault needs its source, an assumed one its reason")
    word = integer(row.get("word", ""), where, "word", 0)
    if not 0 <= word <= 0xFFFF or (word and number >= FAULT_WORDS):
        raise ConfigError(f"{where}, word: {word} does not fit in 16 bits, or its fault is above {FAULT_WORDS - 1}")
    namur = integer(row.get("namur", ""), where, "namur", 0)
    if not 0 <= namur <= 15 or (namur and number >= FAULT_WORDS):
        raise ConfigError(f"{where}, namur: {namur} is not within 0..15, or its fault is above {FAULT_WORDS - 1}")
    action = _action(row, where, parameters, numbers)
    reaction = REACTIONS.get(row["reaction"], 0)
    return Fault(number, row["name"], warning, reaction, row["cause"], row["source"], row["note"], word, action, namur)


def _action(row: Mapping[str, str], where: str, parameters: Mapping[int, Parameter], numbers: ParameterNumbers) -> int:
    """The PNU of the parameter that enables the fault, 0 for none."""
    if not row.get("action"):
        return 0
    action = numbers.of(row["action"], f"{where}, action")
    parameter = parameters.get(action)
    if parameter is None or parameter.backing is not Backing.STORED or parameter.elements:
        raise ConfigError(f"{where}, action: {action} is not a plain parameter that is stored")
    if row["kind"] == "warning":
        raise ConfigError(f"{where}, action: only a fault can have one, not a warning")
    return action
