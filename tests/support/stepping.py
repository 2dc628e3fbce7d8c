"""Time passes for a drive on the bench: many firmware steps in one compiled call, as a call costs more than its step.

With ``PNFARM_STEPS=FOLDER`` some of the steps are kept there, in a file for each process, octet for octet as they were
before and behind each, so that :mod:`replay` can do the same steps interpreted and compare.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from pnfarm.firmware.axis import AXIS
from pnfarm.firmware.profidrive.sign_of_life import count_life
from pnfarm.firmware.step import step
from pnfarm.table.compiling.compiled import compiled
from pnfarm.table.image import IMAGE

#: Where steps are kept, and how many of one test at the most.
KEPT = os.environ.get("PNFARM_STEPS", "")
MOST = 48

#: One kept step: the records before and behind it, the time behind it, and what else passed with it.
STEP = np.dtype(
    [
        ("axis", AXIS.dtype), ("image", IMAGE.dtype), ("now", "i8"), ("life", "u1"), ("frame", "u1"),
        ("axis_after", AXIS.dtype), ("image_after", IMAGE.dtype),
    ]
)  # fmt: skip


@compiled
def pass_time(axes: Any, images: Any, now: int, step_ns: int, steps: int, life: int, frame: int) -> int:
    """``steps`` steps of row 0, ``step_ns`` each; the time behind them.

    ``frame``: each brings a frame of set points, the same as the last one, while set points are valid, and an answer
    leaves; ``life``: the sign of life is counted.
    """
    axis = axes[0]
    image = images[0]
    for _ in range(steps):
        now += step_ns
        if frame and image.valid:
            image.frames = (int(image.frames) + 1) & 0xFFFFFFFF
        if life:
            count_life(axis, image)
        step(axis, image, now)
        if life:
            image.filled = (int(image.filled) + 1) & 0xFFFFFFFF
    return now


class _Keeper:
    """The first steps of each test, then rarer and rarer ones."""

    def __init__(self) -> None:
        self._test = ""
        self._calls = 0
        self._next = 0
        self._count = 0

    def wants(self) -> bool:
        test = os.environ.get("PYTEST_CURRENT_TEST", "").rpartition(" ")[0]
        if test != self._test:
            self._test, self._calls, self._next, self._count = test, 0, 0, 0
        self._calls += 1
        if self._count == MOST or self._calls <= self._next:
            return False
        self._count += 1
        self._next = self._calls + self._calls // 8
        return True

    def keep(self, step: np.ndarray) -> None:
        with (Path(KEPT) / f"{os.getpid()}.steps").open("ab") as file:
            file.write(step.tobytes())


_keeper = _Keeper()


def run_steps(
    axes: Any, images: Any, now: int, step_ns: int, steps: int, *, life: bool = False, frame: bool = False
) -> int:
    """:func:`pass_time`, of which the first step may be kept."""
    if KEPT and steps and _keeper.wants():
        kept = np.zeros(1, STEP)
        kept["axis"], kept["image"] = axes[:1], images[:1]
        kept["life"], kept["frame"] = life, frame
        now = pass_time(axes, images, now, step_ns, 1, life, frame)
        kept["now"], kept["axis_after"], kept["image_after"] = now, axes[:1], images[:1]
        _keeper.keep(kept)
        steps -= 1
    return int(pass_time(axes, images, now, step_ns, steps, life, frame))
