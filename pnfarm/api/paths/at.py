"""The moment at which something begins, by the clock of a farm or of a hub: for what shall begin on several at once."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from fastapi import Query

from pnfarm.web.errors import RequestError

if TYPE_CHECKING:
    from pnfarm.api.paths.host import Host

__all__ = ["At", "start_ns"]

#: How far ahead a start may be set by the clock.
MOST_AHEAD_SECONDS = 10.0

At = Annotated[
    float | None,
    Query(
        description="Begin at this moment of the farm's clock (`GET clock`), seconds; it lies ahead, by at most "
        f"{MOST_AHEAD_SECONDS:g} s."
    ),
]


def start_ns(at: float | None, host: Host) -> int:
    """The start in ns of the host's clock, 0 for at once; raises :class:`RequestError` for one that is not ahead."""
    if at is None:
        return 0
    ahead = at - host.now() / 1e9
    # a NaN is not in the range either
    if not 0 <= ahead <= MOST_AHEAD_SECONDS:
        what = f"is {-ahead:.3f} s ago" if ahead < 0 else f"is {ahead:.3f} s ahead"
        allowed = (
            f"a moment of the {host.kind}'s clock at most {MOST_AHEAD_SECONDS:g} s ahead; `after` has no such limit"
        )
        raise RequestError(f"at: {what}; allowed: {allowed}", [{"field": "at", "what": what, "allowed": allowed}])
    return round(at * 1e9)
