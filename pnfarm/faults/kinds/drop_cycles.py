"""drop-cycles: the next cycles are dropped."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from pnfarm.faults.effects.frames import FramesEffect
from pnfarm.faults.kind import InjectionKind
from pnfarm.table.impairment import LOSS

if TYPE_CHECKING:
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive
    from pnfarm.faults.gate.gate import FrameClasses

__all__ = ["KINDS"]


class DropCycles(FramesEffect):
    """Cyclic frames alone."""

    cyclic: ClassVar[int | None] = LOSS
    acyclic: ClassVar[FrameClasses | None] = None

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        unlimited = spec.count is None and spec.for_ns is None and spec.cycles is None
        super().__init__(spec.limited_to(1) if unlimited else spec, drive)


KINDS = (
    InjectionKind(
        "drop-cycles",
        "cyclic",
        "The next cyclic frames are dropped: as many as `count` says, without an end one.",
        "a cyclic frame that is dropped; `count` holds for both directions together",
        DropCycles,
        directions=("out", "in", "both"),
        takes=frozenset({"count", "for", "cycles"}),
        wire="A gap of that many cycles; the next frame has the counter of its own cycle.",
        reports=(
            "Fewer than the watchdog factor: nothing; a controller shows the last data. From the watchdog "
            "factor on: IO device failure (S7-1500); CODESYS the same (assumed)."
        ),
        place=5,
    ),
)
