"""silence: the drive is mute."""

from __future__ import annotations

from pnfarm.faults.effects.frames import FramesEffect
from pnfarm.faults.kind import FRAMES, InjectionKind

__all__ = ["KIND"]

KIND = InjectionKind(
    "silence",
    "link",
    "The drive is powered but mute: nothing that it sends arrives, cyclic or not.  It still receives.",
    "a frame that is lost; `count` holds for each direction",
    FramesEffect,
    directions=("out", "in", "both"),
    takes=FRAMES,
    place=10,
    wire="No frame of the drive, of any kind.",
    reports=(
        "After the watchdog, IO device failure (S7-1500: OB86; CODESYS: the device is shown as not running (assumed))."
    ),
)
