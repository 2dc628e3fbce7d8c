"""Motion tasks of a drive: a task is edited in parameters, kept under a number, and started by its number.

Kollmorgen AKD (PROFINET manual 5.10.1): MT.NUM and the other MT parameters are the task that is edited, MT.SET stores
it, MT.LOAD reads one back, MT.CLEAR deletes one or all; SATZANW or MT.MOVE starts one.  Like parameters they are in
RAM until the drive saves them.  A drive may also have tasks from a commissioning tool, with or without such parameters.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.table.axis_codes import (
    TASK_CHAINED,
    TASK_DEFINED,
    TASK_FROM_ACTUAL,
    TASK_FROM_COMMAND,
    TASK_FROM_TARGET,
    TASK_PASSING,
    TASK_RELATIVE,
)

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pnfarm.drives.description.parts import MotionTaskParameters
    from pnfarm.drives.parameters.axis_fields import AxisFields
    from pnfarm.drives.parameters.stored_values import StoredValues

__all__ = ["MotionTask", "MotionTasks"]

# MT.CNTL, bits 0 to 3, 4 and 5 to 9 (AKD parameter reference).
#: Kinds of position; the kinds without a row need an external position, which the model does not have.
KINDS = {
    0b0000: 0,
    0b0001: TASK_RELATIVE | TASK_FROM_COMMAND,
    0b0011: TASK_RELATIVE | TASK_FROM_TARGET,
    0b0111: TASK_RELATIVE | TASK_FROM_ACTUAL,
}
KIND, CHAINED, FOLLOWS, FOLLOWS_SHIFT = 0x000F, 0x0010, 0x03E0, 5
#: How the next task begins: at once, or after MT.TNEXT (also where an event from outside could shorten it).
AT_ONCE, DELAYED, DELAYED_OR_EVENT = 0b00000, 0b00001, 0b00111
#: At the target without a stop; in both the model changes velocity after the target.
PASSING, PASSING_AT_NEXT_SPEED = 0b10000, 0b11000
FOLLOWING = {AT_ONCE, DELAYED, DELAYED_OR_EVENT, PASSING, PASSING_AT_NEXT_SPEED}
_MS = 1_000_000


@dataclass(frozen=True, slots=True)
class MotionTask:
    """One task: ``position`` in rev (a distance from the commanded position if ``relative``), rpm, rpm/s.

    ``following`` is the task that begins ``dwell_ns`` after it, None for none.
    """

    number: int
    position: float
    velocity: float
    acceleration: float
    deceleration: float
    relative: bool = False
    following: int | None = None
    dwell_ns: int = 0

    @property
    def control(self) -> int:
        """MT.CNTL."""
        kind = 0b0001 if self.relative else 0b0000
        return kind if self.following is None else kind | CHAINED | DELAYED << FOLLOWS_SHIFT


class MotionTasks:
    """``numbers`` are the PNUs of a task's values; the tasks themselves are in ``values``.

    A drive without such parameters (``numbers`` None) has only the tasks that it was :meth:`given <give>`.
    """

    __slots__ = ("_fields", "_given", "_new", "_numbers", "_values")

    def __init__(self, numbers: MotionTaskParameters | None, values: StoredValues, fields: AxisFields) -> None:
        self._numbers = numbers
        self._values = values
        self._fields = fields
        self._given: dict[int, MotionTask] = {}
        #: Given and not yet in the drive: their raw numbers depend on units that come into force with it.
        self._new: dict[int, MotionTask] = {}

    def give(self, tasks: Iterable[MotionTask]) -> None:
        """Tasks of a commissioning tool: saved in the drive from the next power-on on."""
        self._given = {task.number: task for task in tasks}
        self._new = self._given

    def power_on(self) -> None:
        """Add the given tasks, once: after that, what the drive saved in their place holds."""
        if self._numbers is not None:
            for number, task in self._new.items():
                self._values.tasks[number] = self._raw(task, self._numbers)
                self._values.permanent_tasks[number] = dict(self._values.tasks[number])
        self._new = {}

    def _raw(self, task: MotionTask, numbers: MotionTaskParameters) -> dict[int, int]:
        """The task in the drive's raw numbers, rounded."""

        def number(pnu: int, physical: float) -> int:
            parameter = self._values.model.parameters[pnu]
            return min(max(self._fields.scaled(parameter, physical), parameter.minimum), parameter.maximum)

        return {
            numbers.position: number(numbers.position, task.position),
            numbers.velocity: number(numbers.velocity, task.velocity),
            numbers.acceleration: number(numbers.acceleration, task.acceleration),
            numbers.deceleration: number(numbers.deceleration, task.deceleration),
            numbers.control: task.control,
            numbers.next: task.following or 0,
            numbers.dwell: number(numbers.dwell, task.dwell_ns // _MS),
        }

    def keep(self) -> bool:
        """Store the edited task under its number; false for a task that cannot be carried out."""
        raw, numbers = self._values.raw, self._edited
        number = raw(numbers.number)
        control = raw(numbers.control)
        known = control & KIND in KINDS and (not control & CHAINED or (control & FOLLOWS) >> FOLLOWS_SHIFT in FOLLOWING)
        if not known or not (raw(numbers.velocity) and raw(numbers.acceleration) and raw(numbers.deceleration)):
            return False
        self._values.tasks[number] = {pnu: raw(pnu) for pnu in numbers.contents}
        self._apply(number)
        return True

    def store(self, task: MotionTask) -> None:
        """Store a task that the drive was given in another way than by its parameters, under its number."""
        self._values.tasks[task.number] = self._raw(task, self._edited)
        self._apply(task.number)

    def load(self) -> bool:
        """Copy the task whose number MT.NUM gives into the parameters; false when there is none."""
        kept = self._values.tasks.get(self._values.raw(self._edited.number))
        if kept is None:
            return False
        self._values.current.update(kept)
        return True

    def clear(self, number: int) -> None:
        """Delete one task, or all for a number below 0."""
        for known in list(self._values.tasks) if number < 0 else [number]:
            self._values.tasks.pop(known, None)
            self._apply(known)

    def apply_all(self) -> None:
        """Write every task into the axis record; numbers without a task are empty there."""
        # first, because the firmware may read a task while its other fields change
        self._fields.axis.motion_tasks.settings.kind[:] = 0
        for number in sorted(self._given.keys() if self._numbers is None else self._values.tasks.keys()):
            self._apply(number)

    @property
    def _edited(self) -> MotionTaskParameters:
        if self._numbers is None:
            raise ValueError("this drive has no parameters of motion tasks")
        return self._numbers

    def _apply(self, number: int) -> None:
        axis = self._fields.axis
        # first, because the firmware may read the task while the other fields change
        axis.motion_tasks.settings.kind[number] = 0
        if self._numbers is None:
            if number in self._given:
                self._write(self._given[number])
            return
        kept, numbers, given = self._values.tasks.get(number), self._numbers, self._given.get(number)
        if kept is None:
            return
        if given is not None and kept == self._raw(given, numbers):
            # the raw numbers may be too coarse for its position
            self._write(given)
            return
        parameters, physical = self._values.model.parameters, self._fields.physical
        position, velocity, up, down = (
            physical(parameters[pnu], kept[pnu])
            for pnu in (numbers.position, numbers.velocity, numbers.acceleration, numbers.deceleration)
        )
        task = MotionTask(
            number, position, velocity, up, down, following=kept[numbers.next], dwell_ns=kept[numbers.dwell] * _MS
        )
        self._write(task, kept[numbers.control])

    def _write(self, task: MotionTask, control: int | None = None) -> None:
        """Into the axis record; ``control`` is MT.CNTL where the drive has one."""
        axis, number = self._fields.axis, task.number
        control = task.control if control is None else control
        axis.motion_tasks.settings.position[number] = task.position
        axis.motion_tasks.settings.velocity[number] = task.velocity
        axis.motion_tasks.settings.acceleration[number] = task.acceleration
        axis.motion_tasks.settings.deceleration[number] = task.deceleration
        following = (control & FOLLOWS) >> FOLLOWS_SHIFT if control & CHAINED else AT_ONCE
        axis.motion_tasks.settings.dwell_ns[number] = task.dwell_ns if following in {DELAYED, DELAYED_OR_EVENT} else 0
        axis.motion_tasks.settings.next[number] = task.following or 0
        axis.motion_tasks.settings.kind[number] = (
            TASK_DEFINED
            | KINDS.get(control & KIND, 0)
            | (TASK_CHAINED if control & CHAINED else 0)
            | (TASK_PASSING if following in {PASSING, PASSING_AT_NEXT_SPEED} else 0)
        )
