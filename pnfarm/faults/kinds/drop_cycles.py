"""drop-cycles: the next cycles are dropped."""

from __future__ import annotations

from pnfarm.faults.effects.frames import FramesEffect
from pnfarm.faults.kind import InjectionKind

__all__ = ["KIND"]


class DropCycles(FramesEffect):
    """Cyclic frames alone."""

    acyclic = None

    def prepare(self) -> None:
        if self.spec.count is None and self.spec.for_ns is None and self.spec.cycles is None:
            self.spec = self.spec.limited_to(1)
        super().prepare()


KIND = InjectionKind(
    "drop-cycles",
    "cyclic",
    "The next `count` cyclic frames are dropped; without an end, only one.",
    "a cyclic frame that is dropped; `count` holds for both directions together",
    DropCycles,
    directions=("out", "in", "both"),
    takes=frozenset({"count", "for", "cycles"}),
    wire="A gap of that many cycles; the next frame has the counter of its own cycle.",
    reports="Fewer than the watchdog factor: nothing; a controller shows the last data. From the watchdog factor on: "
    "IO device failure (S7-1500); CODESYS the same (assumed).",
    place=5,
)
