"""sequence-freeze, sequence-jump: the sequence number or the sequence count of cyclic packets is wrong."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.ethernetip.faults.frames import CipFramesEffect
from pnfarm.faults.kind import FRAMES, InjectionKind, Misfits, ParamSpec
from pnfarm.table.impairment import BOTH_COUNTS, COUNTER_FREEZE, COUNTER_JUMP, SEQUENCE_COUNT, SEQUENCE_NUMBER
from pnfarm.vocabulary.problem import Problem

if TYPE_CHECKING:
    from pnfarm.faults.effects.injection_fields import InjectionFields

__all__ = ["KINDS"]

_WHICH = {"both": BOTH_COUNTS, "number": SEQUENCE_NUMBER, "count": SEQUENCE_COUNT}


def _which(default: str) -> ParamSpec:
    return ParamSpec(
        "word",
        "The encapsulation's sequence number (32 bits), the sequence count in front of the data (16 bits), or both.",
        default=default,
        words=_WHICH,
    )


class SequenceFreeze(CipFramesEffect):
    """At the value of the first packet that was hit."""

    cyclic = COUNTER_FREEZE

    def fields(self) -> dict[str, float]:
        return {"whole": _WHICH[self.values["which"]]}


class SequenceJump(CipFramesEffect):
    """By a constant number."""

    cyclic = COUNTER_JUMP

    def fields(self) -> dict[str, float]:
        return {"amount": self.values["by"], "whole": _WHICH[self.values["which"]]}


def _check(spec: InjectionFields) -> Misfits:
    if spec.params.get("by") in (0, "0"):
        yield "params.by", Problem("is 0, which changes nothing", "a whole number other than 0")


KINDS = (
    InjectionKind(
        "sequence-freeze",
        "cyclic",
        "The sequence of cyclic packets freezes.  With the number, originators take the packets for old ones and drop "
        "them: the connection times out.  With the count only, they take them for the same data once more: the "
        "connection stays, and the data that the program sees do not change.",
        "a cyclic packet whose sequence is frozen",
        SequenceFreeze,
        {"which": _which("number")},
        directions=("out",),
        takes=FRAMES,
        place=62,
        wire="Packets in their interval with new data, and the number or count of the first one that is hit.",
        reports="Number: as when nothing comes, so that the connection times out (Logix: module fault 16#0203, "
        "CODESYS: the adapter goes to its error state (assumed)). Count: the bus reports nothing; the program's input "
        "data do not change (assumed).",
    ),
    InjectionKind(
        "sequence-jump",
        "cyclic",
        "The sequence of cyclic packets is off by `by`.  Without `count` it jumps at the start and back at the end; "
        "with `count: 1` a single packet is off.  An originator drops a packet whose number is not ahead of the last "
        "one's.",
        "a cyclic packet whose sequence is off",
        SequenceJump,
        {
            "by": ParamSpec("whole number", "Packets; not 0.", default=-100, low=-2147483648, high=2147483647),
            "which": _which("both"),
        },
        directions=("out",),
        takes=FRAMES,
        place=72,
        wire="The number differs from the true one by `by`, modulo 2^32; the count, modulo 2^16.",
        reports="Forward: nothing, and at its end packets are dropped until the number has caught up. Back: the same "
        "at its start. When that takes longer than the timeout, the connection is lost (Logix: module fault 16#0203, "
        "CODESYS: the adapter goes to its error state (assumed)).",
        misfits=_check,
    ),
)
