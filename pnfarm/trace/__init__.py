"""Traces: chosen signals of drives and devices, sampled in the engine's steps, as the drives' own tools record them.

::

    trace = farm.core.traces.start(
        {"on": "axis-01", "signals": ["velocity", "zsw1"], "trigger": "fault 702", "pre": "200ms", "length": "2s"}, now
    )
    ...  # time passes, in real or in virtual time
    if trace.complete:
        recording = trace.recording()  # times in seconds from the trigger, values in the signals' units
        recording.first("zsw1.fault_present", 1)
    farm.core.traces.delete(trace.id, now)

The request's fields are described in :class:`.TraceRequest`, triggers in :mod:`pnfarm.trace.trigger`, signals in
:mod:`pnfarm.trace.signals` and :mod:`pnfarm.trace.traced`.
"""

from __future__ import annotations

from pnfarm.trace.manager import Trace, TraceManager
from pnfarm.trace.recording import Column, Recording
from pnfarm.trace.request import TraceError, TraceRequest

__all__ = ["Column", "Recording", "Trace", "TraceError", "TraceManager", "TraceRequest"]
