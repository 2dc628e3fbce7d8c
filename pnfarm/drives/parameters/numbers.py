"""The numbers by which a bus reaches a product's parameters.

A product's own files name its parameters as the maker does (``DRV.ACC``, ``P-0271``, ``Pt100``).  A bus gives each of
them a number: one by one in a ``numbers.csv``, or by the rule of the section ``numbering``
(:mod:`~pnfarm.drives.parameters.rows`).  A parameter without a number on a bus does not exist for a model on that bus,
and one may have several.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.drives.description.files import place_of
from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.drives.description.files import Where

__all__ = ["ParameterNumbers"]


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
