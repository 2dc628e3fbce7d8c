"""Lost connections, each with its reason, and how long each station was away: from the entries of an event log."""

from __future__ import annotations

from collections import Counter, defaultdict, deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from pnfarm.buses.registry import fault_kinds
from pnfarm.faults.effects.servo import SERVO
from pnfarm.faults.signals import SIGNALS
from tests.soak.judge import KEPT, Check

__all__ = ["GRACE_SECONDS", "HARMLESS", "Losses"]

#: A connection may break so long after its reason ended: a contested address is probed for up to 13 s.
GRACE_SECONDS = 15.0
#: A controller gives a connection up so long after it ran again: a call's, an alarm's or a frame's time is over.
BEHIND_SECONDS = 3.0
#: Faults of one slave that disturb the others of its line, where telegrams meet.
ON_LINE = frozenset({"line-noise", "delay", "late-frames", "duplicate", "reorder"})
#: Entries of one moment.
SAME_SECONDS = 0.05
UNEXPLAINED = "unexplained"
#: Kept entries: of more than a minute.
RECENT = 10_000
#: Kinds of faults on an axis or a signal: they break no connection, and are no reason for a loss.
HARMLESS = frozenset(kind.name for kind in fault_kinds().values() if {SERVO, SIGNALS} & set(kind.effect.needs))
_LOST = ("connection lost", "ar aborted")
_BACK = ("connection established", "ar established")
#: Ends that are no losses.
_RELEASED = ("connection released", "ar released")
#: A station without power, or that boots, by the entries that it leaves.
_POWER = ("power off", "power on")


@dataclass(slots=True)
class Reason:
    """Something that may break a connection, from ``begin`` to ``end`` (inf: it goes on)."""

    what: str
    begin: float
    end: float = float("inf")


@dataclass(slots=True)
class Losses:
    """``clock``: the key of an entry's time, s; ``shares_line``: whether a station is one of a line's slaves."""

    clock: str
    shares_line: Callable[[str], bool] = field(default=lambda _: False)
    by_reason: Counter[str] = field(default_factory=Counter)
    longest: dict[str, tuple[float, str]] = field(default_factory=dict)
    #: Stations without a connection: since when, and why.
    away: dict[str, tuple[float, str]] = field(default_factory=dict)
    #: The newest entries of the whole log, short: what happened around a loss.
    recent: deque[tuple[float, str]] = field(default_factory=lambda: deque(maxlen=RECENT))
    _reasons: defaultdict[str, dict[str, Reason]] = field(default_factory=lambda: defaultdict(dict))
    #: Losses without a reason: station, time, the entry as text, and when it happened by the farm's own clock.
    _without: list[tuple[str, float, str, float]] = field(default_factory=list)
    _numbers: int = 0

    def begin(self, what: str, at: float) -> Reason:
        """Something that may break every connection begins; whoever did it sets its end."""
        self._numbers += 1
        return self._reasons[""].setdefault(f"outage {self._numbers}", Reason(what, at))

    def entry(self, entry: Mapping[str, Any]) -> None:
        """One entry of the log, in order."""
        at, event, drive = float(entry[self.clock]), entry["event"], str(entry.get("drive", ""))
        station = drive.partition(".")[0]
        more = (str(entry[key]) for key in ("kind", "id", "reason", "cause", "farm_late_seconds") if key in entry)
        self.recent.append((at, " ".join((drive, event, *more))))
        reasons = self._reasons[station]
        happened = float(entry.get("farm_seconds", at))
        if event == "fault injected" and entry["kind"] not in HARMLESS:
            reasons[entry["id"]] = Reason(entry["kind"], at)
            self._found_late(station, entry["kind"], happened)
        elif event == "injected fault ended" and entry["id"] in reasons:
            reasons[entry["id"]].end = at
        elif event in _POWER:
            reasons[event] = Reason("power cycle", at, at)
        elif event in _LOST:
            self._lost(station, entry, at)
        elif event in _RELEASED:
            self.away.setdefault(station, (at, self._why(station, entry, at) or "released"))
        elif event in _BACK:
            self._back(station, at)
        self._forget(reasons, at)

    def _forget(self, reasons: dict[str, Reason], at: float) -> None:
        for name in [name for name, reason in reasons.items() if reason.end < at - 4 * GRACE_SECONDS]:
            del reasons[name]

    def _why(self, station: str, entry: Mapping[str, Any], at: float) -> str:
        """What began last of what is in force, or else of what was a moment ago; "" if there is nothing."""
        if entry.get("cause") == "farm":
            return "the farm was late"
        found = [
            reason
            for place in (station, "")
            for reason in self._reasons[place].values()
            if reason.begin <= at <= reason.end + GRACE_SECONDS
        ]
        if self.shares_line(station):
            found += [
                reason
                for mate, reasons in self._reasons.items()
                if mate and mate != station and self.shares_line(mate)
                for reason in reasons.values()
                if reason.what in ON_LINE and reason.begin <= at <= reason.end + GRACE_SECONDS
            ]
        return max(found, key=lambda reason: (reason.end >= at, reason.begin)).what if found else ""

    def _lost(self, station: str, entry: Mapping[str, Any], at: float) -> None:
        why = self._why(station, entry, at) or UNEXPLAINED
        if why == UNEXPLAINED:
            told = {key: value for key, value in entry.items() if not key.endswith("_seconds") or key == self.clock}
            happened = float(entry.get("farm_seconds", at))
            self._without.append((station, at, f"{station} at {at:.3f}: {told}", happened))
        self.by_reason[why] += 1
        self.away.setdefault(station, (at, why))

    def _found_late(self, station: str, what: str, happened: float) -> None:
        """A fault that breaks connections at once is in the log behind all that it broke, with its own time."""
        for one in [one for one in self._without if one[0] == station and one[3] >= happened - SAME_SECONDS]:
            self._without.remove(one)
            self.by_reason[UNEXPLAINED] -= 1
            self.by_reason[what] += 1
            if station in self.away:
                self.away[station] = self.away[station][0], what

    def stood(self, what: str, begin: float, seconds: float) -> None:
        """What runs the stations did not run itself, which is known only now: the reason of what has none."""
        for one in [one for one in self._without if begin <= one[1] <= begin + seconds + BEHIND_SECONDS]:
            self._without.remove(one)
            self.by_reason[UNEXPLAINED] -= 1
            self.by_reason[what] += 1

    def around(self, at: float, seconds: float) -> list[str]:
        """What was in the log so long before and after a moment."""
        return [f"{when - at:+.3f} {told}" for when, told in self.recent if abs(when - at) <= seconds]

    @property
    def unexplained_at(self) -> dict[str, float]:
        """When each was."""
        return {told: at for _, at, told, _ in self._without}

    @property
    def unexplained(self) -> list[str]:
        return [told for _, _, told, _ in self._without]

    def _back(self, station: str, at: float) -> None:
        if station not in self.away:
            return
        lost, why = self.away.pop(station)
        ends = [reason.end for place in (station, "") for reason in self._reasons[place].values() if reason.end <= at]
        seconds = at - max([lost, *ends])
        if seconds > self.longest.get(why, (-1.0, ""))[0]:
            self.longest[why] = seconds, station

    def checks(self, whose: str = "") -> list[Check]:
        """At the end, when every station is to be back."""
        whose = f" {whose}" if whose else ""
        told = f"{sum(self.by_reason.values()):,} losses, {len(+self.by_reason)} reasons"
        slowest = max(self.longest.items(), key=lambda item: item[1][0], default=None)
        back = "none was lost" if slowest is None else f"the longest {slowest[1][0]:.1f} s, after {slowest[0]}"
        return [
            Check(
                f"each lost connection{whose} has a reason",
                ok=not self.unexplained,
                told="; ".join(self.unexplained[:3]) or told,
            ),
            Check(f"each station{whose} is back", ok=not self.away, told=f"away: {self.away}" if self.away else back),
        ]

    def report(self) -> dict[str, Any]:
        return {
            "losses": {why: count for why, count in self.by_reason.most_common() if count},
            "unexplained": self.unexplained[:KEPT],
            "returns": {why: [seconds, station] for why, (seconds, station) in sorted(self.longest.items())},
        }
