"""All drives of all shards at a glance: the shards' own messages of changes, joined into one row of numbers.

As :mod:`pnfarm.farm.views.overview`, whose messages come in and go out here: each change has a number, and a viewer
that knows the number that it saw last gets what changed since; it costs no memory here.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from pnfarm.farm.views.overview import LARGEST, VALUES
from pnfarm.hub.merging import joined_engine
from pnfarm.hub.shards import understood

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.hub.shards import Shard, Shards

__all__ = ["UNREACHABLE", "HubOverview"]

#: The state of a drive whose shard is away, as a number; -1 is off.
UNREACHABLE = -2
_NEVER = np.iinfo(np.int64).min


class HubOverview:
    """``now`` is the hub's clock, ns."""

    def __init__(self, shards: Shards, now: Callable[[], int]) -> None:
        self._shards = shards
        self._now = now
        self.version = 0
        self._engines: dict[Shard, Mapping[str, Any]] = {}
        self._engine_changed = 0
        self._places: dict[str, int] = {}
        self._values = {name: np.full(0, _NEVER, np.int64) for name in VALUES}
        self._rows: list[dict[str, Any]] = []
        self._lay_out()

    def refresh(self) -> None:
        """Follow what is known of the shards: a new list of drives, shards that came or went."""
        if self.layout != self._shards.layout:
            self._lay_out()
        for shard in self._shards:
            if self._asked.get(shard) is not shard.asked:
                self._asked[shard] = shard.asked
                if not shard.asked:
                    self._lose(shard)

    def _lay_out(self) -> None:
        names = self._shards.names
        self.layout = self._shards.layout
        self.version += 1
        # shards send only what changes: what is known of a drive stays
        before = [self._places.get(name, -1) for name in names]
        self._places = {name: place for place, name in enumerate(names)}
        self._values = {name: np.append(values, _NEVER)[before] for name, values in self._values.items()}
        self._changed = {name: np.full(len(names), self.version) for name in VALUES}
        self._rows = [{} if place < 0 else self._rows[place] for place in before]
        self._row_changed = np.array([self.version if row else 0 for row in self._rows], np.int64)
        #: Whether a shard was there at the last check.
        self._asked: dict[Shard, bool] = {}
        self._texts: dict[int, bytes] = {}
        # of shards that were forgotten while no page was open
        self._engines = {shard: engine for shard, engine in self._engines.items() if shard in set(self._shards)}

    def _lose(self, shard: Shard) -> None:
        self.version += 1
        self._texts.clear()
        self._engines.pop(shard, None)
        self._engine_changed = self.version
        told = shard.told()
        for name, view in shard.drives.items():
            place = self._places.get(name)
            if place is None or self._elsewhere(name, shard):
                continue
            for key, values in self._values.items():
                values[place] = UNREACHABLE if key == "state" else 0
                self._changed[key][place] = self.version
            row = self._rows[place] or {
                key: view.get(key) for key in ("name", "station_name", "model", "mac", "ip", "telegram")
            } | {"bus": "", "address": view.get("station_address"), "injected": [], "neighbours": []}
            gone = {"ar_state": "NO_AR", "connected": False, "controller": None, "cycle_seconds": None}
            self._rows[place] = {**row, **gone, "unreachable": told}
            self._row_changed[place] = self.version

    def _elsewhere(self, name: str, shard: Shard) -> bool:
        return any(other is not shard and other.asked and name in other.drives for other in self._shards)

    def take(self, shard: Shard, message: Mapping[str, Any]) -> None:
        """An ``overview`` message of a shard.  Raises :class:`AwayError` for one that no farm sends."""
        self.refresh()
        if not shard.asked:
            return
        names = tuple(shard.drives)
        version = self.version + 1
        with understood(shard, "sends no overview"):
            for key, (places, values) in (message.get("values") or {}).items():
                if key not in self._values:
                    continue
                # null: all drives of the shard
                for place, value in zip(range(len(names)) if places is None else places, values, strict=True):
                    here = self._places[names[place]]
                    self._values[key][here] = max(-LARGEST, min(LARGEST, value))
                    self._changed[key][here] = version
            for text, row in (message.get("rows") or {}).items():
                here = self._places[names[int(text)]]
                injected = [[shard.fault_id(fault), kind] for fault, kind in row.get("injected", ())]
                self._rows[here] = {**row, "injected": injected, "shard": shard.label, "unreachable": None}
                self._row_changed[here] = version
            if (engine := message.get("engine")) is not None:
                joined_engine([engine])
                self._engines[shard] = engine
                self._engine_changed = version
        self.version = version
        self._texts.clear()

    def since(self, version: int) -> bytes:
        """What changed after ``version``, as :meth:`pnfarm.farm.views.overview.Overview.since` reports it."""
        found = self._texts.get(version)
        if found is None:
            found = self._texts[version] = json.dumps(
                self._since(version), separators=(",", ":"), allow_nan=False
            ).encode()
        return found

    def _since(self, version: int) -> dict[str, Any]:
        found: dict[str, Any] = {"version": self.version, "seconds": round(self._now() / 1e9, 3)}
        values = {}
        for name, changed in self._changed.items():
            places = np.nonzero((changed > version) & (self._values[name] != _NEVER))[0]
            if len(places):
                values[name] = [places.tolist(), self._values[name][places].tolist()]
        rows = np.nonzero(self._row_changed > version)[0].tolist()
        if values:
            found["values"] = values
        if rows:
            found["rows"] = {place: self._rows[place] for place in rows}
        if self._engine_changed > version:
            found["engine"] = joined_engine(self._engines.values())
        return found
