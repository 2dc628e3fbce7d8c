"""Effects that delay, repeat or change frames of any class."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar

from pnfarm.faults.effects.effect import seed_of
from pnfarm.faults.effects.frames import FramesEffect
from pnfarm.faults.errors import InjectionError
from pnfarm.faults.gate.frame_words import NO_STREAM, classes_of
from pnfarm.faults.gate.gate import FrameClasses, GateRule
from pnfarm.faults.gate.shaping import Shape

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["MOST_NS", "ShapedEffect"]

#: Longest delay: what waits is kept.
MOST_NS = 10_000_000_000


class ShapedEffect(FramesEffect):
    """Those of the parameter ``frames``: cyclic ones by the engine, acyclic ones by the gate.

    ``no_streams``: why it can do nothing to streams, empty if it can.  ``shaped`` are the fields of the acyclic frames'
    shape, each with the parameter that it has.
    """

    no_streams: ClassVar[str] = ""
    shaped: ClassVar[Mapping[str, str]] = MappingProxyType({})

    def acts_on(self) -> tuple[int | None, FrameClasses | None]:
        word = self.values["frames"]
        cyclic, acyclic = classes_of(word)
        if self.no_streams:
            if word == "streams":
                raise InjectionError([("params.frames", self.no_streams, "datagrams, cyclic, acyclic or all")])
            acyclic = NO_STREAM if word in {"all", "acyclic"} else acyclic
        return self.cyclic if cyclic else None, acyclic

    def shape(self, seed: int) -> Shape:
        """What becomes of an acyclic frame."""
        return Shape(seed, **{field: self.values[param] for field, param in self.shaped.items()})

    def rule(self, *args: Any, **fields: Any) -> GateRule:
        # another sequence than that of the choice
        return GateRule(*args, shape=self.shape(seed_of(self.spec, self.drive.name) + 32), **fields)
