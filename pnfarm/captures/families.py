"""Words for families of frames, as filters take them.  A bus has its own; these are any bus's, or stand on none."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = ["ACYCLIC", "CYCLIC", "NEUTRAL", "OTHER", "filter_words"]

CYCLIC, ACYCLIC = "cyclic", "acyclic"
#: On no bus.
OTHER = "other"
NEUTRAL = ("arp", "icmp", OTHER)


def filter_words(families: Iterable[str]) -> dict[str, frozenset[str]]:
    """What each word of a filter lets through: a family of the buses or a neutral one, or all but cyclic frames."""
    every = dict.fromkeys((CYCLIC, *families, *NEUTRAL))
    words = {CYCLIC: frozenset({CYCLIC}), ACYCLIC: frozenset(every) - {CYCLIC}}
    return words | {family: frozenset({family}) for family in every}
