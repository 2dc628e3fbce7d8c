"""What the front cannot do itself: it goes to the event loop in an event, as one number, and an answer comes back.

``image.parameter_task``: a count in bits 32 to 62, TASK_* in bits 24 to 31, 1 in bit 16 for a write, and an instance or
attribute in bits 0 to 15; data are in ``ethernetip.task_value``.  The next task is posted when this one was answered.
"""

from __future__ import annotations

from typing import Any

from pnfarm.table.compiling.compiled import inlined

__all__ = ["TASK_ATTRIBUTE", "TASK_MAP", "TASK_MOVE", "TASK_PARAMETER", "idle", "post", "tells"]

TASK_ATTRIBUTE = 1  # set an attribute of the position controller (6.2.2.6)
TASK_PARAMETER = 2  # read or write a parameter (6.2.2.7)
TASK_MAP = 3  # the mapped set points have changed (9.1)
TASK_MOVE = 4  # motion task 0 is what was begun last (6.2.2.4)

#: A task without an answer is reported again after this time, ns.
REPEAT_NS = 20_000_000


@inlined
def idle(image: Any) -> bool:
    """Whether no task waits for its answer."""
    return image.parameter_answered == image.parameter_task


@inlined
def post(own: Any, image: Any, kind: int, number: int, write: int, value: int) -> None:
    """A new task, while :func:`idle`."""
    own.tasks = (int(own.tasks) + 1) & 0x7FFFFFFF
    own.task_value = value
    image.parameter_task = int(own.tasks) << 32 | kind << 24 | write << 16 | number & 0xFFFF
    own.posted = 1


@inlined
def tells(own: Any, image: Any, now: int) -> bool:
    """Whether ``image.parameter_task`` is to be reported now."""
    if not own.posted and (idle(image) or now - image.parameter_told_ns < REPEAT_NS):
        return False
    own.posted = 0
    image.parameter_told_ns = now
    return True
