"""The general state machine of the profile: every three control words one after the other, from each state."""

from __future__ import annotations

from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pytest
from bench_axis import MS, BenchAxis

from pnfarm.firmware.step import step
from pnfarm.table.axis_codes import CMD_RAISE_FAULT
from pnfarm.table.compiling.compiled import IS_COMPILED, compiled
from pnfarm.table.signals import STW1, ZSW1

ON, NO_COAST, NO_QUICK_STOP, ENABLE, ACKNOWLEDGE, CONTROL = (1 << bit for bit in (0, 1, 2, 3, 7, 10))
#: The ramp bits: they move the axis, and no state depends on them.
RAMPS = 0x0070
BITS = (ON, NO_COAST, NO_QUICK_STOP, ENABLE, ACKNOWLEDGE, CONTROL)
WORDS = [sum(bits) for bits in product(*((0, bit) for bit in BITS))]

#: PROFIdrive profile 4.x, general state machine: where each state leads, by (bits of STW1, their value); standstill
#: has no bits.  Words that hold several lead to the same end, whichever is looked at first.
S1, S2, S3, S4, RAMP_STOP, QUICK_STOP = range(6)
STANDSTILL = (0, 0)
LEADS: dict[int, list[tuple[tuple[int, int], int]]] = {
    S1: [((ON | NO_COAST | NO_QUICK_STOP, NO_COAST | NO_QUICK_STOP), S2)],
    S2: [((NO_COAST, 0), S1), ((NO_QUICK_STOP, 0), S1), ((ON, ON), S3)],
    S3: [((NO_COAST, 0), S1), ((NO_QUICK_STOP, 0), S1), ((ON, 0), S2), ((ENABLE, ENABLE), S4)],
    S4: [((NO_COAST, 0), S1), ((NO_QUICK_STOP, 0), QUICK_STOP), ((ON, 0), RAMP_STOP), ((ENABLE, 0), S3)],
    RAMP_STOP: [
        ((NO_COAST, 0), S1), ((NO_QUICK_STOP, 0), QUICK_STOP), ((ON, ON), S4), ((ENABLE, 0), S2), (STANDSTILL, S2),
    ],
    QUICK_STOP: [((NO_COAST, 0), S1), ((ENABLE, 0), S1), (STANDSTILL, S1)],
}  # fmt: skip
#: ZSW1 bits 0, 1, 2 and 6 of each state; bit 2 is open while an axis switches off.
SHOWN = {S1: 0x40, S2: 0x01, S3: 0x03, S4: 0x07, RAMP_STOP: 0x03, QUICK_STOP: 0x03}
NAMING = 0x47
FAULT = 0x08

#: Milliseconds of each word: more than any word needs to its end.
HELD = 8
#: Ends where the profile says nothing: an edge of bit 7 behind a bit 10 of 0.
OPEN = -1

STARTS = [
    ("S1", (0x0400,), False), ("S2", (0x0400, 0x0406), False), ("S3", (0x0400, 0x0406, 0x0407), False),
    ("S4", (0x0400, 0x0406, 0x0407, 0x040F), False), ("fault", (0x0400,), True),
]  # fmt: skip


@compiled
def sweep(axes: Any, images: Any, now: int, firsts: Any, seconds: Any, thirds: Any, ends: Any) -> None:
    """ZSW1 behind each three words; row 0 moves, the others keep what was before each word."""
    for first in range(len(firsts)):
        axes[0], images[0] = axes[1], images[1]
        _hold(axes[0], images[0], now, firsts[first])
        axes[2], images[2] = axes[0], images[0]
        for second in range(len(seconds)):
            axes[0], images[0] = axes[2], images[2]
            _hold(axes[0], images[0], now + HELD * MS, seconds[second])
            axes[3], images[3] = axes[0], images[0]
            for third in range(len(thirds)):
                axes[0], images[0] = axes[3], images[3]
                _hold(axes[0], images[0], now + 2 * HELD * MS, thirds[third])
                ends[first, second, third] = images[0].sent[ZSW1]


@compiled
def _hold(axis: Any, image: Any, now: int, word: int) -> None:
    image.received[STW1] = word
    for number in range(HELD):
        step(axis, image, now + (number + 1) * MS)


def started(words: tuple[int, ...], fault: bool, rpm: float, ramps: int) -> BenchAxis:
    """A drive in a state, and room beside it; its ramps are so long that a stop outlasts the words."""
    drive = BenchAxis()
    ramp = drive.axis.ramp.settings
    ramp.deceleration = ramp.quick_stop_deceleration = 500.0
    for word in words:
        drive.write(word | ramps, rpm, run=HELD)
    if fault:
        drive.command(CMD_RAISE_FAULT, 529)
    drive.run(500)
    return drive


@cache
def behind(state: int, word: int, turning: bool, faulty: bool) -> int:
    """The state that a word leads to, by the profile's table."""
    for (bits, value), following in LEADS[state]:
        if (bits or not turning) and word & bits == value and not (state == S1 and faulty):
            return behind(following, word, turning, faulty)
    return state


def expected(start: int, word_before: int, words: tuple[int, ...], turning: bool, faulty: bool) -> tuple[int, bool]:
    """The state behind the words, and whether the fault is still there; OPEN where the profile says nothing."""
    state, in_force, seen = start, word_before, word_before
    for word in words:
        if word & CONTROL:
            if faulty and word & ACKNOWLEDGE and not seen & ACKNOWLEDGE:
                faulty = False
            in_force = word
        elif faulty and word & ACKNOWLEDGE and not seen & ACKNOWLEDGE:
            return OPEN, faulty
        state, seen = behind(state, in_force, turning, faulty), word
    return state, faulty


def check(firsts: list[int], seconds: list[int], thirds: list[int], rpm: float, ramps: int, start: str) -> None:
    name, words, fault = next(one for one in STARTS if one[0] == start)
    drive = started(words, fault, rpm, ramps)
    axes, images = np.repeat(np.asarray(drive.axes), 4), np.repeat(np.asarray(drive.images), 4)
    ends = np.zeros((len(firsts), len(seconds), len(thirds)), np.int64)
    groups = [np.array(group, np.int64) | ramps for group in (firsts, seconds, thirds)]
    sweep(axes.view(type(drive.axes)), images.view(type(drive.images)), drive.now, *groups, ends)
    begun = {"S1": S1, "S2": S2, "S3": S3, "S4": S4, "fault": S1}[name]
    wrong = []
    for three, zsw1 in zip(product(firsts, seconds, thirds), ends.ravel().tolist(), strict=True):
        state, faulty = expected(begun, words[-1], three, rpm != 0.0, fault)
        if state != OPEN and zsw1 & (NAMING | FAULT) != SHOWN[state] | faulty * FAULT:
            wrong.append(f"{[f'0x{word:04X}' for word in three]}: ZSW1 0x{zsw1:04X}, expected state {state}")
    assert not wrong, f"{len(wrong)} from {name}: {wrong[:5]}"


@pytest.mark.parametrize("start", [name for name, *_ in STARTS])
@pytest.mark.parametrize("rpm", [0.0, 1000.0])
def test_every_two_words_and_every_three_of_switching_lead_where_the_profile_says(start, rpm):
    switching = [word for word in WORDS if word & CONTROL and not word & ACKNOWLEDGE]
    check(WORDS, WORDS, [CONTROL | NO_COAST | NO_QUICK_STOP], rpm, RAMPS, start)
    check(switching, switching, switching, rpm, RAMPS, start)


@pytest.mark.parametrize("ramps", [0x0000, 0x0010, 0x0030, 0x0050])
def test_the_bits_of_the_ramp_generator_change_no_state(ramps):
    switching = [word for word in WORDS if word & CONTROL and not word & ACKNOWLEDGE]
    check(switching, switching, [0x040F, 0x0406], 0.0, ramps, "S4")


@pytest.mark.slow
@pytest.mark.skipif(not IS_COMPILED, reason="a million steps need machine code")
@pytest.mark.parametrize("start", [name for name, *_ in STARTS])
@pytest.mark.parametrize("rpm", [0.0, 1000.0])
def test_every_three_words_lead_where_the_profile_says(start, rpm):
    check(WORDS, WORDS, WORDS, rpm, RAMPS, start)
