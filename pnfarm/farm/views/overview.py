"""All drives of a farm at a glance, for views that are refreshed ten times a second.

What moves (:data:`VALUES`) is read from the table for all drives at once; the rest of a drive is a row, made again when
something happens to it, and in turn.  Each change has a number: who knows the number that it saw last gets what changed
since, so that a viewer costs no memory here, and several that are equally up to date share one text.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from pnfarm.farm.views.snapshot import NO_AR, engine_snapshot, injected_kinds
from pnfarm.table.axis_codes import NUMBER_MASK
from pnfarm.wire.mac import format_mac

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.farm.core import FarmCore
    from pnfarm.station.axis import Axis
    from pnfarm.station.event_log import LogEntry

__all__ = ["VALUES", "Overview"]

#: A sample this young is good for another viewer.
SHARED_NS = 50_000_000
#: Each row is made again after so many samples at the latest: not all that it shows has an event.
ROUNDS = 40
#: Rows made again in one sample.
MOST_ROWS = 64
#: Largest whole number that a script of a page has exactly.
LARGEST = 2**53 - 1
#: A second, for what is sent with each of them.
_SECOND_NS = 1_000_000_000


def _off_or(powered: Any, state: Any) -> Any:
    """State of the PROFIdrive state machine, 0 while booting, -1 without supply."""
    return np.where(powered != 0, state.astype(np.int64), -1)


#: Name -> how it is read from the table of axes, as whole numbers.
VALUES: Mapping[str, Callable[[Any], Any]] = {
    "state": lambda axis: _off_or(axis["powered"], axis["drive"]["state"]),
    "velocity": lambda axis: np.rint(axis["motor"]["velocity"] * 10),
    "setpoint": lambda axis: np.where(axis["powered"] != 0, np.rint(axis["ramp"]["setpoint"] * 10), 0),
    "current": lambda axis: np.rint(axis["motor"]["current"] * 100),
    "fault": lambda axis: np.where(axis["powered"] != 0, axis["faults"]["code"][:, 0] & NUMBER_MASK, 0),
    "warning": lambda axis: np.where(axis["powered"] != 0, axis["warnings"]["code"], 0),
}


class Overview:
    """See the module's docstring.  ``now`` is the farm's clock, ns."""

    def __init__(self, core: FarmCore, now: Callable[[], int]) -> None:
        self._core = core
        self._now = now
        count = len(core.axes)
        self._index = {station.configured_name: index for index, station in enumerate(core.axes)}
        #: Counts samples that changed something.
        self.version = 0
        self._sampled_ns: int | None = None
        self._values = {name: np.full(count, np.iinfo(np.int64).min, np.int64) for name in VALUES}
        #: The version at which each value changed last.
        self._changed = {name: np.zeros(count, np.int64) for name in VALUES}
        self._rows: list[dict[str, Any]] = [{} for _ in range(count)]
        self._row_changed = np.zeros(count, np.int64)
        #: Rows to make again, the oldest wish first; all of them at the beginning.
        self._wanted: dict[int, None] = dict.fromkeys(range(count))
        self._next = 0
        self._engine: dict[str, Any] = {}
        self._engine_ns: int | None = None
        self._engine_changed = 0
        self._texts: dict[int, bytes] = {}
        self._unsubscribe = core.log.subscribe(self._happened)

    def close(self) -> None:
        """Listen to the farm's log no more."""
        self._unsubscribe()

    def since(self, version: int) -> bytes:
        """What changed after ``version``, now, as JSON: ``version``, ``seconds``, and those of the others that changed.

        ``values``: name of :data:`VALUES` -> [places of drives, their values], null instead of all places; ``rows``:
        place -> row; ``engine``.
        A place is the drive's in the farm file, from 0.  0 is the version of who has seen nothing: then all rows come,
        each once it is made.
        """
        now = self._now()
        if self._sampled_ns is None or not 0 <= now - self._sampled_ns < SHARED_NS:
            self._sample(now)
        found = self._texts.get(version)
        if found is None:
            text = json.dumps(self._since(version), separators=(",", ":"), allow_nan=False)
            found = self._texts[version] = text.encode()
        return found

    def _since(self, version: int) -> dict[str, Any]:
        found: dict[str, Any] = {"version": self.version, "seconds": round((self._sampled_ns or 0) / 1e9, 3)}
        values: dict[str, list[Any]] = {}
        for name, changed in self._changed.items():
            known = self._values[name]
            places = np.nonzero(changed > version)[0]
            if 0 < len(places) == len(known):
                values[name] = [None, known.tolist()]
            elif len(places):
                values[name] = [places.tolist(), known[places].tolist()]
        rows = np.nonzero(self._row_changed > version)[0].tolist()
        if values:
            found["values"] = values
        if rows:
            found["rows"] = {place: self._rows[place] for place in rows}
        if self._engine_changed > version:
            found["engine"] = self._engine
        return found

    def _sample(self, now: int) -> None:
        self._sampled_ns = now
        version = self.version + 1
        changed = False
        axis = self._core.columns.axis[: len(self._rows)].view(np.ndarray)
        for name, read in VALUES.items():
            known = self._values[name]
            # a motor that something drove out of all bounds has no number that a page could have
            fresh = np.clip(np.nan_to_num(read(axis)), -LARGEST, LARGEST).astype(np.int64)
            differs = fresh != known
            if differs.any():
                self._values[name] = fresh
                self._changed[name][differs] = version
                changed = True
        changed |= self._make_rows(version, now)
        if self._engine_ns is None or now - self._engine_ns >= _SECOND_NS:
            self._engine_ns, self._engine, self._engine_changed = now, engine_snapshot(self._core), version
            changed = True
        if changed:
            self.version = version
            self._texts.clear()

    def _make_rows(self, version: int, now: int) -> bool:
        count = len(self._rows)
        for _ in range(min(MOST_ROWS, -(-count // ROUNDS))):
            self._wanted.setdefault(self._next)
            self._next = (self._next + 1) % count
        injected = injected_kinds(self._core.injections)
        changed = False
        for place in list(self._wanted)[:MOST_ROWS]:
            del self._wanted[place]
            row = _row(self._core.axes[place], injected, now)
            if row != self._rows[place]:
                self._rows[place] = row
                self._row_changed[place] = version
                changed = True
        return changed

    def _happened(self, entry: LogEntry) -> None:
        place = self._index.get(entry.drive)
        if place is not None:
            self._wanted.setdefault(place)


def _row(station: Axis, injected: Mapping[str, list[tuple[str, str]]], now: int) -> dict[str, Any]:
    """What does not move."""
    powered = station.powered
    connection = station.device.connection()
    known = connection if connection is not None and (connection.ip is not None or connection.cyclic) else None
    seen = station.device.view(now)
    return {
        "name": station.configured_name,
        "station_name": seen.get("station_name", station.device.name),
        "model": station.model.name,
        "bus": station.model.bus,
        "mac": format_mac(station.port.mac),
        "ip": seen.get("ip"),
        "address": seen.get("station_address"),
        "telegram": station.store.telegram_number,
        "ar_state": connection.state if powered and connection is not None and connection.state else NO_AR,
        "connected": bool(powered and connection is not None and connection.exchanging),
        "controller": known.controller if known is not None else None,
        "controller_ip": str(known.ip) if known is not None and known.ip is not None else None,
        "cycle_seconds": known.cycle_ns / 1e9 if known is not None else None,
        "injected": list(injected.get(station.configured_name, ())),
        "neighbours": [one["station"] for one in seen.get("neighbours", ())],
    }
