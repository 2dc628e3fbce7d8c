"""Which kinds of faults the drives on a bus can have."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.registry import BUSES, bus, fault_kinds
from pnfarm.faults.effects.sockets import SOCKETS
from pnfarm.faults.signals import SIGNALS

if TYPE_CHECKING:
    from pnfarm.faults.kind import InjectionKind

__all__ = ["fits", "kinds_of"]


def fits(kind: InjectionKind, name: str) -> bool:
    """Whether drives on this bus can have this kind: the bus does not refuse it, and it is not another bus's own.

    Signals only devices have.
    """
    if name in kind.on and kind.on[name].refused:
        return False
    if SIGNALS in kind.effect.needs:
        return False
    if SOCKETS in kind.effect.needs and not bus(name).uses_sockets:
        return False
    return not any(kind.name == own.name for other in BUSES if other != name for own in bus(other).fault_kinds())


def kinds_of(name: str) -> list[InjectionKind]:
    """All that drives on a bus can have."""
    return [kind for kind in fault_kinds().values() if fits(kind, name)]
