"""The slots of a drive's axes: each axis has modules of its own, as far after the model's as its slot is."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.drives.description.model import Model

__all__ = ["axis_shifts", "axis_stride", "model_slots"]


def model_slots(model: Model) -> frozenset[int]:
    """The slots of the modules of a drive with one axis."""
    return frozenset(module.slot for telegram in model.profidrive.telegrams.values() for module in telegram.modules)


def axis_stride(model: Model) -> int:
    """How many slots an axis takes."""
    slots = model_slots(model)
    return max(slots) - min(slots) + 1


def axis_shifts(model: Model, slots: Sequence[int | None]) -> list[int]:
    """How far after the model's the slots of each axis are; ``slots``: where they begin.

    None: after those of the axis before it, the first where the model has them.
    """
    first, stride = min(model_slots(model)), axis_stride(model)
    shifts: list[int] = []
    for slot in slots:
        shifts.append((shifts[-1] + stride if shifts else 0) if slot is None else slot - first)
    return shifts
