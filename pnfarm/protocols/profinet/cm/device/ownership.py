"""Ownership of submodules (IEC 61158-5-10, ownership of submodules; ARInfo of the field SubmoduleState).

Theory.  An expected submodule belongs to at most one of the present ARs:

* free: it goes to the AR that connects;
* a controller's: another controller finds it locked; so does a supervisor, unless the owner's ARProperties allow the
  takeover.  Then the supervisor owns it, and the owner gets an alarm ("controlled by supervisor");
* a supervisor's: it is locked for all others.

When its owner's AR ends, a submodule passes to the oldest AR that still expects it, which gets an alarm ("released")
and writes its parameters again. Two controllers that expect different submodules of one device never meet here: that
is a shared device.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.wire.cm.expected import ArInfo

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from pnfarm.protocols.profinet.cm.ar import Ar, ExpectedKey
    from pnfarm.protocols.profinet.wire.cm.connect import ArBlockReq
    from pnfarm.protocols.profinet.wire.cm.expected import ExpectedApi

__all__ = ["Claim", "claim", "expected_keys", "pass_on", "settle_claim"]


@dataclass(slots=True)
class Claim:
    """What a new AR gets.  ``taken``: by the key of the AR that loses them."""

    owned: set[ExpectedKey] = field(default_factory=set)
    locked: dict[ExpectedKey, ArInfo] = field(default_factory=dict)
    taken: dict[int, set[ExpectedKey]] = field(default_factory=dict)


def expected_keys(expected: Iterable[ExpectedApi]) -> list[ExpectedKey]:
    """(api, slot, subslot) of every expected submodule, in the order of the request."""
    return [(e.api, e.slot, s.subslot) for e in expected for s in e.submodules]


def claim(request: ArBlockReq, expected: Iterable[ExpectedApi], ars: Iterable[Ar]) -> Claim:
    """The submodules that the requested AR would own next to ``ars``; changes nothing."""
    standing = tuple(ars)
    result = Claim()
    for key in expected_keys(expected):
        owner = next((ar for ar in standing if key in ar.owned), None)
        if owner is None:
            result.owned.add(key)
        elif owner.supervisor:
            result.locked[key] = ArInfo.LOCKED_BY_IO_SUPERVISOR
        elif request.supervisor and owner.takeover_allowed:
            result.owned.add(key)
            result.taken.setdefault(owner.key, set()).add(key)
        else:
            result.locked[key] = ArInfo.LOCKED_BY_IO_CONTROLLER
    return result


def settle_claim(claimed: Claim, ar: Ar, ars: Sequence[Ar]) -> None:
    """``ar`` has what it claimed; the ARs that lose find it locked by a supervisor."""
    for loser in ars:
        for key in claimed.taken.get(loser.key, ()):
            loser.owned.discard(key)
            loser.pending.discard(key)
            loser.locked[key] = ArInfo.LOCKED_BY_IO_SUPERVISOR
    _tell_owners((*ars, ar))


def pass_on(ending: Ar, ars: Sequence[Ar]) -> dict[int, set[ExpectedKey]]:
    """Hand what ``ending`` owned to the oldest of ``ars`` that expects it; by the key of the new owner."""
    heirs: dict[int, set[ExpectedKey]] = {}
    waiting = set(ending.owned)
    for ar in ars:
        if ar is ending:
            continue
        for key in waiting & ar.locked.keys():
            del ar.locked[key]
            ar.owned.add(key)
            waiting.discard(key)
            heirs.setdefault(ar.key, set()).add(key)
    ending.owned.clear()
    _tell_owners(ars)
    return heirs


def _tell_owners(ars: Sequence[Ar]) -> None:
    """Each AR that finds a submodule locked sees the kind of its owner, who may be another now."""
    for ar in ars:
        for key in ar.locked:
            owner = next((o for o in ars if key in o.owned), None)
            if owner is not None:
                ar.locked[key] = ArInfo.LOCKED_BY_IO_SUPERVISOR if owner.supervisor else ArInfo.LOCKED_BY_IO_CONTROLLER
