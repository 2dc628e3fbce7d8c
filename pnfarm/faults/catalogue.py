"""The catalogue: every kind that can be injected, by its name in command line, API, scenario files and Python.

Kinds are found, not listed: each file of a package of kinds declares its own (:func:`kinds_in`).  Those of
:mod:`pnfarm.faults.kinds` are for any drive; a bus brings its own, and :mod:`pnfarm.buses.registry` puts them together.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from pnfarm.errors import InternalError
from pnfarm.faults import kinds as neutral_kinds
from pnfarm.faults.kind import InjectionKind, KindOnBus
from pnfarm.faults.plan import InjectionSpec

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from types import ModuleType

__all__ = ["Catalogue", "InjectionKind", "kinds_in", "neutral"]

_FAMILIES = ("frames", "link", "cyclic", "liveness", "connection", "records", "alarms", "drive", "signals")


def kinds_in(package: ModuleType) -> tuple[InjectionKind, ...]:
    """The kinds that the modules of a package declare in ``KIND`` or ``KINDS``, in the order of the modules' names."""
    found: list[InjectionKind] = []
    for module in sorted(pkgutil.iter_modules(package.__path__), key=lambda module: module.name):
        declared = vars(importlib.import_module(f"{package.__name__}.{module.name}"))
        if {"KIND", "KINDS"}.isdisjoint(declared):
            raise InternalError(f"{package.__name__}.{module.name} declares no KIND")
        found += declared["KINDS"] if "KINDS" in declared else (declared["KIND"],)
    return tuple(found)


def neutral() -> tuple[InjectionKind, ...]:
    """The kinds for any drive and any link."""
    return kinds_in(neutral_kinds)


class Catalogue(Mapping[str, InjectionKind]):
    """Kinds by name, family by family; ``on``: bus -> kind -> what differs there.

    A bus may speak of kinds that are not there.  Raises :class:`InternalError` for a duplicate name or an unknown
    family.
    """

    def __init__(
        self, kinds: Iterable[InjectionKind], on: Mapping[str, Mapping[str, KindOnBus]] = MappingProxyType({})
    ) -> None:
        self._kinds: dict[str, InjectionKind] = {}
        for kind in sorted(kinds, key=_order):
            if kind.name in self._kinds:
                raise InternalError(f"there are two kinds of injections named {kind.name}")
            told = {bus: some[kind.name] for bus, some in on.items() if kind.name in some}
            self._kinds[kind.name] = kind.joined(told) if told else kind

    def __getitem__(self, name: str) -> InjectionKind:
        return self._kinds[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._kinds)

    def __len__(self) -> int:
        return len(self._kinds)

    def parse(self, data: Mapping[str, Any]) -> InjectionSpec:
        """An injection from plain values; raises :class:`~.errors.InjectionError` with every wrong field."""
        return InjectionSpec.parse(data, self)

    def schema(self) -> dict[str, Any]:
        """The JSON Schema of what :meth:`parse` takes."""
        return InjectionSpec.schema_of(self)


def _order(kind: InjectionKind) -> tuple[int, int, str]:
    if kind.family not in _FAMILIES:
        raise InternalError(f"{kind.name} is of the family {kind.family!r}, not one of {', '.join(_FAMILIES)}")
    return _FAMILIES.index(kind.family), kind.place, kind.name
