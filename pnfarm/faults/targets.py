"""Which drives an injection hits: those that its globs match, of these a share, of these so many at most.

The choice depends on the seed and the drives' names alone: the same seed chooses the same drives, and a larger share of
the same drives contains the smaller one.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from pnfarm.errors import ConfigError
from pnfarm.faults.effects.connection import CONNECTION
from pnfarm.faults.errors import InjectionError
from pnfarm.faults.plan import matching

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from pnfarm.faults.effects.parts import InjectedDrive
    from pnfarm.faults.kind import KindOnBus
    from pnfarm.faults.plan import InjectionSpec

__all__ = ["Named", "Targets", "check_bus", "check_parts", "chosen", "targets_of"]


class Named(Protocol):
    """What a drive is chosen by: its names, and those of its model."""

    @property
    def names(self) -> tuple[str, ...]: ...

    @property
    def models(self) -> tuple[str, ...]: ...


@dataclass(frozen=True, slots=True)
class Targets:
    """Whom an injection would hit.  ``cannot``: drive -> why it refuses the kind; ``left_out``: matched, not chosen."""

    spec: InjectionSpec
    drives: tuple[str, ...]
    cannot: Mapping[str, str]
    left_out: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "dry_run": True,
            "kind": self.spec.kind.name,
            "spec": self.spec.as_dict(),
            "drives": list(self.drives),
            "cannot": [{"drive": drive, "why": why} for drive, why in self.cannot.items()],
            "left_out": list(self.left_out),
        }


def chosen(
    spec: InjectionSpec, drives: Mapping[str, Named], hit: Callable[[str], Iterable[str]] = lambda name: (name,)
) -> tuple[list[str], list[str]]:
    """(the drives that the injection hits, those that its globs match besides), both in the farm's order.

    ``hit``: whom a name means: of a station with several axes the node or its axes.

    Raises :class:`InjectionError` for a glob that matches none.
    """
    names = matching(spec.on, {name: (drive.names, drive.models) for name, drive in drives.items()})
    names = list(dict.fromkeys(one for name in names for one in hit(name)))
    wanted = len(names)
    if spec.share is not None:
        # at least one: a share of few drives is not zero
        wanted = max(1, math.floor(wanted * spec.share / 100.0 + 0.5))
    if spec.most is not None:
        wanted = min(wanted, spec.most)
    if wanted >= len(names):
        return names, []
    first = set(sorted(names, key=lambda name: _rank(spec, name))[:wanted])
    return [name for name in names if name in first], [name for name in names if name not in first]


def _rank(spec: InjectionSpec, name: str) -> bytes:
    return hashlib.sha256(f"reach\0{spec.seed or 0}\0{name}".encode()).digest()


def targets_of(
    spec: InjectionSpec, drives: Mapping[str, InjectedDrive], check: Callable[[str, InjectionSpec], None]
) -> Targets:
    """What putting this injection in force would reach, without changing anything.

    ``check`` raises :class:`InjectionError` for a further reason why a drive, by its name, cannot.
    """
    names, left_out = chosen(spec, drives, lambda name: drives[name].hit_by(spec.kind.effect.needs))
    able: list[str] = []
    cannot: dict[str, str] = {}
    for name in names:
        try:
            check_parts(drives[name], spec)
            check(name, spec)
            spec.kind.effect(spec, drives[name])
        except InjectionError as exc:
            cannot[name] = "; ".join(what for _, what, _ in exc.issues)
        except ConfigError as exc:
            cannot[name] = str(exc)
        else:
            able.append(name)
    return Targets(spec, tuple(able), cannot, tuple(left_out))


def check_parts(drive: InjectedDrive, spec: InjectionSpec) -> None:
    """Raises :class:`InjectionError` for a kind or a parameter that is not for this drive's bus, or lacks a part."""
    check_bus(drive.name, drive.bus, spec)
    for part in spec.kind.effect.needs:
        if drive.find(part) is None:
            raise InjectionError([("kind", f"{drive.name} has no {part.title}, which {spec.kind.name} needs", "")])
    if (spec.cycles or spec.after_cycles) and drive.find(CONNECTION) is None:
        field = "cycles" if spec.cycles else "after_cycles"
        raise InjectionError([(field, f"{drive.name} has no {CONNECTION.title} whose cycles could be counted", "")])


def check_bus(name: str, bus: str, spec: InjectionSpec) -> None:
    """Raises :class:`InjectionError` for a kind that the bus of a drive refuses, or a parameter that is not for it."""
    here = spec.kind.on.get(bus)
    if here is not None and here.refused:
        raise InjectionError([("kind", f"{name} is on {here.title}: {here.refused}", "")])
    if bus:
        _check_params(name, spec, here)


def _check_params(drive: str, spec: InjectionSpec, here: KindOnBus | None) -> None:
    """Raises :class:`InjectionError` for a parameter that only drives on other buses have."""
    for name in spec.params:
        owners = [one.title for one in spec.kind.on.values() if name in one.params]
        if owners and (here is None or name not in here.params):
            others = {other for one in spec.kind.on.values() if one is not here for other in one.params}
            allowed = ", ".join(param for param in spec.kind.params if param not in others)
            what = f"is for drives on {' and '.join(owners)}, which {drive} is not"
            raise InjectionError([(f"params.{name}", what, allowed or "no parameter")])
