"""One step of the plant: signals in, wires, models, couplings, values out.

A wire between two models takes a step, one to a station or an axis none: what does not depend on the order of the
models in the file is the same in each run.
"""

from __future__ import annotations

from math import isnan
from typing import Any

import numpy as np

from pnfarm.behaviours.couplings import COUPLED, LONGEST, TURN, couple, step_with_plant, uncouple
from pnfarm.behaviours.dispatch import step_behaviour
from pnfarm.engine.probes import read_plain, read_words
from pnfarm.firmware.axis import AXIS
from pnfarm.table.compiling.by_pointer import array_at
from pnfarm.table.compiling.compiled import compiled_apart, inlined
from pnfarm.table.engine_row import ENGINE, EVENT, PLANT_CHANGED, emit
from pnfarm.table.image import IMAGE
from pnfarm.table.plain_data import CONSUMED, PROVIDED, PlainRows
from pnfarm.table.plant import (
    BEHAVIOUR,
    COUPLING,
    OUTLET,
    OUTLET_PLACE,
    OUTLET_REAL,
    OUTLET_STATION,
    WIRE,
    WIRE_INVERTED,
    WIRE_NUMBER,
)
from pnfarm.table.trace import PROBE

__all__ = ["take_step"]

_AXIS, _ENGINE, _EVENT = AXIS.dtype, ENGINE.dtype, EVENT.dtype
_PROVIDED, _CONSUMED, _PROBE = PROVIDED.dtype, CONSUMED.dtype, PROBE.dtype
_WIRE, _BEHAVIOUR, _COUPLING, _OUTLET = WIRE.dtype, BEHAVIOUR.dtype, COUPLING.dtype, OUTLET.dtype
_REAL, _WORD, _OCTET = np.dtype(np.float64), np.dtype(np.int64), np.dtype(np.uint8)
#: Largest value that a wire brings.
MOST = 1e300
_AXIS_WORDS, _IMAGE_WORDS = AXIS.dtype.itemsize // 8, IMAGE.dtype.itemsize // 8


@inlined
def _copy(wires: Any, values: Any, late: int) -> None:
    """The wires to models, or those to outlets; a REAL of a PLC that is no number leaves a value as it was."""
    for number in range(len(wires)):
        wire = wires[number]
        if wire.late != late:
            continue
        value = values[wire.source]
        if wire.form == WIRE_NUMBER:
            made = value * wire.scale + wire.offset
            if not isnan(made):
                values[wire.target] = min(max(made, -MOST), MOST)
        else:
            values[wire.target] = 1.0 if (value != 0.0) != (wire.form == WIRE_INVERTED) else 0.0


@inlined
def _read(row: Any, values: Any, now: int) -> None:
    """The signals of stations that wires read."""
    if row.probe_count == 0:
        return
    probes = array_at(row.probe, row.probe_count, _PROBE)
    words = row.axis_count * _AXIS_WORDS
    read_words(
        probes, 0, int(row.probe_count), array_at(row.axis, words, _REAL), array_at(row.axis, words, _WORD),
        array_at(row.image, row.image_count * _IMAGE_WORDS, _WORD), now,
    )  # fmt: skip
    provided = PlainRows(
        array_at(row.provided, row.provided_count, _PROVIDED),
        array_at(row.provided_octets, row.provided_octets_count, _OCTET),
    )
    consumed = PlainRows(
        array_at(row.consumed, row.consumed_count, _CONSUMED),
        array_at(row.consumed_octets, row.consumed_octets_count, _OCTET),
    )
    read_plain(probes, 0, int(row.probe_count), provided, consumed)
    for number in range(row.probe_count):
        values[row.probed + number] = probes[number].value


@inlined
def _give(row: Any, axes: Any, values: Any, step_ns: int, now: int) -> None:
    """Values to the axes, for a step; the event loop writes the inputs of stations."""
    outlets = array_at(row.outlet, row.outlet_count, _OUTLET)
    words = row.axis_count * _AXIS_WORDS
    reals, whole = array_at(row.axis, words, _REAL), array_at(row.axis, words, _WORD)
    changed = False
    for number in range(row.outlet_count):
        outlet = outlets[number]
        value = values[outlet.value]
        if outlet.form == OUTLET_REAL:
            reals[outlet.word] = max(value * outlet.scale, outlet.least)
            step_with_plant(axes[outlet.axis], step_ns, now)
        elif outlet.form == OUTLET_PLACE:
            held = axes[outlet.axis].outside
            held.place = value
            held.speed = (value - held.shaft) * TURN / (step_ns * 1e-9)
            held.leads = 1
            step_with_plant(axes[outlet.axis], step_ns, now)
        elif outlet.form == OUTLET_STATION:
            if outlet.seen == 0 or value != outlet.shown:
                outlet.shown = value
                outlet.seen = 1
                changed = True
        else:
            mask = np.int64(1) << np.int64(outlet.shift)
            if value != 0.0:
                whole[outlet.word] |= mask
            else:
                whole[outlet.word] &= ~mask
    if changed and row.reported == row.taken:
        # one report at a time: the event loop takes all values when it comes to it
        row.reported += 1
        engine = array_at(row.engine, 1, _ENGINE)[0]
        emit(engine, array_at(row.event, row.event_count, _EVENT), PLANT_CHANGED, 0, now, int(row.reported))


@compiled_apart
def take_step(row: Any, now: int) -> None:
    """A step of the plant at ``now``; ``row``: of :data:`pnfarm.table.plant.PLANT`."""
    step = array_at(row.engine, 1, _ENGINE)[0].plant_step_ns
    since = min(now - row.last_ns, LONGEST * step) if row.last_ns != 0 else step
    values = array_at(row.value, row.value_count, _REAL)
    memory = array_at(row.memory, row.memory_count, _REAL)
    wires = array_at(row.wire, row.wire_count, _WIRE)
    _read(row, values, now)
    _copy(wires, values, 0)
    behaviours = array_at(row.behaviour, row.behaviour_count, _BEHAVIOUR)
    for number in range(row.behaviour_count):
        one = behaviours[number]
        elapsed = now - one.last_ns if one.last_ns != 0 else one.step_ns
        # a step that is not its own, but a little early, because the last one was late
        if elapsed + step // 2 <= one.step_ns:
            continue
        one.last_ns = now
        step_behaviour(
            int(one.kind),
            values[one.value : one.value + one.values],
            memory[one.memory : one.memory + one.parameters + one.state],
            elapsed * 1e-9,
        )
    _copy(wires, values, 1)
    couplings = array_at(row.coupling, row.coupling_count, _COUPLING)
    axes = array_at(row.axis, row.axis_count, _AXIS)
    uncouple(couplings, axes, int(step), now)
    _give(row, axes, values, int(step), now)
    for number in range(row.coupling_count):
        coupling = couplings[number]
        couple(coupling, axes, values[coupling.value : coupling.value + COUPLED], since * 1e-9, step * 1e-9)
    row.last_ns = now
    row.steps += 1
