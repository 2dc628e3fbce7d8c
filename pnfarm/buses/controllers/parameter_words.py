"""The master's end of the cyclic parameter channel (PKW): a task into the set points, the answer out of them."""

from __future__ import annotations

from typing import Any

from pnfarm.drives.profiles.profidrive.pkw import NO_TASK, Pkw, emit_pkw, parse_pkw
from pnfarm.table.signals import PKW_HEAD, PKW_VALUE

__all__ = ["parameter_answer", "put_parameter_task"]

#: The index (IND), in the double word of parameter identifier and number (PKE).
_BELOW_IDENTIFIER = 0xFFFF


def put_parameter_task(image: Any, task: Pkw) -> None:
    """Send ``task`` in the telegrams of one drive, whose process image this is.

    The engine may fill a telegram between any two of these writes.  So the value goes before the identifier, and task 0
    clears the identifier alone.  A master that puts task 0 between two others, and waits for its answer, can be sure
    that no telegram brings the identifier of the one with the value of the other.
    """
    if task.identifier == NO_TASK.identifier:
        image.sent[PKW_HEAD] = int(image.sent[PKW_HEAD]) & _BELOW_IDENTIFIER
        return
    octets = emit_pkw(task)
    image.sent[PKW_VALUE] = int.from_bytes(octets[4:], "big", signed=True)
    image.sent[PKW_HEAD] = int.from_bytes(octets[:4], "big", signed=True)


def parameter_answer(image: Any) -> Pkw:
    """The answer in the drive's telegrams."""
    words = (int(image.received[PKW_HEAD]), int(image.received[PKW_VALUE]))
    return parse_pkw(b"".join(word.to_bytes(4, "big", signed=True) for word in words))
