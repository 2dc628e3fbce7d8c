"""Parameters at their limits, many at once, and set points of any kind: the axis still computes with numbers."""

from __future__ import annotations

import math
from random import Random
from typing import Any

import numpy as np
import pytest
from drives_kit import Running

from pnfarm.drives.parameters.parameter import Backing, Form, Parameter, ParameterError
from pnfarm.firmware.axis import AXIS

MODELS = ("akd-profinet", "akd-profinet-2012", "hiwin-e1", "moog-msd")
#: Bits of float32: no numbers, infinities, the greatest, the smallest ones.
FLOATS = (0x7FC00000, 0xFFC00001, 0x7F800000, 0xFF800000, 0x7F7FFFFF, 0xFF7FFFFF, 1, 0x00800000, 0x80000000, 0)
EXTREMES = (0, 1, -1, 0x7FFFFFFF, -0x80000000, 0x4000, 0x7FFF, -0x8000)
WALK = (0x4F6, 0x476, 0x477, 0x47F)
#: Fields where infinity is a word: no limit.
UNLIMITED = frozenset(name for name, field in AXIS.fields.items() if field.default == math.inf)


def wrong_numbers(axis: Any) -> list[str]:
    found = []
    for name, field in AXIS.fields.items():
        if field.kind.startswith("f"):
            values = np.asarray(AXIS.read(axis, name))
            if np.isnan(values).any() or (name not in UNLIMITED and np.isinf(values).any()):
                found.append(name)
    return found


def shapes_the_axis(running: Running, parameter: Parameter) -> bool:
    model = running.drive.model
    units = {*(model.factor_group.numbers if model.factor_group else ())}
    units |= {*(model.control_limits.numbers if model.control_limits else ())}
    return parameter.backing is Backing.FIELD or parameter.pnu in units


def write(running: Running, rng: Random, parameter: Parameter) -> str:
    """An extreme value of one parameter, or of one of its elements; what was written, empty when it was refused."""
    pool = [parameter.minimum, parameter.maximum, 0, 1, -1, parameter.default]
    pool += [rng.randint(parameter.minimum, parameter.maximum)]
    if parameter.form is Form.FLOAT or parameter.scale.startswith("float32"):
        pool += 2 * FLOATS
    value = rng.choice(pool)
    key = f"{parameter.pnu}.{rng.randrange(parameter.elements)}" if parameter.elements else str(parameter.pnu)
    try:
        running.drive.store.set(key, value)
    except ParameterError:
        return ""
    return f"{parameter.name} {key} = {value}"


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", MODELS)
def test_parameters_at_their_limits_and_set_points_of_any_kind_leave_numbers_in_the_axis(name: str, seed: int) -> None:
    rng = Random(seed)
    running = Running(name)
    writable = [p for p in running.drive.model.parameters.values() if p.writable]
    shaping = [p for p in writable if shapes_the_axis(running, p)]
    written: list[str] = []
    for word in WALK:
        running.send(word, 0, 50)
    assert running.axis.drive.state == 4
    for _ in range(60):
        for _ in range(rng.randint(1, 6)):
            chosen = shaping if shaping and rng.random() < 0.9 else writable
            written.append(write(running, rng, rng.choice(chosen)))
        for slot in range(running.image.received.shape[0]):
            if rng.random() < 0.3:
                running.image.received[slot] = rng.choice((*EXTREMES, rng.randint(-(2**31), 2**31 - 1)))
        set_point = int(running.image.received[1])
        for word in WALK:
            running.send(word, 0, 4)
        running.send(rng.choice((0x47F, 0x47F, 0x43F, 0x147F, 0x4FF, rng.randrange(1 << 16))), set_point, 20)
        assert wrong_numbers(running.axis) == [], [word for word in written if word][-12:]
    assert [word for word in written if word], "no parameter was taken"
