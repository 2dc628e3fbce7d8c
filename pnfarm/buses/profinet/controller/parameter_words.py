"""The master's end of the cyclic parameter channel (PKW): a task into the set points, the answer out of them."""

from __future__ import annotations

from typing import Any

from pnfarm.drives.profiles.profidrive.pkw import Pkw, emit_pkw, parse_pkw
from pnfarm.table.signals import PKW_HEAD, PKW_VALUE

__all__ = ["parameter_answer", "put_parameter_task"]


def put_parameter_task(image: Any, task: Pkw) -> None:
    """Let ``task`` stand in the telegrams of one drive, whose process image this is.

    The value goes before the identifier.  A master that puts task 0 between two others, and waits for its answer, can
    be sure that no telegram brings the identifier of the one with the value of the other.
    """
    octets = emit_pkw(task)
    image.sent[PKW_VALUE] = int.from_bytes(octets[4:], "big", signed=True)
    image.sent[PKW_HEAD] = int.from_bytes(octets[:4], "big", signed=True)


def parameter_answer(image: Any) -> Pkw:
    """What the drive's telegrams say."""
    words = (int(image.received[PKW_HEAD]), int(image.received[PKW_VALUE]))
    return parse_pkw(b"".join(word.to_bytes(4, "big", signed=True) for word in words))
