"""wrong-frame-id: the frame id is not the agreed one."""

from __future__ import annotations

from pnfarm.buses.profinet.faults.frames import ProfinetFramesEffect
from pnfarm.faults.kind import FRAMES, WORD, InjectionKind, ParamSpec
from pnfarm.table.impairment import FRAME_ID

__all__ = ["KIND"]


class WrongFrameId(ProfinetFramesEffect):
    """One given, or the agreed one plus one."""

    cyclic = FRAME_ID

    def fields(self) -> dict[str, float]:
        return {"amount": 1 if (wrong := self.values["frame_id"]) is None else wrong, "whole": wrong is not None}


KIND = InjectionKind(
    "wrong-frame-id",
    "cyclic",
    "Cyclic frames carry another frame id than agreed; controllers do not find their connection.",
    "a cyclic frame that is changed",
    WrongFrameId,
    {"frame_id": ParamSpec("whole number", "The wrong one; left out, the agreed one plus one.", default=None, **WORD)},
    directions=("out",),
    takes=FRAMES,
    wire="Frame id `frame_id`, or without it the agreed one plus one.",
    reports=(
        "The frames belong to no connection: IO device failure when the watchdog expires (S7-1500); CODESYS the "
        "same (assumed)."
    ),
    place=80,
)
