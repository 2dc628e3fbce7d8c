"""Motion tasks of a drive: one is put together in parameters, kept under a number, and started by that.

Kollmorgen AKD (PROFINET manual 5.10.1): MT.NUM and the other MT parameters are the task that is edited, MT.SET keeps
it, MT.LOAD brings one back, MT.CLEAR forgets one or all; SATZANW or MT.MOVE starts one.  Like parameters they live in
RAM until the drive saves them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.table.axis import MOTION_TASKS, TASK_CHAINED, TASK_DEFINED, TASK_RELATIVE

if TYPE_CHECKING:
    from pnfarm.drives.axis_fields import AxisFields
    from pnfarm.drives.model import MotionTaskParameters
    from pnfarm.drives.stored_values import StoredValues

__all__ = ["MotionTasks"]

#: Of the parameter that says what a task is.
RELATIVE, CHAINED = 0x01, 0x10
_MS = 1_000_000


class MotionTasks:
    """``numbers`` are the PNUs of what a task consists of; the tasks themselves stand in ``values``."""

    __slots__ = ("_fields", "_numbers", "_values")

    def __init__(self, numbers: MotionTaskParameters, values: StoredValues, fields: AxisFields) -> None:
        self._numbers = numbers
        self._values = values
        self._fields = fields

    def keep(self) -> None:
        """The edited task becomes the one of its number."""
        number = self._values.raw(self._numbers.number)
        self._values.tasks[number] = {pnu: self._values.raw(pnu) for pnu in self._numbers.contents}
        self._apply(number)

    def load(self) -> bool:
        """Edit a copy of the task of the number at hand; false when there is none."""
        kept = self._values.tasks.get(self._values.raw(self._numbers.number))
        if kept is None:
            return False
        self._values.current.update(kept)
        return True

    def clear(self, number: int) -> None:
        """Forget one task, or all for a number below 0."""
        for known in list(self._values.tasks) if number < 0 else [number]:
            self._values.tasks.pop(known, None)
            self._apply(known)

    def apply_all(self) -> None:
        """Write every task into the axis record; what is no task is empty there."""
        for number in range(MOTION_TASKS):
            self._apply(number)

    def _apply(self, number: int) -> None:
        axis, numbers = self._fields.axis, self._numbers
        kept = self._values.tasks.get(number)
        # first: the firmware may look while the rest changes
        axis.mt_flags[number] = 0
        if kept is None:
            return
        control = kept[numbers.control]
        for field, pnu in (
            ("mt_position", numbers.position),
            ("mt_velocity", numbers.velocity),
            ("mt_acceleration", numbers.acceleration),
            ("mt_deceleration", numbers.deceleration),
        ):
            axis[field][number] = self._fields.physical(self._values.model.parameters[pnu], kept[pnu])
        axis.mt_dwell_ns[number] = kept[numbers.dwell] * _MS
        axis.mt_next[number] = kept[numbers.next]
        axis.mt_flags[number] = (
            TASK_DEFINED | (TASK_RELATIVE if control & RELATIVE else 0) | (TASK_CHAINED if control & CHAINED else 0)
        )
