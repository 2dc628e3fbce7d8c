"""Sign of life: a count from 1 to 15 in bits 12..15 of STW2 and ZSW2 (PROFIdrive 4.2; Moog MSD manual 8.3.2).

The controller counts each frame of set points; the drive counts its own with each frame that it receives (where its
clock drifts against the controller's, with each that it sends), and monitors the controller's:

* monitoring begins after 15 frames in sequence, so that a controller without a sign of life is not monitored;
* a frame whose count does not follow the last one increases the error counter by ten, every other decreases it by one;
* ten times the tolerance (PNU 925) is a fault, and the counter's maximum.  A tolerance of 65535 switches it off;
* a drive that monitors in isochronous operation only does not here, because there is no such operation.

:func:`count_life` runs in every tick, because frames may come more often than the drive is stepped; :func:`check_life`
belongs to the step, which raises the fault.
"""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.faults import raise_fault
from pnfarm.firmware.profidrive.status_word import second_status_word
from pnfarm.table.axis_codes import LIFE_FAILED, LIFE_GOOD, LIFE_TOLD
from pnfarm.table.compiling.compiled import inlined
from pnfarm.table.signals import STW2, ZSW2

__all__ = ["check_life", "count_life", "following", "forget_life"]


#: Bit offset of the count.
SHIFT = 12
#: Largest count; it is followed by 1.
LARGEST = 15
#: Frames in sequence until the controller is monitored.
SEQUENCE = 15
FAILED = 10
ALL_TOLERATED = 0xFFFF


@inlined
def following(count: int, frames: int) -> int:
    """The count ``frames`` frames after ``count``; 0, none yet, is followed by 1."""
    if frames == 0:
        return count
    return 1 + (count + frames - 1) % LARGEST


@inlined
def forget_life(life: Any) -> None:
    """Cyclic data started again: nothing is known of the controller's count."""
    life.seen = 0
    life.run = 0
    life.count = 0
    life.failed = LIFE_GOOD


@inlined
def count_life(axis: Any, image: Any) -> None:
    """Evaluate the frames since the last call, if any."""
    frames = (int(image.frames) - int(axis.life.frames)) & 0xFFFFFFFF
    axis.life.frames = image.frames
    sent = (int(image.filled) - int(axis.life.counted)) & 0xFFFFFFFF
    axis.life.counted = image.filled
    if not image.valid:
        forget_life(axis.life)
        return
    counted = sent if axis.clock.settings.drift != 0.0 else frames
    if counted != 0:
        axis.life.sent = following(int(axis.life.sent), counted)
        image.sent[ZSW2] = second_status_word(axis)
    if frames == 0:
        return
    if axis.life.settings.isochronous:
        return
    seen = (image.received[STW2] >> SHIFT) & 0xF
    good = axis.life.seen != 0 and seen == following(int(axis.life.seen), frames)
    axis.life.seen = seen
    if axis.life.run < SEQUENCE:
        # the frame that begins a sequence counts as its first
        axis.life.run = min(SEQUENCE, int(axis.life.run) + frames) if good else (1 if seen else 0)
        axis.life.count = 0
        return
    if good:
        axis.life.count = max(0, int(axis.life.count) - frames)
        return
    axis.life.errors += 1
    if axis.life.settings.tolerance == ALL_TOLERATED:
        return
    most = FAILED * int(axis.life.settings.tolerance)
    axis.life.count = min(int(axis.life.count) + FAILED, most)
    if axis.life.count >= most:
        axis.life.failed = LIFE_FAILED


@inlined
def check_life(faults: Any, life: Any, now: int) -> None:
    """Raise the model's fault once too many signs of life failed."""
    if life.failed == LIFE_FAILED:
        life.failed = LIFE_TOLD
        raise_fault(faults, life.settings.fault, now)
