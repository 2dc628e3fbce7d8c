"""An incremental encoder."""

from __future__ import annotations

from math import floor
from typing import Any

from pnfarm.behaviours.declaration import Behaviour, bit, number, quantity
from pnfarm.table.compiling.compiled import inlined

__all__ = ["ENCODER", "step_encoder"]


@inlined
def step_encoder(values: Any, memory: Any, _seconds: float) -> None:
    """Ports: position, count, a, b, zero.  Memory: lines, limit."""
    lines, limit = memory[0], memory[1]
    place = values[0]
    # four edges a line, as a counter that takes both tracks counts
    count = floor(place * lines * 4.0)
    quarter = int(count - 4.0 * floor(count * 0.25))
    values[2] = 1.0 if 0 < quarter < 3 else 0.0
    values[3] = 1.0 if quarter >= 2 else 0.0
    values[4] = 1.0 if place - floor(place) < 1.0 / (4.0 * lines) else 0.0
    values[1] = count - limit * floor(count / limit) if limit > 0.0 else count


ENCODER = Behaviour(
    "encoder",
    "An incremental encoder with two tracks and a zero mark; its counter wraps as that of a counter module.",
    "count = floor(position * lines * 4) modulo limit",
    inputs=(number("position", "of its shaft", "revolutions"),),
    outputs=(
        number("count", "edges of both tracks"),
        bit("a", "track A"),
        bit("b", "track B"),
        bit("zero", "zero mark, a quarter of a line wide"),
    ),
    parameters=(
        quantity("lines", "lines of a revolution", default=1024.0, low=1.0, high=1e9),
        quantity("limit", "number at which the count wraps to 0, 0 = never", default=0.0, low=0.0),
    ),
    state=0,
    step=step_encoder,
)
