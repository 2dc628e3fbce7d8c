"""Triggers as people write them.

==============================  ==================================================================================
``now``                         the first step
``velocity > 1000``             the first step in which it holds; also ``>=``, ``<``, ``<=``, ``==``, ``!=``; the number
                                may have a unit
``zsw1.fault_present``          the first step in which a bit is 1, or a code is not 0
``velocity rising 1000``        an edge through a level; of a bit or a code also without the level; ``falling`` as well
``state changes``               another value than in the step before
``fault``, ``fault 702``        the drive raised a fault, any or this one
``connect``, ``disconnect``     and the other events of :data:`EVENTS`
``manual``                      a request of the API
==============================  ==================================================================================

``... on axis-01`` watches this drive or device, or these; otherwise any of those that are traced triggers.  The name
of a device's signal may have the device before it: ``island-1.pressure > 6.5 bar``.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.faults.events import InjectionBegan, InjectionEnded
from pnfarm.station.events import (
    Booted,
    ConnectionEstablished,
    ConnectionLost,
    ConnectionReleased,
    FaultRaised,
    FaultsCleared,
    PowerLost,
    PowerReturned,
    StateChanged,
    WarningChanged,
    WatchdogExpired,
)
from pnfarm.table import trace as codes
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import did_you_mean, shown

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.station.event import Event

__all__ = [
    "EVENTS",
    "OF_DRIVES",
    "TRIGGER",
    "EventTrigger",
    "SignalTrigger",
    "Trigger",
    "parse_trigger",
    "read_level",
    "read_number",
]

#: What is allowed, for error messages.
TRIGGER = (
    "now, manual, a comparison such as `velocity > 1000` or `island-1.pressure > 6.5 bar`, a bit such as "
    "`zsw1.fault_present`, an edge such as "
    "`velocity rising 1000` or `state changes`, or an event such as `fault 702`, each also with `on DRIVE`"
)
#: Longest text of a trigger, characters.
MAX_TEXT = 300

#: Events by name, in the order of the help; `injection` and `injection-end` take a kind or an id, the faults a number.
EVENTS: Mapping[str, tuple[type[Event], ...]] = {
    "fault": (FaultRaised,),
    "acknowledged": (FaultsCleared,),
    "warning": (WarningChanged,),
    "connect": (ConnectionEstablished,),
    "disconnect": (ConnectionLost, ConnectionReleased),
    "watchdog": (WatchdogExpired,),
    "power-on": (PowerReturned,),
    "power-off": (PowerLost,),
    "booted": (Booted,),
    "state-change": (StateChanged,),
    "injection": (InjectionBegan,),
    "injection-end": (InjectionEnded,),
}
#: Those that a device has not.
OF_DRIVES = frozenset({"fault", "acknowledged", "warning", "state-change"})
#: Events that take an argument.
_WITH_ARGUMENT = frozenset({"fault", "warning", "injection", "injection-end"})
_OPERATORS = {
    ">": codes.TRIGGER_ABOVE,
    ">=": codes.TRIGGER_AT_LEAST,
    "<": codes.TRIGGER_BELOW,
    "<=": codes.TRIGGER_AT_MOST,
    "==": codes.TRIGGER_EQUAL,
    "=": codes.TRIGGER_EQUAL,
    "!=": codes.TRIGGER_UNEQUAL,
}
_EDGES = {
    "rising": codes.TRIGGER_RISING,
    "falling": codes.TRIGGER_FALLING,
    "changes": codes.TRIGGER_CHANGES,
}
_ON = re.compile(r"(.*?)\s+on\s+(\S+)")
#: Only before a dot, in the name of a station, may it have a hyphen, which the names of events have.
_NAME = r"((?:[\w-]+\.)+\w+|[A-Za-z_]\w*)"
_UNIT = r"[%A-Za-zµμ°].*"
_LEVEL = rf"(\S+(?:\s+{_UNIT})?)"
_COMPARISON = re.compile(rf"{_NAME}\s*(>=|<=|==|!=|=|>|<)\s*{_LEVEL}")
_EDGE = re.compile(rf"{_NAME}\s+(rising|falling|changes)(?:\s+{_LEVEL})?", re.IGNORECASE)
_EVENT = re.compile(r"([A-Za-z][\w-]*)(?:\s+(\S+))?")
_SIGNAL = re.compile(_NAME)
_WITH_UNIT = re.compile(rf"([-+]?(?:0x[0-9a-f]+|[0-9.]+(?:e[-+]?[0-9]+)?))\s*({_UNIT})", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Trigger:
    """``on`` is a glob over drives and devices, "" for those that are traced; ``kind`` is one of ``TRIGGER_*``."""

    text: str
    kind: int = codes.TRIGGER_NOW
    on: str = ""


@dataclass(frozen=True, slots=True)
class SignalTrigger(Trigger):
    """A signal and a level; ``level`` None: an edge of a bit or a code, whose level is between 0 and 1."""

    signal: str = ""
    level: str | None = None


@dataclass(frozen=True, slots=True)
class EventTrigger(Trigger):
    """An event of :data:`EVENTS`, ``manual`` if it is none of them; ``argument`` "" for any."""

    event: str = ""
    argument: str = ""


def parse_trigger(text: object) -> Trigger:
    """A trigger from its text.  Raises :class:`Problem`."""
    if not isinstance(text, str) or not text.strip() or len(text) > MAX_TEXT or "\n" in text:
        raise Problem(f"is {shown(text)}", TRIGGER)
    whole = " ".join(text.split())
    body, on = (found[1], found[2]) if (found := _ON.fullmatch(whole)) else (whole, "")
    word = body.lower()
    if word == "now":
        return Trigger(whole, codes.TRIGGER_NOW, on)
    if word == "manual":
        return EventTrigger(whole, codes.TRIGGER_EVENT, on, "manual")
    if match := _COMPARISON.fullmatch(body):
        return SignalTrigger(whole, _OPERATORS[match[2]], on, match[1], match[3])
    if match := _EDGE.fullmatch(body):
        kind = _EDGES[match[2].lower()]
        if kind == codes.TRIGGER_CHANGES and match[3] is not None:
            raise Problem(f"{shown(whole)}: `changes` takes no level", "`state changes`, or `velocity rising 1000`")
        return SignalTrigger(whole, kind, on, match[1], match[3])
    if (match := _EVENT.fullmatch(body)) and match[1].lower() in EVENTS:
        event, argument = match[1].lower(), match[2] or ""
        if argument and event not in _WITH_ARGUMENT:
            raise Problem(f"{shown(whole)}: {event} takes nothing after it but `on DRIVE`", TRIGGER)
        return EventTrigger(whole, codes.TRIGGER_EVENT, on, event, argument)
    if _SIGNAL.fullmatch(body):
        return SignalTrigger(whole, codes.TRIGGER_UNEQUAL, on, body, "0")
    near = did_you_mean(body.partition(" ")[0], [*EVENTS, "now", "manual"])
    raise Problem(f"{shown(whole)} is not a trigger{near}", TRIGGER)


def read_level(text: str) -> tuple[float | None, str]:
    """A number and its unit, without blanks, empty without one; None if it begins with no number."""
    number, found = read_number(text), _WITH_UNIT.fullmatch(text)
    if number is not None or found is None:
        return number, ""
    return read_number(found[1]), "".join(found[2].split())


def read_number(text: str) -> float | None:
    """A level: a decimal or 0x number, ``true`` or ``false``; None if it is none of these."""
    word = text.strip().lower()
    if word in {"true", "false"}:
        return float(word == "true")
    try:
        value = float(int(word, 16)) if word.startswith(("0x", "-0x")) else float(word)
    except (ValueError, OverflowError):
        return None
    return value if math.isfinite(value) else None
