"""What each controller has found, configured and refused, and the line of the farm file to change: plain JSON values.

What is known of a station is made again when something happened to it, so that a view of thousands costs little.  Times
are seconds of the farm's clock.
"""

from __future__ import annotations

import difflib
import heapq
from functools import partial
from typing import TYPE_CHECKING, Any

from pnfarm.station.visits import VisitState
from pnfarm.vocabulary.issues import field_path
from pnfarm.wire.mac import format_mac

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from pnfarm.farm.core import FarmCore
    from pnfarm.station.absent import Wanted
    from pnfarm.station.station import Station
    from pnfarm.station.visits import Caller, Refusal, Visit
    from pnfarm.vocabulary.issues import Location

__all__ = ["MOST_CONTROLLERS", "Readiness", "joined_controllers"]

#: Controllers and tools in one answer; those that got least are left out.
MOST_CONTROLLERS = 64
#: How alike a name must be that is proposed for one that is missing.
_ALIKE = 0.6
#: Missing names whose nearest is known, and found in one view; stations among which it is found.
_MOST_NEAREST = 512
_NEW_AT_ONCE = 8
_POOL = 128
_NO_STATE = "unseen"
#: States of visits by what is lost without them.
_ORDER = {state.value: n for n, state in enumerate((VisitState.DATA, VisitState.STARTING, VisitState.REFUSED))}


class Readiness:
    """See the module's docstring; for one farm."""

    def __init__(self, core: FarmCore) -> None:
        self._core = core
        #: By station: what it was made of, and the result.
        self._known: dict[str, tuple[tuple[object, ...], dict[str, Any]]] = {}
        #: Name that is missing -> station with a similar one, or "".
        self._nearest: dict[str, str] = {}

    def update(self, most: int) -> bool:
        """Make at most this many stations again; whether all are as they are now."""
        for station in self._core.stations:
            seen = station.visits.revision, station.powered, station.device.name
            known = self._known.get(station.configured_name)
            if known is not None and known[0] == seen:
                continue
            if not most:
                return False
            most -= 1
            self._known[station.configured_name] = seen, self._station(station)
        return True

    def view(self, now: int) -> dict[str, Any]:
        """All stations as :meth:`update` made them, the controllers, and what these miss."""
        stations = [self._known[station.configured_name][1] for station in self._core.stations]
        called = {station.configured_name: station.device.name for station in self._core.stations}
        # what has the name by now, and what another shard has
        known = {*called.values(), *(self._core.file.groups.keys() - called.keys())}
        missing = [
            (bus, wanted)
            for bus, segment in self._core.segments.items()
            for wanted in segment.absent.listed(now)
            if wanted.name not in known
        ]
        self._find_nearest(wanted.name for _, wanted in missing)
        return joined_controllers(stations, [self._wanted(*one, called) for one in missing])

    # -- a station ---------------------------------------------------------------------------------------------------

    def _station(self, station: Station) -> dict[str, Any]:
        visits = [self._visit(station, visit) for visit in station.visits]
        return {
            "name": station.configured_name,
            "station_name": station.device.name,
            "kind": "drive" if station.axes else "device",
            "axes": [axis.configured_name for axis in station.axes],
            "bus": station.bus,
            "state": _state_of(station, visits),
            **self._place(self._group(station.configured_name)),
            "visits": visits,
        }

    def _visit(self, station: Station, visit: Visit) -> dict[str, Any]:
        is_open = visit.state in {VisitState.DATA, VisitState.STARTING}
        return {
            "controller": _caller(station.bus, visit.caller),
            "state": visit.state.value,
            "steps": {step: when / 1e9 for step, when in visit.steps.items()},
            "cycle_seconds": visit.cycle_ns / 1e9 if is_open and visit.cycle_ns else None,
            "watchdog_seconds": visit.watchdog_ns / 1e9 if is_open and visit.watchdog_ns else None,
            "ended": visit.ended,
            "refusals": [self._refusal(station, *one) for one in visit.refusals],
            "refusals_left_out": visit.left_out,
        }

    def _refusal(self, station: Station, refusal: Refusal, count: int) -> dict[str, Any]:
        return {
            "text": refusal.text,
            "place": refusal.place,
            "works": refusal.works,
            "count": count,
            **self._place((*self._group(station.configured_name), *refusal.key) if refusal.key else ()),
        }

    # -- the farm file -----------------------------------------------------------------------------------------------

    def _group(self, name: str) -> Location:
        return self._core.file.groups.get(name, ())

    def _place(self, location: Location) -> dict[str, Any]:
        """``file``, ``line``, ``key``: empty and 0 where nothing in the file says it."""
        if not location:
            return {"file": "", "line": 0, "key": ""}
        file, line, _ = self._core.file.place(location)
        return {"file": file, "line": line, "key": field_path(location)}

    # -- what is missing ---------------------------------------------------------------------------------------------

    def _find_nearest(self, names: Iterable[str]) -> None:
        """The station of the farm file whose name is most like each; of a few names at once, the others next time."""
        stations = self._core.file.groups.keys()
        new = [name for name in names if name not in self._nearest]
        if len(self._nearest) > _MOST_NEAREST:
            self._nearest.clear()
        for name in new[:_NEW_AT_ONCE]:
            near: list[str] = []
            if not name[:1].isdigit():
                # an address is like none
                pool = heapq.nlargest(_POOL, stations, key=partial(_shared, name))
                near = difflib.get_close_matches(name, pool, n=1, cutoff=_ALIKE)
            self._nearest[name] = near[0] if near else ""

    def _wanted(self, bus: str, wanted: Wanted, called: Mapping[str, str]) -> dict[str, Any]:
        """A name that no station has; ``nearest`` is a station of the farm file."""
        nearest = self._nearest.get(wanted.name, "")
        if (now_called := called.get(wanted.name)) is not None:
            text = f"{wanted.name} of the farm file is called {now_called or 'nothing'} since DCP set its name"
        elif nearest:
            text = f"no station is called {wanted.name}; {nearest} is near"
        else:
            text = f"no station of the farm is {wanted.name}"
        group = self._group(nearest)
        return {
            "name": wanted.name,
            "bus": bus,
            "controller": _caller(bus, wanted.caller),
            "since_seconds": wanted.first_ns / 1e9,
            "nearest": nearest,
            "text": text,
            **self._place((*group, "name") if group else ()),
        }


def _shared(one: str, other: str) -> int:
    """With how many letters both begin."""
    return next((n for n, (a, b) in enumerate(zip(one, other, strict=False)) if a != b), min(len(one), len(other)))


def _caller(bus: str, caller: Caller) -> dict[str, str]:
    mac = format_mac(caller.mac) if caller.mac else ""
    return {"bus": bus, "address": caller.address, "mac": mac, "name": caller.name}


def _state_of(station: Station, visits: Iterable[Mapping[str, Any]]) -> str:
    """How far the station is with that controller that is farthest."""
    if not station.powered:
        return "off"
    states = {visit["state"] for visit in visits}
    refused = any(not refusal["works"] for visit in visits for refusal in visit["refusals"])
    if VisitState.DATA.value in states:
        return "partly" if refused else "ready"
    if refused:
        return "refused"
    order = (VisitState.STARTING, VisitState.ENDED, VisitState.FOUND)
    return next((state.value for state in order if state.value in states), _NO_STATE)


def joined_controllers(stations: Iterable[dict[str, Any]], missing: Iterable[dict[str, Any]]) -> dict[str, Any]:
    """The view of these: each controller once, and its number in place of it where it is named."""
    found: list[dict[str, Any]] = []
    by_word: dict[tuple[str, str], int] = {}

    def number(caller: Mapping[str, str]) -> int:
        words = [(caller["bus"], caller[key]) for key in ("address", "mac") if caller[key]]
        known = [by_word[word] for word in words if word in by_word]
        # several behind one router have its MAC address
        other = {"", caller["address"]}
        place = next((n for n in known if not caller["address"] or found[n]["address"] in other), None)
        if place is None:
            if len(found) >= MOST_CONTROLLERS:
                return -1
            place = len(found)
            found.append({**caller, "exchanging": 0, "refused": 0, "stations": 0})
        for key in ("address", "mac", "name"):
            found[place][key] = found[place][key] or caller[key]
        for word in words:
            by_word.setdefault(word, place)
        return place

    stations = list(stations)
    # those with connections first: others may be left out
    visits = [visit for station in stations for visit in station["visits"]]
    for visit in sorted(visits, key=lambda visit: _ORDER.get(visit["state"], len(_ORDER))):
        number(visit["controller"])
    shown = []
    for station in stations:
        numbered = [{**visit, "controller": number(visit["controller"])} for visit in station["visits"]]
        numbered = [visit for visit in numbered if visit["controller"] >= 0]
        for visit in numbered:
            whose = found[visit["controller"]]
            whose["stations"] += 1
            whose["exchanging"] += visit["state"] == VisitState.DATA.value
            whose["refused"] += any(not refusal["works"] for refusal in visit["refusals"])
        shown.append({**station, "visits": numbered})
    wanted = [{**one, "controller": number(one["controller"])} for one in missing]
    return {
        "ready": bool(shown) and all(station["state"] == "ready" for station in shown),
        "controllers": found,
        "stations": shown,
        "missing": wanted,
    }
