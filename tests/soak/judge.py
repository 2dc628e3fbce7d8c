"""The verdict on a run: whether memory stayed flat, the event stream has no hole, and everything is as it was.

Nothing here starts or reads anything, so that each judgement can be shown data that it must refuse.
"""

from __future__ import annotations

import json
import re
from collections import Counter, deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pnfarm.api.events import parse_position

__all__ = [
    "KEPT", "MOST_GROWTH", "Check", "HubOrder", "LogReader", "Stream", "answered", "longest_pause", "same_as_before",
    "shown",
]  # fmt: skip

#: Memory may grow by this share in the second half of a run.
MOST_GROWTH = 0.01
#: Lines and findings that are kept of a log, for the report.
KEPT = 200
_SUSPICIOUS = re.compile(
    r"traceback|internal error|unhandled|never retrieved|task exception|never awaited", re.IGNORECASE
)
#: Levels that a fault on a drive may not cause.
_BAD_LEVELS = ("error", "critical", "exception")


@dataclass(frozen=True, slots=True)
class Check:
    """One line of the verdict; ``ok`` None: not judged, and why."""

    name: str
    ok: bool | None
    told: str


@dataclass(slots=True)
class Stream:
    """Messages of the event stream as they come: each number once and in order, each beginning with its end.

    ``asked`` are ids of injections that the farm acknowledged; the stream must name each (:meth:`acknowledged`).
    """

    last: int = 0
    entries: int = 0
    resumed: int = 0
    wrong: list[str] = field(default_factory=list)
    open: dict[tuple[str, str], int] = field(default_factory=dict)
    kinds: Counter[str] = field(default_factory=Counter)
    _asked: dict[str, None] = field(default_factory=dict)
    _early: deque[str] = field(default_factory=lambda: deque(maxlen=1000))

    def _note(self, what: str) -> None:
        if len(self.wrong) < KEPT:
            self.wrong.append(what)

    def message(self, kind: str, number: str, data: str) -> None:
        """One message: its type, its id, its data."""
        if kind == "gap":
            self._note(f"after {self.last} the farm says that entries are lost: {data}")
            return
        entry = json.loads(data)
        sequence = int(number.rpartition("-")[2])
        if sequence != self.last + 1:
            self._note(f"entry {sequence} came after {self.last}")
        if entry.get("sequence") != sequence:
            self._note(f"entry {sequence} names itself {entry.get('sequence')}")
        self.last = max(self.last, sequence)
        self.entries += 1
        self._entry(entry)

    def _entry(self, entry: Mapping[str, Any]) -> None:
        event = str(entry["event"])
        self.kinds[event] += 1
        name = str(entry.get("id", ""))
        if event == "fault injected":
            key = (name, entry["drive"])
            if key in self.open:
                self._note(f"{name} began on {entry['drive']} twice without an end")
            self.open[key] = entry["sequence"]
        elif event == "injected fault ended":
            # one that was cleared while it waited never began
            self.open.pop((name, entry["drive"]), None)
        elif event == "fault requested":
            if name in self._asked:
                del self._asked[name]
            else:
                self._early.append(name)

    def acknowledged(self, fault_id: str) -> None:
        """The farm answered that it injected this: the stream has it, or is to bring it."""
        if fault_id in self._early:
            self._early.remove(fault_id)
        else:
            self._asked[fault_id] = None

    def checks(self, newest: int) -> list[Check]:
        """At the end, when nothing is in force; ``newest`` is the number of the farm's last entry."""
        wrong = list(self.wrong)
        if self.last < newest:
            wrong.append(f"it ends at {self.last}, the farm's log at {newest}")
        if self._asked:
            wrong.append(f"{len(self._asked)} injections are missing: {' '.join(list(self._asked)[:5])}")
        told = f"{self.entries:,} entries, 1 to {self.last:,}, resumed {self.resumed} times"
        ended = [f"{name} on {drive}" for name, drive in self.open]
        return [
            Check("event stream complete", ok=not wrong and self.entries > 0, told="; ".join(wrong[:5]) or told),
            Check(
                "each injected fault ended",
                ok=not ended,
                told=f"{len(ended)} without an end: {', '.join(ended[:5])}"
                if ended
                else f"{self.kinds['fault injected']:,} began",
            ),
        ]


@dataclass(slots=True)
class HubOrder:
    """Messages of a hub's stream: each brings one entry of one shard's run, the one behind the last of that run.

    The id of a message is a position: the last number of each run (:mod:`pnfarm.hub.log`).
    """

    entries: int = 0
    wrong: list[str] = field(default_factory=list)
    _last: dict[str, int] = field(default_factory=dict)

    def message(self, kind: str, number: str, data: str) -> None:
        """One message: its type, its id, its data."""
        if kind == "gap":
            self._note(f"the hub says that entries are lost: {data}")
            return
        position = parse_position(number) or {}
        moved = {run: last for run, last in position.items() if last != self._last.get(run, 0)}
        self.entries += 1
        ahead = [last - self._last.get(run, 0) for run, last in moved.items()]
        if ahead != [1]:
            self._note(f"{moved} behind { ({run: self._last.get(run, 0) for run in moved}) }: {data[:200]}")
        self._last |= moved

    def _note(self, what: str) -> None:
        if len(self.wrong) < KEPT:
            self.wrong.append(what)

    def check(self) -> Check:
        told = f"{self.entries:,} entries of {len(self._last)} runs"
        return Check(
            "event stream of the hub complete", ok=not self.wrong and self.entries > 0,
            told="; ".join(self.wrong[:5]) or told,
        )  # fmt: skip


@dataclass(slots=True)
class LogReader:
    """Lines of a process's log (JSON, or plain text): how many of each level, and those that may not be."""

    levels: Counter[str] = field(default_factory=Counter)
    suspicious: list[str] = field(default_factory=list)
    last: deque[str] = field(default_factory=lambda: deque(maxlen=KEPT))

    def line(self, text: str) -> None:
        self.last.append(text)
        try:
            entry = json.loads(text)
            level = str(entry.get("level", "")) if isinstance(entry, dict) else ""
        except ValueError:
            level = ""
        self.levels[level] += 1
        if (level in _BAD_LEVELS or _SUSPICIOUS.search(text)) and len(self.suspicious) < KEPT:
            self.suspicious.append(text[:2000])

    def check(self, name: str) -> Check:
        told = f"{sum(self.levels.values()):,} lines"
        if self.suspicious:
            told = f"{len(self.suspicious)} of {told}, the first: {self.suspicious[0][:300]}"
        return Check(f"log of the {name} without internal errors", ok=not self.suspicious, told=told)


def longest_pause(times: Sequence[float], since: float, until: float) -> float:
    """The longest time between two of ``times`` that overlaps a period, or from the last one to its end."""
    pairs = zip(times, [*times[1:], until], strict=True) if times else []
    return max((later - one for one, later in pairs if later > since and one < until), default=until - since)


def answered(failures: Sequence[str], pauses: Sequence[tuple[str, float]], ran: float, told: str) -> list[Check]:
    """Whether each request was answered as it should be.

    ``pauses``: requests that had no answer in time, with the longest pause of the farm's process meanwhile. One beyond
    ``ran`` seconds is the machine's doing, and nothing is known of the request then.
    """
    starved = [f"{what}: the farm's process did not run for {pause:.0f} s" for what, pause in pauses if pause > ran]
    wrong = [*failures, *(f"{what}: no answer in time" for what, pause in pauses if pause <= ran)]
    found = [Check("each request answered as it should", ok=not wrong, told="; ".join(wrong[:5]) or told)]
    if starved:
        found.append(Check("the machine let the farm run", ok=None, told="; ".join(starved[:3])))
    return found


def same_as_before(name: str, before: Mapping[str, Any], after: Mapping[str, Any], slack: Mapping[str, int]) -> Check:
    """What a side holds when it is quiet, before the first fault and behind the last; ``slack``: what may be more.

    Numbers may not grow beyond the slack, other values may not change.  Keys without a slack of 0 or more are compared
    as they are.
    """
    differ = []
    for key in sorted({*before, *after}):
        old, new = before.get(key), after.get(key)
        if isinstance(old, int) and isinstance(new, int) and key in slack:
            if new > old + slack[key]:
                differ.append(f"{key} {old} -> {new}")
        elif old != new:
            differ.append(f"{key} {old} -> {new}")
    told = "; ".join(differ) or ", ".join(f"{key} {value}" for key, value in after.items() if isinstance(value, int))
    return Check(f"the {name} holds what it held", ok=not differ, told=told)


def shown(checks: Sequence[Check]) -> str:
    """The verdict as a table of text."""
    words = {True: "ok", False: "FAILED", None: "not judged"}
    width = max((len(check.name) for check in checks), default=0)
    return "\n".join(f"{check.name:<{width}}  {words[check.ok]:<10}  {check.told}" for check in checks)
