"""A conveyor with parts."""

from __future__ import annotations

from typing import Any

from pnfarm.behaviours.declaration import Behaviour, Parameter, bit, number, quantity
from pnfarm.table.compiling.compiled import inlined

__all__ = ["CONVEYOR", "SENSORS", "step_conveyor"]

#: Light barriers beside it, and most parts on it.
SENSORS = 8
PARTS = 64
#: Where things are in its memory.
_LENGTH, _PART, _PITCH, _SPEED, _PLACES = 0, 1, 2, 3, 4
_TRAVEL, _FED, _TAKEN, _BEGUN, _COUNT = 12, 13, 14, 15, 16
#: How far the belt has carried the part that came last, which may be gone.
_LAST = 17
_FIRST = 18
#: And its ports.
_IN_TRAVEL, _IN_RUN, _IN_FEED, _IN_TAKE, _IN_JAM = 0, 1, 2, 3, 4
_OUT_AT, _OUT_END, _OUT_PARTS, _OUT_FED, _OUT_LEFT, _OUT_FRONT = 5, 13, 14, 15, 16, 17


@inlined
def _remove(memory: Any, number: int) -> None:
    """Take a part away: those behind it count one less."""
    count = int(memory[_COUNT])
    for i in range(number, count - 1):
        memory[_FIRST + i] = memory[_FIRST + i + 1]
    memory[_COUNT] = count - 1


@inlined
def step_conveyor(values: Any, memory: Any, seconds: float) -> None:
    """Ports: travel, run, feed, take, jam; at_1 to at_8, at_end, parts, fed, left, front.

    Parts are kept by the places of their fronts, the furthest one first.  A belt that runs backwards loses them at its
    begin.
    """
    if memory[_BEGUN] == 0.0:
        memory[_BEGUN] = 1.0
        memory[_TRAVEL] = values[_IN_TRAVEL]
        memory[_LAST] = memory[_PITCH]
    way = values[_IN_TRAVEL] - memory[_TRAVEL]
    memory[_TRAVEL] = values[_IN_TRAVEL]
    if values[_IN_RUN] != 0.0:
        way += memory[_SPEED] * seconds
    if values[_IN_JAM] != 0.0:
        # the belt slips below them
        way = 0.0
    count = int(memory[_COUNT])
    for i in range(count):
        memory[_FIRST + i] += way
    pitch = memory[_PITCH]
    # the next one waits at the start until the belt moves
    memory[_LAST] = memory[_LAST] + way if memory[_LAST] < pitch else pitch
    while count > 0 and memory[_FIRST + count - 1] < 0.0:
        # it comes again where the belt runs forwards again
        memory[_LAST] += pitch
        count -= 1
    feed, take = values[_IN_FEED] != 0.0, values[_IN_TAKE] != 0.0
    while pitch > 0.0 and way > 0.0 and count < PARTS and memory[_LAST] >= pitch:
        # one behind the other, each so far behind the one before
        memory[_LAST] -= pitch
        memory[_FIRST + count] = memory[_LAST]
        count += 1
        values[_OUT_FED] += 1.0
    if feed and memory[_FED] == 0.0 and count < PARTS:
        memory[_FIRST + count] = memory[_LAST] = 0.0
        count += 1
        values[_OUT_FED] += 1.0
    memory[_COUNT] = count
    if take and memory[_TAKEN] == 0.0 and count > 0:
        _remove(memory, 0)
        values[_OUT_LEFT] += 1.0
    while memory[_COUNT] > 0.0 and memory[_FIRST] - memory[_PART] > memory[_LENGTH]:
        _remove(memory, 0)
        values[_OUT_LEFT] += 1.0
    memory[_FED] = 1.0 if feed else 0.0
    memory[_TAKEN] = 1.0 if take else 0.0
    count = int(memory[_COUNT])
    for sensor in range(SENSORS):
        place, seen = memory[_PLACES + sensor], 0.0
        if place >= 0.0:
            for i in range(count):
                if memory[_FIRST + i] - memory[_PART] <= place <= memory[_FIRST + i]:
                    seen = 1.0
        values[_OUT_AT + sensor] = seen
    values[_OUT_END] = 1.0 if count > 0 and memory[_FIRST] >= memory[_LENGTH] else 0.0
    values[_OUT_PARTS] = count
    values[_OUT_FRONT] = memory[_FIRST] if count > 0 else 0.0


CONVEYOR = Behaviour(
    "conveyor",
    "A belt or chain that carries parts past light barriers; an axis moves it, or a motor of constant speed.",
    "each part moves by the change of travel, and by speed * dt while run is on",
    inputs=(
        number("travel", "how far an axis has moved the belt, in the belt's unit of length"),
        bit("run", "its own motor runs"),
        bit("feed", "a rising edge puts a part on its start"),
        bit("take", "a rising edge takes the furthest part away"),
        bit("jam", "1 = the parts do not move, the belt slips below them"),
    ),
    outputs=(
        *(bit(f"at_{i}", f"a part is before light barrier {i}") for i in range(1, SENSORS + 1)),
        bit("at_end", "a part's front has reached the end"),
        number("parts", "parts on the belt"),
        number("fed", "parts put on it so far"),
        number("left", "parts taken away, or fallen off its end"),
        number("front", "where the furthest part's front is, 0 without a part"),
    ),
    parameters=(
        quantity("length", "from its start to its end", low=0.0),
        quantity("part", "length of a part", low=0.0),
        quantity("pitch", "parts follow each other at this distance, 0 = only by feed", default=0.0, low=0.0),
        quantity("speed", "of its own motor, per second", default=0.0),
        *(
            Parameter(f"sensor_{i}", f"where light barrier {i} is", default=-1.0, low=-1.0, high=1e12)
            for i in range(1, SENSORS + 1)
        ),
    ),
    state=6 + PARTS,
    counts={4: PARTS},
    step=step_conveyor,
)
