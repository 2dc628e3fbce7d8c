"""Traces around what a reader of the report wants to see: each failure, and each fault that the scenario injects.

One trace of the drives and devices that the scenario names runs all the time, in the engine; at a moment of interest it
is triggered, and once it is complete it is kept, thinned, and started anew.  Number and size are bounded.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pnfarm.errors import ConfigError
from pnfarm.signals.device_signal import device_of
from pnfarm.station.signals import profile_words
from pnfarm.trace.recording import Column, Recording
from pnfarm.vocabulary.conditions import names_in, parse_condition

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from pnfarm.farm.core import FarmCore
    from pnfarm.scenario.definition.binding import Binding
    from pnfarm.scenario.definition.steps import Step
    from pnfarm.trace import Trace

__all__ = ["Excerpt", "TraceExcerpts", "named_signals", "named_stations"]

#: Time that is kept before and after a moment.
BEFORE, BEFORE_NS = "500ms", 500_000_000
AFTER, AFTER_NS = "1s", 1_000_000_000
#: Signals of any drive; to these come the bits of the words of its profile.
SIGNALS = ("state", "setpoint", "velocity", "fault")
#: Of any drive or device; to these come the signals of devices that the scenario names.
CONNECTED = "connected"
#: Bits that are shown even if nothing changes: the drive has a fault, the controller asks for operation.
_TELLING = frozenset({"zsw1.fault_present", "stw1.enable_operation", "status_1.general_fault", "control.enable"})
#: Drives and devices that are traced, and those that one picture shows.
MAX_TRACED, MAX_SHOWN = 32, 3
#: Pictures; no more than half of them are of injected faults, so that there is room for failures.
MAX_PICTURES = 16
#: Signals of devices that are traced.
MAX_SIGNALS = 64
#: Samples that a picture keeps of a quantity; of words, bits and codes it keeps every change.
MAX_SAMPLES = 300
#: Marks of one picture.
MAX_MARKS = 12


def named_signals(binding: Binding) -> list[tuple[str, str]]:
    """Station and name of each signal of a device that steps name."""
    found: dict[tuple[str, str], None] = {}
    for step in binding.scenario.every_step():
        found.update(dict.fromkeys(_signals_of(step, binding)))
    return list(found)


def _signals_of(step: Step, binding: Binding) -> Iterator[tuple[str, str]]:
    spec = step.values["spec"] if step.kind == "fault" else {}
    if step.kind in {"set", "force"}:
        yield from ((station, name) for station, values in step.values["signals"].items() for name in values)
    if isinstance(wanted := (spec.get("params") or {}).get("signal"), str):
        yield from ((station, wanted) for station in binding.hit_or_none(spec.get("on")))
    text = spec.get("when") if spec else step.get("that") or step.get("until")
    for name in names_in(parse_condition(text)) if text else ():
        if station := device_of(name, binding.devices or ()):
            yield station, name.name.removeprefix(f"{station}.")


def named_stations(binding: Binding) -> list[str]:
    """The drives and devices that steps name: those of faults first; all drives after them where no drive is named."""
    found: dict[str, None] = {}
    steps = list(binding.scenario.every_step())
    for step in steps:
        if step.kind == "fault":
            found.update(dict.fromkeys(binding.hit_or_none(step.values["spec"].get("on"))))
    for step in steps:
        if step.kind in {"expect", "wait"} and step.get("drive"):
            found.update(dict.fromkeys(binding.chosen(step)))
    found.update(dict.fromkeys(station for station, _ in named_signals(binding) if station in (binding.devices or ())))
    return list(found if binding.drives.keys() & found.keys() else {**found, **dict.fromkeys(binding.drives)})


@dataclass(frozen=True, slots=True)
class Excerpt:
    """One picture: what happened on which drives, and how they moved; ``at_seconds`` of the run.

    Its numbers stay arrays until the record is asked for: a farm keeps the last records for days.
    """

    at_seconds: float
    drives: list[str]
    marks: list[dict[str, Any]]
    trace: Recording

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "at_seconds": self.at_seconds,
            "drives": self.drives,
            "marks": self.marks,
            "trace": self.trace.as_dict(),
        }


class TraceExcerpts:
    """``drives`` and devices in the order of their importance, and ``signals`` of devices.

    Without room for one more trace, :attr:`note` says so.
    """

    def __init__(self, core: FarmCore, drives: Sequence[str], signals: Sequence[tuple[str, str]], now: int) -> None:
        self._core = core
        self._drives = list(drives)[:MAX_TRACED]
        models = [station.model for station in core.axes if station.configured_name in self._drives]
        words = dict.fromkeys(word for model in models for word in profile_words(model))
        owners = core.signal_owners
        known = {name: {one.name for one in core.traces.signals(name)} for name in self._drives if name in owners}
        # models of the plant have their ports alone
        connected = () if core.plant is not None and core.plant.parts.keys() >= {*self._drives} else (CONNECTED,)
        self._signals = [*connected, *(SIGNALS if models else ()), *(f"{word}.*" for word in words)]
        # octets and texts have no trace
        self._signals += [f"{name}.{signal}" for name, signal in signals if signal in known.get(name, ())][:MAX_SIGNALS]
        self._origin_ns = now
        self._trace: Trace | None = None
        self._started_ns = self._fired_ns = 0
        self._marks: list[dict[str, Any]] = []
        self._shown: dict[str, None] = {}
        self._of_faults = 0
        self._kept: list[Excerpt] = []
        #: Why there are no pictures, or no more.
        self.note = ""
        self._start(now)

    def _start(self, now: int) -> None:
        request = {"on": self._drives, "signals": self._signals, "trigger": "manual", "pre": BEFORE, "length": AFTER}
        try:
            self._trace = self._core.traces.start(request, now)
        except ConfigError as error:
            self.note = str(error)
        self._started_ns = now

    def mark(self, text: str, drives: Sequence[str], now: int, *, failure: bool) -> None:
        """Something of interest happens on ``drives``."""
        self.look(now)
        if self._trace is not None and not self._marks and self._trace.state != "waiting":
            # another client deleted or triggered it
            self._delete(now)
            self._start(now)
        if self._trace is None:
            return
        if not self._marks:
            if len(self._kept) >= MAX_PICTURES or (not failure and self._of_faults >= MAX_PICTURES // 2):
                self.note = f"there are traces of the first {len(self._kept)} only"
                return
            self._of_faults += not failure
            self._fired_ns = now
            self._core.traces.fire(self._trace.id, now)
        if len(self._marks) < MAX_MARKS:
            seconds = (now - self._fired_ns) / 1e9
            self._marks.append({"text": text, "seconds": seconds, "failure": failure})
        known = [name for name in drives or self._drives if name in self._drives]
        for name in known:
            if len(self._shown) < MAX_SHOWN:
                self._shown[name] = None

    def look(self, now: int) -> None:
        """Keep a trace that is complete, and begin the next one, as after one that another client deleted."""
        if self._trace is not None and self._marks and self._trace.state in {"complete", "deleted"}:
            self._keep(now)
            self._start(now)

    def close(self, now: int) -> list[Excerpt]:
        """End; the pictures."""
        if self._trace is not None:
            if self._marks:
                self._keep(now)
            else:
                self._delete(now)
        return self._kept

    def _delete(self, now: int) -> None:
        if self._trace is not None and not self._trace.deleted:
            self._core.traces.delete(self._trace.id, now)
        self._trace = None

    def _keep(self, now: int) -> None:
        assert self._trace is not None
        if self._trace.deleted:
            self._trace, self._marks, self._shown = None, [], {}
            self.note = "the scenario's trace was deleted by another client"
            return
        recording = self._trace.recording()
        self._delete(now)
        # a trace whose trigger the engine has not seen counts from its start
        times = recording.time if recording.triggered else recording.time - (self._fired_ns - self._started_ns) / 1e9
        inside = (times >= -BEFORE_NS / 1e9) & (times <= AFTER_NS / 1e9)
        columns = [
            Column(column.drive, column.signal, column.unit, column.form, column.values[inside])
            for drive in self._shown
            for column in recording.columns
            if column.drive == drive
        ]
        trace = _thinned(recording, self._marks[0]["text"], times[inside], columns)
        at_seconds = (self._fired_ns - self._origin_ns) / 1e9
        self._kept.append(Excerpt(at_seconds, list(self._shown), self._marks, trace))
        self._marks, self._shown = [], {}


def _thinned(recording: Recording, mark: str, times: NDArray[Any], columns: Sequence[Column]) -> Recording:
    """Without bits that never change, and with every change of the others."""
    chosen = [
        column for column in columns if column.form == "real" or column.signal == "state" or _changes(column).any()
    ]
    if not any(column.form == "bit" and "." in column.signal for column in chosen):
        # nothing happened: at least the bits that show this
        chosen += [column for column in columns if column.signal in _TELLING]
    keep = np.zeros(len(times), bool)
    keep[:: max(1, -(-len(times) // MAX_SAMPLES))] = True
    keep[-1:] = True
    for column in chosen:
        if column.form != "real":
            changed = np.flatnonzero(_changes(column))
            # the sample before a change, too: the line is then as steep as it was
            keep[changed[: MAX_SAMPLES // 2]] = True
            keep[changed[: MAX_SAMPLES // 2] + 1] = True
    kept = tuple(
        Column(
            column.drive, column.signal, column.unit, column.form,
            np.round(column.values[keep], 4) if column.form == "real" else column.values[keep],
        )
        for column in chosen
    )  # fmt: skip
    return Recording(
        id="trace",
        state=recording.state,
        triggered=True,
        triggered_by=recording.triggered_by,
        trigger=mark,
        interval_seconds=recording.interval_seconds,
        missed=recording.missed,
        time=np.round(times[keep], 6),
        columns=kept,
    )


def _changes(column: Column) -> NDArray[np.bool_]:
    """Whether the value changes after each sample but the last."""
    found: NDArray[np.bool_] = column.values[1:] != column.values[:-1]
    return found
