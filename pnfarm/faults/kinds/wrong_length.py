"""wrong-length: the IO data is longer or shorter than agreed."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from pnfarm.faults.effects.frames import FramesEffect
from pnfarm.faults.effects.wire import AGREED_LENGTH
from pnfarm.faults.kind import FRAMES, InjectionKind, Misfits, ParamSpec
from pnfarm.table.impairment import LENGTH
from pnfarm.vocabulary.problem import Problem

if TYPE_CHECKING:
    from pnfarm.faults.effects.injection_fields import InjectionFields

__all__ = ["KIND"]


class WrongLength(FramesEffect):
    """Cut, or lengthened by zeros."""

    agreed = AGREED_LENGTH
    cyclic = LENGTH
    acyclic = None
    row: ClassVar = {"amount": "by"}


def _check(spec: InjectionFields) -> Misfits:
    if spec.params.get("by") in (0, "0"):
        yield "params.by", Problem("is 0, which changes nothing", "a whole number from -1400 to 1400 other than 0")


KIND = InjectionKind(
    "wrong-length",
    "cyclic",
    "The IO data of cyclic frames is longer or shorter than agreed. On Ethernet, a frame below 60 octets is "
    "padded by the network card.",
    "a cyclic frame that is changed",
    WrongLength,
    {"by": ParamSpec("whole number", "Octets more, or below 0 fewer; not 0.", default=1, low=-1400, high=1400)},
    directions=("out",),
    takes=FRAMES,
    wire="IO data longer by `by` octets of zero, or shorter by them; cycle counter and status follow it.",
    reports="The frames are discarded: IO device failure when the watchdog expires (S7-1500, CODESYS assumed).",
    misfits=_check,
    place=90,
)
