"""What a hub answers in part: the commands print what there is, then what is missing, and say so by their exit code."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.errors import RemoteError
from pnfarm.vocabulary.quoting import shortened

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["raise_for_missing"]


def raise_for_missing(found: Mapping[str, Any]) -> None:
    """Raises :class:`RemoteError` with what a hub's answer lacks; a farm's own answer lacks nothing."""
    missing = found.get("unreachable") or []
    if not_hit := found.get("not_hit"):
        first = not_hit[0]
        raise RemoteError(f"not hit: {shortened([one['drive'] for one in not_hit], joint=', ')}: {first['why']}")
    if not missing:
        return
    if isinstance(missing, dict):
        raise RemoteError(f"{found.get('name', 'the drive')} is unreachable: {missing['reason']}")
    if isinstance(missing[0], str):
        raise RemoteError(
            f"unknown for {shortened(missing, joint=', ')}, which are unreachable: the last known state is shown"
        )
    shards = [one["shard"] for one in missing]
    raise RemoteError(f"unreachable, their part is missing: {shortened(shards, joint=', ')}: {missing[0]['reason']}")
