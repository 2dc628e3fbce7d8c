"""Effects of writing one parameter on another: ``[[consequence]]``, as the manual states them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.drives.description.files import required
from pnfarm.drives.parameters.parameter import Backing
from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from pnfarm.drives.parameters.numbers import ParameterNumbers
    from pnfarm.drives.parameters.parameter import Parameter

__all__ = ["Consequence", "read_consequences"]


@dataclass(frozen=True, slots=True)
class Consequence:
    """Writing ``value`` to one of ``subindexes`` of ``pnu`` makes ``other_subindex`` of ``other`` become ``to``."""

    pnu: int
    subindexes: tuple[int, ...]
    value: int
    other: int
    other_subindex: int
    to: int
    source: str

    def follows(self, pnu: int, subindex: int, values: Sequence[int]) -> bool:
        """Whether writing ``values`` from ``subindex`` on triggers it."""
        return pnu == self.pnu and any(
            value == self.value and subindex + offset in self.subindexes for offset, value in enumerate(values)
        )


def read_consequences(
    tables: Sequence[Mapping[str, Any]],
    parameters: Mapping[int, Parameter],
    numbers: ParameterNumbers,
    file: Path,
) -> tuple[Consequence, ...]:
    """Check and build them; raises :class:`ConfigError` that names the entry."""
    found = []
    for index, table in enumerate(tables, 1):
        where = f"{file}, consequence {index}"
        entry = Consequence(
            pnu=numbers.of(required(table, "pnu", where), where),
            subindexes=tuple(required(table, "subindexes", where)),
            value=required(table, "value", where),
            other=numbers.of(required(table, "other", where), where),
            other_subindex=required(table, "other_subindex", where),
            to=required(table, "to", where),
            source=required(table, "source", where),
        )
        cause, effect = parameters.get(entry.pnu), parameters.get(entry.other)
        stored = {Backing.STORED, Backing.FIELD}
        if cause is None or cause.backing not in stored or effect is None or effect.backing not in stored:
            raise ConfigError(f"{where}: names a parameter that does not exist or is not stored")
        if entry.other_subindex >= max(effect.elements, 1) or not effect.minimum <= entry.to <= effect.maximum:
            raise ConfigError(f"{where}: {entry.to} does not fit element {entry.other_subindex} of {entry.other}")
        found.append(entry)
    return tuple(found)
