"""When a table that sends nothing by itself is ticked."""

import pytest

from pnfarm.engine.columns import allocate
from pnfarm.engine.tick import next_step

MS = 1_000_000


def table(*steps_ns, last=0):
    columns = allocate(images=max(1, len(steps_ns)), axes=len(steps_ns), traces=True)
    columns.engine[0].tick_ns = MS
    for axis, step in zip(columns.axis, steps_ns, strict=False):
        axis.front, axis.last_ns, axis.step_ns = 1, last, step
    return columns


@pytest.mark.parametrize(
    ("steps", "expected"), [((4 * MS,), 4), ((1_750_000, 4 * MS), 2), ((750_000,), 1), ((MS, 4 * MS), 1), ((), 4)]
)
def test_the_next_tick_is_the_first_on_the_grid_that_a_drive_needs(steps, expected):
    assert next_step(table(*steps), 0) == expected * MS


def test_a_drive_that_is_overdue_steps_at_the_next_place_of_the_grid():
    assert next_step(table(750_000), 17_300_000) == 18 * MS
    assert next_step(table(4 * MS, last=17 * MS), 17_300_000) == 21 * MS


@pytest.mark.parametrize("drift", [50e-6, -50e-6])
def test_a_drive_whose_clock_drifts_steps_as_often_after_ten_days(drift):
    columns, now = table(MS), 864_000_000 * MS
    axis = columns.axis[0]
    axis.clock.settings.drift = drift
    axis.last_ns = now + round(now * drift)
    assert next_step(columns, now) == now + MS


@pytest.mark.parametrize("rows", ["trace_rows", "condition_rows", "program_rows"])
def test_what_is_looked_at_each_tick_keeps_the_ticks(rows):
    columns = table(4 * MS)
    columns.engine[0][rows] = 1
    assert next_step(columns, 0) == MS
