"""The parameter channel in the drive: the master's task goes to the event loop, its answer into the sent words.

A task is reported once when it changes, in an event, and the next one waits until this one is answered, as in a drive
that carries out one at a time (PROFIdrive's PKW mechanism; Moog MSD manual 8.2.4).  A task whose answer has to stay up
to date, or never came, is reported again.
"""

from __future__ import annotations

from typing import Any

from pnfarm.table.compiling.compiled import inlined
from pnfarm.table.signals import PKW_HEAD, PKW_VALUE

__all__ = ["REPEAT_NS", "exchange"]

#: Interval at which a value that is read is read again, ns.
REPEAT_NS = 20_000_000


@inlined
def exchange(image: Any, now: int) -> bool:
    """Send the present answer; returns whether ``parameter_task`` is to be reported now.

    Without valid set points there is no task and nothing is sent (Moog MSD manual 16: all outputs are zero).
    """
    task = 0
    answer = 0
    if image.valid:
        task = (int(image.received[PKW_HEAD]) << 32) | (int(image.received[PKW_VALUE]) & 0xFFFFFFFF)
        answer = int(image.parameter_answer)
    # the event loop may read between the two: no identifier comes before its value
    low = answer & 0xFFFFFFFF
    image.sent[PKW_VALUE] = low - 0x100000000 if low & 0x80000000 else low
    image.sent[PKW_HEAD] = answer >> 32
    waited = now - image.parameter_told_ns >= REPEAT_NS
    if image.parameter_answered != image.parameter_task:
        report = waited
    elif task != image.parameter_task:
        image.parameter_task = task
        report = True
    else:
        report = waited and image.parameter_repeats != 0
    if report:
        image.parameter_told_ns = now
    return report
