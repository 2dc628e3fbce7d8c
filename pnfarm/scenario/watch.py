"""Conditions on drives while time passes: no change of state, fault or connection between two checks is missed.

A watch is shown the drives at each check (:meth:`Watch.look`), and each entry of the farm's log (:meth:`Watch.note`),
which says what a drive's signals were when it happened: a state that ended before the next check counts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.drives.description.parts import fault_label
from pnfarm.signals.device_signal import DeviceSignal, split_name
from pnfarm.station import events
from pnfarm.station.signals import EVENT_SIGNALS, SIGNALS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from pnfarm.signals.conditions import Condition
    from pnfarm.signals.device_signal import LiveDevices
    from pnfarm.station.axis import Axis
    from pnfarm.station.event_log import LogEntry
    from pnfarm.vocabulary.conditions import Value

__all__ = ["Watch", "as_text", "signals_of_event"]

#: Of a drive without its supply, and of one that begins to boot.
_NO_FAULT: Mapping[str, Value] = {"fault": 0, "faulted": False, "warning": 0}


def signals_of_event(entry: LogEntry) -> dict[str, Value]:
    """The signals that an event sets, with their values at its time."""
    match entry.what:
        case events.StateChanged(after=after):
            return {"state": f"S{after}" if after else "boot"}
        case events.FaultRaised(number=number):
            return {"fault": number, "faulted": True}
        case events.FaultsCleared():
            return {"fault": 0, "faulted": False}
        case events.WarningChanged(number=number):
            return {"warning": number}
        case events.ConnectionEstablished():
            return {"connected": True}
        case events.PowerLost():
            return {"powered": False, "state": "off", "connected": False, **_NO_FAULT}
        case events.PowerReturned():
            return {"powered": True, "state": "boot", **_NO_FAULT}
        case _:
            return {}


class Watch:
    """``conditions`` by drive, or by device where they are about devices alone.

    ``held_ns``: when a drive's came true first; ``all_ns``: when all were true at once first; ``broken_ns``: when one
    that must hold was not.  What happened before the first check does not count, though its entry comes later.

    From :meth:`hold` on, what counts is that none is false.
    """

    def __init__(self, conditions: Mapping[str, Condition], stations: Mapping[str, Axis], devices: LiveDevices) -> None:
        self._conditions = conditions
        self._stations = stations
        self._devices = devices
        self.held_ns: dict[str, int] = {}
        self.all_ns: int | None = None
        self.broken_ns: dict[str, int] = {}
        #: The longest time between two checks, ns, and the last check but one.
        self.unseen_ns = self.before_ns = 0
        self._must_hold = False
        self._since_ns = 0
        self._looked_ns: int | None = None
        self._true: set[str] = set()
        self._seen: dict[str, dict[str, Value]] = {}
        #: Of each drive that has a fault: the oldest one, which is its signal ``fault``.
        self._faults: dict[str, int] = {}

    def polled(self, *, virtual: bool) -> bool:
        """Whether it has a signal whose changes are no events, so that it must be looked at often."""
        return any(
            name not in EVENT_SIGNALS and not (virtual and isinstance(signal, DeviceSignal) and signal.signal.stepped)
            for condition in self._conditions.values()
            for name, signal in condition.signals.items()
        )

    @property
    def all_held(self) -> bool:
        """Whether each drive's condition was true at some time."""
        return len(self.held_ns) == len(self._conditions)

    def look(self, now: int) -> None:
        """Read every drive."""
        if self._looked_ns is not None:
            self.unseen_ns = max(self.unseen_ns, now - self._looked_ns)
            self.before_ns = self._looked_ns
        else:
            self._since_ns = self.before_ns = now
            faults = {name: int(SIGNALS["fault"].now(axis)) for name, axis in self._watched_drives()}
            self._faults = {name: number for name, number in faults.items() if number}
        self._looked_ns = now
        self._seen.clear()
        for name in self._conditions:
            self._take(name, now, None)

    def hold(self, now: int) -> None:
        """From now on each must hold."""
        self._must_hold, self._since_ns, self._looked_ns, self.unseen_ns = True, now, now, 0
        self.look(now)

    def note(self, drive: str, entry: LogEntry) -> None:
        """Something happened to a drive, perhaps one of these."""
        if drive not in self._conditions:
            return
        changed = signals_of_event(entry)
        lost = isinstance(entry.what, events.ConnectionLost | events.ConnectionReleased)
        if isinstance(entry.what, events.FaultRaised):
            changed["fault"] = self._faults.setdefault(drive, entry.what.number)
        elif isinstance(entry.what, events.FaultsCleared | events.PowerLost):
            self._faults.pop(drive, None)
        if changed or lost:
            # what happened since the last check, in order: the table may show a later moment already
            known = self._seen.setdefault(drive, {})
            known.update(changed)
            if lost:
                # whether another controller's connection is left is in the table
                known.pop("connected", None)
            self._take(drive, entry.now_ns, known)

    def _watched_drives(self) -> Iterator[tuple[str, Axis]]:
        return ((name, self._stations[name]) for name in self._conditions if name in self._stations)

    def _take(self, name: str, now: int, known: Mapping[str, Value] | None) -> None:
        if now < self._since_ns:
            return
        if self._conditions[name].holds(self._stations.get(name), self._devices, known):
            self.held_ns.setdefault(name, now)
            self._true.add(name)
            if self.all_ns is None and len(self._true) == len(self._conditions):
                self.all_ns = now
        else:
            self._true.discard(name)
            if self._must_hold:
                self.broken_ns.setdefault(name, now)

    def values(self) -> dict[str, dict[str, Any]]:
        """The present values of the signals, by drive or device; faults as the manual writes them."""
        return {
            name: {
                key: fault_label(int(value)) if condition.signals[key].form == "fault" else value
                for key, value in condition.values(self._stations.get(name), self._devices).items()
                # of a device's own where devices are what it is about
                if name in self._stations or split_name(key)[0] == name
            }
            for name, condition in self._conditions.items()
        }

    def shown(self) -> dict[str, dict[str, str]]:
        """The same for people, with units."""
        return {name: self._conditions[name].shown(values) for name, values in self.values().items()}


def as_text(shown: Mapping[str, str]) -> str:
    """The values of one drive: ``velocity = 22.82 rpm, state = S4``."""
    return ", ".join(f"{signal} = {value}" for signal, value in shown.items())
