"""The summary of a capture: the traffic between each two stations."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from pnfarm.captures.stations import Stations

__all__ = ["Conversation", "Conversations", "CyclicChannel"]

#: Pairs of stations that get a line of their own; further ones are added to the last line.
MOST = 2048
#: Different reasons of one counter.
MOST_REASONS = 32


@dataclass(frozen=True, slots=True)
class CyclicChannel:
    """One direction of cyclic data; ``figures`` are plain JSON values, the same keys for every bus."""

    source: bytes
    destination: bytes
    figures: dict[str, Any]


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
    """By the two addresses, in either direction."""

    def __init__(self) -> None:
        self._pairs: dict[tuple[bytes, bytes], Conversation] = {}

    def between(self, source: bytes, destination: bytes) -> Conversation:
        pair = (source, destination) if source < destination else (destination, source)
        found = self._pairs.get(pair)
        if found is None:
            found = self._pairs.setdefault(pair if len(self._pairs) < MOST else (b"", b""), Conversation())
        return found

    def as_list(self, stations: Stations, channels: Iterable[CyclicChannel]) -> list[dict[str, Any]]:
        """Plain JSON values, the longest conversation first."""
        cyclic: dict[tuple[bytes, bytes], list[dict[str, Any]]] = {}
        for channel in channels:
            source, to = channel.source, channel.destination
            found = cyclic.setdefault((source, to) if source < to else (to, source), [])
            found.append({"from": stations.name(source), **channel.figures})
        return [
            {
                "between": sorted(stations.name(mac) for mac in pair) if pair[0] else ["others"],
                "frames": talk.frames,
                "seconds": (talk.last_ns - talk.first_ns) / 1e9,
                "families": dict(talk.families),
                "counts": dict(sorted(talk.counts.items())),
                "reasons": {key: dict(reasons) for key, reasons in sorted(talk.reasons.items())},
                "cyclic": cyclic.get(pair, []),
            }
            for pair, talk in sorted(self._pairs.items(), key=lambda entry: -entry[1].frames)
        ]
