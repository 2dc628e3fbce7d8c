"""A drive's main signals as they come, for a view that shows them while they happen.

It is a trace that nothing triggers: the engine samples every :data:`INTERVAL` and the ring has the last seconds, so
that a viewer that looks ten times a second misses no pulse of a control word.  Viewers of one drive share its trace.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pnfarm.errors import ConfigError
from pnfarm.trace.signals import signals_of

if TYPE_CHECKING:
    from pnfarm.station.axis import Axis
    from pnfarm.trace.manager import Trace, TraceManager

__all__ = ["MOST_DRIVES", "LiveSignals", "LiveViewer"]

INTERVAL = "10ms"
#: What a new viewer gets of the past.
PAST = "10s"
#: Traces of a farm are few, and most of them are for those who ask for one.
MOST_DRIVES = 4
#: A trace that no viewer has read for this time is given up; where another one needs its place, after a second.
KEEP_NS = 10_000_000_000
UNREAD_NS = 1_000_000_000
#: In this order, those that the drive has.
SIGNALS = (
    "setpoint", "velocity", "position", "following_error", "current", "torque", "state", "fault", "connected",
    "stw1", "zsw1", "control", "status_1", "status_2",
)  # fmt: skip


class LiveSignals:
    """The live traces of a farm."""

    def __init__(self, manager: TraceManager) -> None:
        self._manager = manager
        self._traces: dict[str, Trace] = {}

    def of(self, station: Axis, now: int) -> Trace | None:
        """The drive's trace, made if there is none; None where the farm has no room for it."""
        name = station.configured_name
        self._traces = {drive: trace for drive, trace in self._traces.items() if not trace.deleted}
        found = self._traces.get(name)
        if found is None:
            if len(self._traces) >= MOST_DRIVES:
                oldest = min(self._traces.values(), key=lambda trace: trace.touched_ns)
                if now - oldest.touched_ns < UNREAD_NS:
                    return None
                self._manager.delete(oldest.id, now)
                del self._traces[oldest.request.on[0]]
            known = signals_of(station)
            wanted = [signal for signal in SIGNALS if signal in known]
            fields = {"on": [name], "signals": wanted, "trigger": "manual", "pre": PAST, "interval": INTERVAL}
            try:
                found = self._manager.start(fields, now, keep_ns=KEEP_NS)
            except ConfigError:
                # the farm's traces are in use
                return None
            self._traces[name] = found
        found.touched_ns = now
        return found


class LiveViewer:
    """One viewer of a drive's trace."""

    def __init__(self, live: LiveSignals, station: Axis) -> None:
        self._live = live
        self._station = station
        self._trace: Trace | None = None
        self._seen = 0

    def fresh(self, now: int) -> dict[str, Any] | None:
        """Samples since the last call: ``id`` of the trace, ``seconds`` after it began, ``signals`` by name.

        None where the farm has no room for a live trace.
        """
        trace = self._live.of(self._station, now)
        if trace is not self._trace:
            self._trace, self._seen = trace, 0
        if trace is None:
            return None
        self._seen, times, values = trace.since(self._seen)
        return {
            "id": trace.id,
            "seconds": np.round(times / 1e9, 3).tolist(),
            "signals": {name: _numbers(column) for name, column in values.items()},
        }


def _numbers(column: Any) -> list[float]:
    """As JSON can have them."""
    return [round(value, 6) for value in np.nan_to_num(column).tolist()]
