"""The numbers by which a bus reaches a product's parameters.

A product's own files name its parameters as the maker does (``DRV.ACC``, ``P-0271``, ``Pt100``).  A bus gives each of
them a number: one by one in a ``numbers.csv``, or by the rule of the section ``numbering``.  A parameter without a
number on a bus does not exist for a model on that bus, and one may have several.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.drives.model_files import integer, place_of, rows
from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from pnfarm.drives.model_files import ModelFiles, Where
    from pnfarm.drives.numbering import Numbering

__all__ = ["NUMBERS_FILE", "ParameterNumbers", "numbered_rows"]

#: Columns: ``pnu``, ``id``, and any of ``parameters.csv`` whose cell, where it is not empty, counts on this bus.
NUMBERS_FILE = "numbers.csv"
Row = tuple[str, dict[str, str]]


class ParameterNumbers:
    """A product's parameters by name: each one's number on the bus, the first of several."""

    def __init__(self, numbers: Mapping[str, int]) -> None:
        self._numbers = numbers

    def of(self, parameter: str | int, where: Where) -> int:
        """The number of a parameter that a file names, or gives by its number; :class:`ConfigError` for another."""
        if isinstance(parameter, int):
            return parameter
        if parameter in self._numbers:
            return self._numbers[parameter]
        try:
            return int(parameter, 0)
        except ValueError:
            raise ConfigError(f"{place_of(where)}: there is no parameter {parameter!r}") from None

    def of_value(self, value: Any, where: Where) -> Any:
        """As :meth:`of`, of one or of several."""
        return tuple(self.of(each, where) for each in value) if isinstance(value, tuple) else self.of(value, where)


def numbered_rows(files: ModelFiles, own: Mapping[str, Row], numbering: Numbering) -> Iterator[tuple[int, str, Row]]:
    """Each number with the parameter's name and its row in the product's ``parameters.csv``."""
    lists = files.named(NUMBERS_FILE)
    if not lists and numbering.prefix:
        for name, (where, row) in own.items():
            number = numbering.number(name)
            if number is None:
                raise ConfigError(f"{where}, id: {name!r} is not written as the section numbering says")
            yield number, name, (where, row)
    for path in lists:
        for where, given in rows(path):
            number, name = integer(given.pop("pnu", ""), where, "pnu"), given.pop("id", "")
            if name not in own:
                raise ConfigError(f"{where}, id: no parameters.csv has {name!r}")
            place, row = own[name]
            changed = {column: cell for column, cell in given.items() if cell}
            if unknown := changed.keys() - row.keys():
                raise ConfigError(f"{where}, {min(unknown)}: not a column of parameters.csv")
            yield number, name, (f"{place}, changed by {where}", row | changed) if changed else (place, row)
