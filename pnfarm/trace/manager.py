"""Starts traces in the engine, notices their triggers and their ends, and reads their samples.

One :class:`TraceManager` serves a farm.  It knows no clock: the farm's runtime passes the time.  The engine samples
(:mod:`pnfarm.engine.tracing`); number, memory and time of the traces are bounded here.  A trace that nobody asks for
ends after its ``keep`` time, so that a client that is gone leaves nothing behind.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from pnfarm.errors import ConfigError
from pnfarm.faults.events import InjectionBegan, InjectionEnded
from pnfarm.station.events import FaultRaised, WarningChanged
from pnfarm.table import trace as codes
from pnfarm.table.access.record_fields import field_views
from pnfarm.table.segments import Segments
from pnfarm.trace.choosing import TracedStations
from pnfarm.trace.events import TraceEnded, TraceTriggered
from pnfarm.trace.recording import Column, Recording
from pnfarm.trace.request import TraceError, TraceRequest
from pnfarm.trace.trigger import EVENTS, EventTrigger
from pnfarm.vocabulary.durations import format_duration
from pnfarm.vocabulary.quoting import did_you_mean, shown

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from pnfarm.engine.columns import Columns
    from pnfarm.plant.part import PlantPart
    from pnfarm.station.axis import Axis
    from pnfarm.station.event_log import EventLog, LogEntry
    from pnfarm.station.station import Station
    from pnfarm.table.access.places import Place
    from pnfarm.trace.choosing import ColumnPlace
    from pnfarm.trace.signals import TraceSignal
    from pnfarm.trace.traced import Traced

__all__ = ["MOST_TRACES", "MOST_VALUES", "Trace", "TraceManager"]

#: Traces at once, running or complete.
MOST_TRACES = 16
#: Numbers in the ring for one trace: a quarter of it.
MOST_VALUES = codes.RING_VALUES // 4
#: Time that the event loop may need to pass an event on to the engine; so much more is kept from before the trigger.
EVENT_NS = 250_000_000
#: When to look again whether the engine has seen that a trace is over.
SEEN_NS = 10_000_000
_STATES = {codes.IDLE: "waiting", codes.ARMED: "waiting", codes.TRIGGERED: "running", codes.ENDED: "complete"}


@dataclass(slots=True)
class Trace:
    """One trace; ``row`` of the trace table, its probes from ``first_probe`` on, its part of the ring."""

    manager: TraceManager
    id: str
    request: TraceRequest
    row: int
    first_probe: int
    ring_start: int
    columns: tuple[ColumnPlace, ...]
    #: Drives and devices whose events and signals trigger.
    watched: frozenset[str]
    #: Row of a probe that the trigger watches -> its drive or device.
    watched_probes: dict[int, str]
    #: Number of the fault or warning that an event trigger waits for.
    number: int | None
    interval_ns: int
    touched_ns: int
    triggered_by: str = ""
    deleted: bool = False
    #: The state of the row that the log has.
    told: int = codes.ARMED
    #: Called once the trace is complete or deleted.
    on_end: list[Callable[[], None]] = field(default_factory=list)

    @property
    def state(self) -> str:
        """``waiting`` for the trigger, ``running`` or ``complete``; ``deleted`` for one that is gone."""
        return "deleted" if self.deleted else _STATES[int(self._table.state)]

    @property
    def complete(self) -> bool:
        return self.state == "complete"

    @property
    def _table(self) -> Any:
        return self.manager.columns.trace[self.row]

    def as_dict(self) -> dict[str, Any]:
        """What it is and how far it is, for JSON; without the samples."""
        row = self._table
        return {
            "id": self.id,
            "state": self.state,
            "triggered": self.state in {"running", "complete"},
            "triggered_by": self.triggered_by,
            "samples": self._count(),
            "missed": int(row.missed),
            "interval_seconds": self.interval_ns / 1e9,
            "drives": list(dict.fromkeys(column.drive for column in self.columns)),
            "request": self.request.as_dict(),
        }

    def recording(self) -> Recording:
        """The samples so far, from the time before the trigger on.  Raises :class:`ConfigError` for a deleted trace."""
        if self.deleted:
            raise ConfigError(f"trace {self.id} was deleted")
        row = self._table
        state = int(row.state)
        triggered = state in {codes.TRIGGERED, codes.ENDED}
        _, samples = self._samples()
        start = (int(row.trigger_ns) if triggered else int(row.started_ns)) - int(row.started_ns)
        since = samples[:, 0] - start
        # more is kept from before the trigger than was asked for (EVENT_NS)
        if triggered:
            samples = samples[since >= -self.request.pre_ns]
            since = since[since >= -self.request.pre_ns]
        columns = [
            Column(chosen.drive, chosen.signal.name, chosen.signal.unit, chosen.signal.form, _values(chosen, samples))
            for chosen in self.columns
        ]
        return Recording(
            id=self.id,
            state=_STATES[state],
            triggered=triggered,
            triggered_by=self.triggered_by,
            trigger=self.request.trigger.text,
            interval_seconds=self.interval_ns / 1e9,
            missed=int(row.missed),
            time=since / 1e9,
            columns=tuple(columns),
        )

    def _count(self) -> int:
        """Samples of :meth:`recording`."""
        row = self._table
        if int(row.state) not in {codes.TRIGGERED, codes.ENDED}:
            return min(int(row.head), int(row.capacity))
        first = int(row.trigger_ns) - int(row.started_ns) - self.request.pre_ns
        return int((self._samples(columns=1)[1][:, 0] >= first).sum())

    def since(self, count: int) -> tuple[int, Any, dict[str, Any]]:
        """For a viewer that has seen the first ``count`` samples: how many there are, and the times and values of more.

        Times are ns after the trace began, values by signal of its first drive.  What the ring has lost is left out.
        """
        head, samples = self._samples(count)
        return head, samples[:, 0], {chosen.signal.name: _values(chosen, samples) for chosen in self.columns}

    def _samples(self, first: int = 0, columns: int | None = None) -> tuple[int, Any]:
        """How many there were, and a copy of those in the ring from the ``first`` on, oldest first.

        The engine may write meanwhile.

        ``columns``: only so many of them; the first one is the time.
        """
        row = self._table
        width, capacity = int(row.probes) + 1, int(row.capacity)
        ring = self.manager.columns.trace_ring
        part = ring[self.ring_start : self.ring_start + capacity * width].reshape(capacity, width)[:, :columns]
        head = int(row.head)
        places = np.arange(max(0, first, head - capacity), head)
        copied = part[places % capacity]
        # the engine has begun to overwrite the oldest ones if it went on
        overwritten = max(0, int(row.head) + 1 - capacity) if int(row.state) != codes.ENDED else 0
        return head, copied[places >= overwritten]


def _values(chosen: ColumnPlace, samples: Any) -> Any:
    values = samples[:, 1 + chosen.probe]
    if chosen.signal.is_real:
        return values
    values = values.astype(np.int64)
    return values if chosen.signal.bit is None else values >> chosen.signal.bit & 1


class TraceManager:
    """``columns`` with room for traces; ``log`` takes their events and reports those of the drives and ``devices``.

    ``models`` are those of the plant.
    """

    def __init__(
        self,
        axes: Sequence[Axis],
        devices: Iterable[Station],
        models: Iterable[PlantPart],
        columns: Columns,
        log: EventLog,
    ) -> None:
        self.columns = columns
        self._stations = TracedStations(axes, devices, models)
        self._log = log
        self._traces: dict[str, Trace] = {}
        #: Ids of the injections in force, by what they are on.
        self._injected: defaultdict[str, set[str]] = defaultdict(set)
        #: Rows whose end the engine has not seen -> first probe and part of the ring.
        self._closing: dict[int, tuple[int, int]] = {}
        (self._rows_in_use,) = field_views(columns.engine[0], "trace_rows")
        self._probes = Segments(columns.probe.shape[0])
        self._ring = Segments(columns.trace_ring.shape[0])
        self._numbers = 0
        #: When to look whether the engine has seen the ends.
        self._look_ns = 0
        log.subscribe(self._happened)

    # -- for users ---------------------------------------------------------------------------------------------------

    def start(self, fields: Mapping[str, Any], now: int, *, keep_ns: int | None = None) -> Trace:
        """A trace from plain values as :meth:`.TraceRequest.parse` takes them; raises :class:`ConfigError`.

        ``keep_ns``: how long it stays while no client asks for it, unless ``keep`` says so; None: for ever.
        """
        request = TraceRequest.parse(fields, keep_ns=keep_ns)
        chosen = self._stations.chosen(request)
        if len(self._traces) >= MOST_TRACES:
            raise ConfigError(f"the farm keeps {MOST_TRACES} traces at most: delete one of {', '.join(self._traces)}")
        if request.name is not None and request.name in self._traces:
            raise TraceError([("as", f"there is a trace {request.name} already", "another name")])
        places: list[Place] = []
        columns = tuple(self._stations.columns(request, chosen, places))
        watched, level, number, those = self._stations.trigger(request, chosen)
        trace = self._allocate(request, columns, places, watched, now)
        trace.number = number
        trace.watched = frozenset(one.name for one in those)
        row = self.columns.trace[trace.row]
        row.level = level
        row.active = 1
        engine = self.columns.engine[0]
        engine.trace_rows = max(int(engine.trace_rows), trace.row + 1)
        self._traces[trace.id] = trace
        return trace

    def get(self, trace_id: str, now: int) -> Trace:
        """A trace, which stays from now on; raises :class:`ConfigError` for an unknown id."""
        if trace_id not in self._traces:
            known = ", ".join(self._traces) or "no trace"
            raise ConfigError(
                f"there is no trace {shown(trace_id)}{did_you_mean(trace_id, self._traces)}; there is {known}"
            )
        trace = self._traces[trace_id]
        trace.touched_ns = now
        return trace

    def signals(self, name: str) -> list[TraceSignal]:
        """Those that a drive, a device or a model of the plant of this name has.  Raises :class:`KeyError`."""
        return list(self._stations.by_name[name].signals().values())

    def kept(self) -> list[Trace]:
        """Every trace, oldest first."""
        return list(self._traces.values())

    def fire(self, trace_id: str, now: int) -> Trace:
        """Trigger a trace that waits; nothing happens to one that was triggered."""
        trace = self.get(trace_id, now)
        row = self.columns.trace[trace.row]
        if trace.state == "waiting" and not row.fire_ns:
            row.fire_ns = now
        return trace

    def delete(self, trace_id: str, now: int) -> Trace:
        """End a trace and forget its samples; raises :class:`ConfigError` for an unknown id."""
        trace = self.get(trace_id, now)
        self._remove(trace)
        self._look_ns = now + SEEN_NS
        return trace

    # -- for the runtime ---------------------------------------------------------------------------------------------

    def handle_timeout(self, now: int) -> None:
        """Remove the traces that no client has asked for in their time, and free what the engine no longer uses."""
        self._look_ns = now + SEEN_NS
        for trace in list(self._traces.values()):
            keep = trace.request.keep_ns
            if keep is not None and now - trace.touched_ns >= keep:
                self._remove(trace)
        self._collect()

    def next_deadline(self) -> int | None:
        """When :meth:`handle_timeout` is due."""
        if not self._traces and not self._closing:
            return None
        due = [
            trace.touched_ns + trace.request.keep_ns
            for trace in self._traces.values()
            if trace.request.keep_ns is not None
        ]
        if self._closing:
            due.append(self._look_ns)
        return min(due, default=None)

    def triggered(self, row: int, now: int) -> None:
        """The engine triggered the trace in this row."""
        trace = self._in_row(row)
        if trace is not None:
            self._reached(trace, codes.TRIGGERED, now)

    def ended(self, row: int, now: int) -> None:
        """The trace in this row is complete."""
        trace = self._in_row(row)
        if trace is not None:
            self._reached(trace, codes.ENDED, now)

    def catch_up(self, now: int) -> None:
        """Reports of the engine were lost: the rows say what they were."""
        for trace in self.kept():
            self._reached(trace, codes.TRIGGERED, now)
            self._reached(trace, codes.ENDED, now)

    # -- inside ------------------------------------------------------------------------------------------------------

    def _reached(self, trace: Trace, state: int, now: int) -> None:
        """Tell once that a trace is in this state; a report may be of the trace that had the row before."""
        table = self.columns.trace[trace.row]
        if not trace.told < state <= int(table.state):
            return
        trace.told = state
        if state == codes.TRIGGERED:
            trace.triggered_by = trace.watched_probes.get(int(table.trigger_probe), trace.triggered_by)
            self._log.record(now, "", TraceTriggered(trace.id, trace.triggered_by))
        else:
            self._log.record(now, "", TraceEnded(trace.id, min(int(table.head), int(table.capacity))))
            self._tell(trace)

    def _in_row(self, row: int) -> Trace | None:
        return next((trace for trace in self._traces.values() if trace.row == row), None)

    @staticmethod
    def _tell(trace: Trace) -> None:
        waiting, trace.on_end[:] = list(trace.on_end), []
        for call in waiting:
            call()

    def _allocate(
        self,
        request: TraceRequest,
        columns: tuple[ColumnPlace, ...],
        places: Sequence[Place],
        watched: Sequence[tuple[Traced, Place]],
        now: int,
    ) -> Trace:
        """A row, with its probes and its part of the ring; raises :class:`ConfigError` if there is no room."""
        interval = request.step_ns(int(self.columns.engine[0].tick_ns))
        margin = EVENT_NS if request.trigger.kind == codes.TRIGGER_EVENT else 0
        # one more at each end, one for the trigger's own step, one that the engine may be writing
        capacity = (request.pre_ns + request.length_ns + margin) // interval + 4
        width = len(places) + 1
        if capacity * width > MOST_VALUES:
            what = (
                f"{format_duration(request.pre_ns + request.length_ns)} every {format_duration(interval)} of "
                f"{width} values are {capacity * width:,} numbers"
            )
            raise TraceError([("length", what, f"{MOST_VALUES:,}: a shorter time, a longer interval or fewer signals")])
        self._collect()
        traces = self.columns.trace
        used = {trace.row for trace in self._traces.values()} | set(self._closing)
        row = next((row for row in range(traces.shape[0]) if row not in used and traces[row].state == codes.IDLE), None)
        first = self._probes.allocate(len(places) + len(watched))
        start = self._ring.allocate(capacity * width)
        if row is None or first is None or start is None:
            if first is not None:
                self._probes.release(first)
            if start is not None:
                self._ring.release(start)
            raise ConfigError(f"the traces {', '.join(self._traces)} fill the farm's memory for them: delete one")
        every = [*places, *(place for _, place in watched)]
        for number, place in enumerate(every, start=first):
            place.fill(self.columns.probe[number])
            self.columns.probe[number].seen = 0
        table = traces[row]
        table.first_probe, table.probes = first, len(places)
        table.first_watched, table.watched = first + len(places), len(watched)
        table.ring_start, table.capacity = start, capacity
        table.interval_ns, table.length_ns = interval, request.length_ns
        table.plain = any(place.octets for place in every)
        table.plant = any(place.source == codes.SOURCE_PLANT for place in every)
        table.trigger, table.fire_ns, table.started_ns = request.trigger.kind, 0, now
        # the engine sets them in its first step; those of the trace before must not be read
        table.head = table.missed = table.trigger_ns = 0
        probes = {first + len(places) + number: one.name for number, (one, _) in enumerate(watched)}
        return Trace(
            self,
            self._new_id(request.name),
            request,
            row,
            first,
            start,
            columns,
            frozenset(),
            probes,
            None,
            interval,
            now,
        )

    def _new_id(self, wanted: str | None) -> str:
        if wanted is not None:
            return wanted
        self._numbers += 1
        while f"trace-{self._numbers}" in self._traces:
            self._numbers += 1
        return f"trace-{self._numbers}"

    def _remove(self, trace: Trace) -> None:
        self.columns.trace[trace.row].active = 0
        del self._traces[trace.id]
        trace.deleted = True
        self._closing[trace.row] = (trace.first_probe, trace.ring_start)
        self._tell(trace)

    def _collect(self) -> None:
        """Free the rows that the engine has seen closed.  Without a trace it looks at none of them any more."""
        traces = self.columns.trace
        for row in [row for row in self._closing if traces[row].state == codes.IDLE]:
            first, start = self._closing.pop(row)
            self._probes.release(first)
            self._ring.release(start)
        rows = [trace.row for trace in self._traces.values()] + list(self._closing)
        self._rows_in_use[0] = max(rows, default=-1) + 1

    def _happened(self, entry: LogEntry) -> None:
        """An entry of the farm's log: count the injections on a drive, and trigger what waits for it."""
        what = entry.what
        concerned = self._stations.concerned.get(entry.drive, ())
        if isinstance(what, InjectionBegan | InjectionEnded):
            for one in concerned:
                in_force = self._injected[one.name]
                # one that ends may have waited only
                (in_force.add if isinstance(what, InjectionBegan) else in_force.discard)(what.id)
                one.image.injected = len(in_force)
        names = {one.name for one in concerned}
        for trace in self._traces.values():
            trigger = trace.request.trigger
            if not isinstance(trigger, EventTrigger) or names.isdisjoint(trace.watched):
                continue
            row = self.columns.trace[trace.row]
            if trace.state == "waiting" and not row.fire_ns and _matches(trigger, trace.number, what):
                trace.triggered_by = entry.drive
                # an event from before the start counts from there
                row.fire_ns = max(entry.now_ns, int(row.started_ns))


def _matches(trigger: EventTrigger, number: int | None, what: Any) -> bool:
    if trigger.event not in EVENTS or not isinstance(what, EVENTS[trigger.event]):
        return False
    if isinstance(what, FaultRaised | WarningChanged):
        return bool(what.number) if number is None else what.number == number
    if isinstance(what, InjectionBegan | InjectionEnded):
        return trigger.argument in {"", what.kind, what.id}
    return True
