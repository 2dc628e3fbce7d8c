"""The parameter ``frames``: which frames a kind acts on."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.gate import EVERY_FRAME
from pnfarm.faults.kind import ParamSpec

if TYPE_CHECKING:
    from pnfarm.faults.gate import FrameClasses

__all__ = ["FRAMES_PARAM", "classes_of"]

#: Classes of a bus's acyclic frames by the word for them; a bus without such frames has none of the class.
_CLASSES: dict[str, frozenset[str]] = {
    "rpc": frozenset({"rpc"}),
    "alarms": frozenset({"alarm", "alarm-ack", "alarm-error"}),
    "dcp": frozenset({"dcp"}),
    "arp": frozenset({"arp"}),
    "lldp": frozenset({"lldp"}),
}
FRAMES_PARAM = ParamSpec(
    "word",
    "Which frames: cyclic data, acyclic ones (all that follow), one class of them, or all.",
    default="all",
    words={word: number for number, word in enumerate(("all", "cyclic", "acyclic", *_CLASSES))},
)


def classes_of(word: str) -> tuple[bool, FrameClasses | None]:
    """Whether cyclic frames are meant, and which acyclic ones (None: none)."""
    if word == "cyclic":
        return True, None
    return word == "all", _CLASSES.get(word, EVERY_FRAME)
