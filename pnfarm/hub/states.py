"""Whether a shard can be asked: a table, driven by the answers to the question that each shard gets every second.

=======  =====================================================================================================
UNKNOWN  not asked yet
UP       answers
SILENT   did not answer in time once: it is still asked for its drives, each time for a bounded time
AWAY     does not answer, or not as a farm does: requests for its drives are refused at once
=======  =====================================================================================================

One answer that is late is no loss: a machine under load has them.  A port without a listener, or where another
program does, has no such excuse.
"""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["TRANSITIONS", "ShardEvent", "ShardState"]


class ShardState(StrEnum):
    """See the module's docstring."""

    UNKNOWN = "unknown"
    UP = "up"
    SILENT = "silent"
    AWAY = "away"


class ShardEvent(StrEnum):
    """What came of a question: an answer of a farm, none in time, or something that is none."""

    ANSWERED = "answered"
    MISSED = "missed"
    REFUSED = "refused"


_S, _E = ShardState, ShardEvent
#: (state, what came of a question) -> state; complete.
TRANSITIONS: Mapping[tuple[ShardState, ShardEvent], ShardState] = {
    (_S.UNKNOWN, _E.ANSWERED): _S.UP,
    (_S.UNKNOWN, _E.MISSED): _S.AWAY,
    (_S.UNKNOWN, _E.REFUSED): _S.AWAY,
    (_S.UP, _E.ANSWERED): _S.UP,
    (_S.UP, _E.MISSED): _S.SILENT,
    (_S.UP, _E.REFUSED): _S.AWAY,
    (_S.SILENT, _E.ANSWERED): _S.UP,
    (_S.SILENT, _E.MISSED): _S.AWAY,
    (_S.SILENT, _E.REFUSED): _S.AWAY,
    (_S.AWAY, _E.ANSWERED): _S.UP,
    (_S.AWAY, _E.MISSED): _S.AWAY,
    (_S.AWAY, _E.REFUSED): _S.AWAY,
}
