"""Changed frames for the engine, as ``make fuzz ARGS="--engine"`` gives it many more of."""

import numpy as np
import pytest

from pnfarm.testing import Line
from tests.fuzz import engine

ROUNDS = 16


@pytest.fixture(scope="module")
def chunks():
    line = Line.from_text(engine.FARM)
    line.run(3.0)
    return [engine.Chunks(side, line.now_ns, counted=True) for side in engine.sides(line)]


def test_changed_frames_are_each_counted_once_and_leave_alone_what_the_event_loop_writes(chunks):
    for chunk in chunks:
        assert chunk.make(7, ROUNDS) == 2 * ROUNDS * engine.FRAMES
        assert all(chunk.outcomes.values())


def test_a_storm_reaches_every_connection(chunks):
    for chunk in chunks:
        before = chunk.side.receiver.cpm.received.copy()
        chunk.make(8, ROUNDS)
        assert (chunk.side.receiver.cpm.received > before)[chunk.side.targets].all()


def test_a_field_of_the_event_loop_that_the_engine_writes_is_found(chunks):
    chunk = chunks[0]
    chunk.make(9, ROUNDS)
    chunk.side.receiver.cpm.hold_ns[chunk.side.targets[0]] += 1
    with pytest.raises(AssertionError, match=r"cpm\.hold_ns was written"):
        chunk.check_untouched()


def test_a_real_number_of_a_drive_that_is_none_is_found(chunks):
    chunk = chunks[0]
    chunk.make(10, ROUNDS)
    chunk.side.receiver.axis.motor.velocity[0] = np.nan
    with pytest.raises(AssertionError, match=r"axis\.motor\.velocity is not a number"):
        chunk.check_numbers()
