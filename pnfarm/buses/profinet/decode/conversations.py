"""The summary of a capture: what two stations had to do with each other."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.buses.profinet.decode.channels import Channel
    from pnfarm.buses.profinet.decode.packet import Shared

__all__ = ["Conversation", "Conversations"]

#: Pairs of stations that are told apart; what comes after them is added to the last line.
MOST = 2048
#: Different reasons of one counter.
MOST_REASONS = 32


@dataclass(slots=True)
class Conversation:
    """``counts`` by counter, ``reasons`` by counter and reason."""

    frames: int = 0
    first_ns: int = 0
    last_ns: int = 0
    families: Counter[str] = field(default_factory=Counter)
    counts: Counter[str] = field(default_factory=Counter)
    reasons: dict[str, Counter[str]] = field(default_factory=dict)

    def add(self, time_ns: int, family: str) -> None:
        if not self.frames:
            self.first_ns = time_ns
        self.frames += 1
        self.last_ns = time_ns
        self.families[family] += 1

    def count(self, counts: Mapping[str, str]) -> None:
        for name, reason in counts.items():
            self.counts[name] += 1
            if reason:
                reasons = self.reasons.setdefault(name, Counter())
                reasons[reason if reason in reasons or len(reasons) < MOST_REASONS else "other"] += 1


class Conversations:
    """By the two addresses, whoever speaks."""

    def __init__(self) -> None:
        self._pairs: dict[tuple[bytes, bytes], Conversation] = {}

    def between(self, source: bytes, destination: bytes) -> Conversation:
        pair = (source, destination) if source < destination else (destination, source)
        found = self._pairs.get(pair)
        if found is None:
            found = self._pairs.setdefault(pair if len(self._pairs) < MOST else (b"", b""), Conversation())
        return found

    def as_list(self, shared: Shared) -> list[dict[str, Any]]:
        """Plain JSON values, the longest conversation first."""
        channels: dict[tuple[bytes, bytes], list[tuple[bytes, Channel]]] = {}
        for (to, source, _), channel in shared.channels.items():
            if channel.frames:
                pair = (source, to) if source < to else (to, source)
                channels.setdefault(pair, []).append((source, channel))
        found = []
        for pair, talk in sorted(self._pairs.items(), key=lambda entry: -entry[1].frames):
            name = shared.stations.name
            found.append(
                {
                    "between": sorted(name(mac) for mac in pair) if pair[0] else ["others"],
                    "frames": talk.frames,
                    "seconds": (talk.last_ns - talk.first_ns) / 1e9,
                    "families": dict(talk.families),
                    "counts": dict(sorted(talk.counts.items())),
                    "reasons": {key: dict(reasons) for key, reasons in sorted(talk.reasons.items())},
                    "cyclic": [_channel(name(source), channel) for source, channel in channels.get(pair, ())],
                }
            )
        return found


def _channel(source: str, channel: Channel) -> dict[str, Any]:
    count = channel.interval_count
    template = channel.template
    return {
        "from": source,
        "frame_id": f"0x{channel.frame_id:04X}",
        "telegram": template.telegram if template is not None else None,
        "frames": channel.frames,
        "cycle_seconds": channel.cycle_ns / 1e9 if channel.cycle_ns else None,
        "interval_min_seconds": channel.shortest_ns / 1e9 if count else None,
        "interval_mean_seconds": channel.total_ns / count / 1e9 if count else None,
        "interval_max_seconds": channel.longest_ns / 1e9 if count else None,
        "gaps": channel.gaps,
        "longest_gap_seconds": channel.gap_ns / 1e9 if channel.gaps else None,
        "frames_missing": channel.missing,
        "counter_jumps": channel.jumps,
        "watchdog_gaps": channel.watchdogs,
    }
