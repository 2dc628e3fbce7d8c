"""wrong-length: the IO data is longer or shorter than agreed."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from pnfarm.faults.effects.frames import FramesEffect
from pnfarm.faults.effects.wire import AGREED_LENGTH
from pnfarm.faults.kind import FRAMES, InjectionKind, ParamSpec
from pnfarm.table.impairment import LENGTH
from pnfarm.vocabulary.problem import Problem

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from pnfarm.faults.effects.effect import Needs
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.gate.gate import FrameClasses
    from pnfarm.wire.direction import Direction

__all__ = ["KINDS"]


class WrongLength(FramesEffect):
    """Cut, or lengthened by zeros."""

    needs: ClassVar[Needs] = (*FramesEffect.needs, AGREED_LENGTH)
    acyclic: ClassVar[FrameClasses | None] = None
    cyclic: ClassVar[int | None] = LENGTH

    def settings(self, direction: Direction) -> Mapping[str, float]:
        del direction
        return {"amount": self.values["by"]}


def _check(spec: InjectionFields) -> Iterable[tuple[str, Problem]]:
    if spec.params.get("by") in (0, "0"):
        yield "params.by", Problem("is 0, which changes nothing", "a whole number from -1400 to 1400 other than 0")


KINDS = (
    InjectionKind(
        "wrong-length",
        "cyclic",
        "The IO data of cyclic frames is longer or shorter than agreed. On Ethernet, a frame below 60 "
        "octets is padded by the network card.",
        "a cyclic frame that is changed",
        WrongLength,
        {"by": ParamSpec("whole number", "Octets more, or below 0 fewer; not 0.", default=1, low=-1400, high=1400)},
        directions=("out",),
        takes=FRAMES,
        wire="IO data longer by `by` octets of zero, or cut by them; cycle counter and status follow it.",
        reports="The frames are discarded: IO device failure when the watchdog expires (S7-1500, CODESYS assumed).",
        misfits=_check,
        place=90,
    ),
)
