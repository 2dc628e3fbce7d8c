"""Names for families of frames in filters.  Each bus has its own; these are independent of the bus."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = ["ACYCLIC", "CYCLIC", "NEUTRAL", "OTHER", "filters_of"]

CYCLIC, ACYCLIC = "cyclic", "acyclic"
#: Families without a bus.
OTHER = "other"
NEUTRAL = ("arp", "icmp", OTHER)


def filters_of(families: Iterable[str]) -> dict[str, frozenset[str]]:
    """The families that each name of a filter selects: one family, or all but cyclic frames."""
    every = dict.fromkeys((CYCLIC, *families, *NEUTRAL))
    words = {CYCLIC: frozenset({CYCLIC}), ACYCLIC: frozenset(every) - {CYCLIC}}
    return words | {family: frozenset({family}) for family in every}
