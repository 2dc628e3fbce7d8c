"""The parameter ``frames``: which frames a kind acts on."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.errors import InjectionError
from pnfarm.faults.gate.gate import EVERY_FRAME
from pnfarm.faults.gate.socket_gate import DATAGRAM, STREAM
from pnfarm.faults.kind import ParamSpec

if TYPE_CHECKING:
    from collections.abc import Collection

    from pnfarm.faults.gate.gate import FrameClasses

__all__ = ["FRAMES_PARAM", "NO_STREAM", "check_word", "classes_of"]


class _Streams:
    """Messages on streams, of any class."""

    def __init__(self, *, wanted: bool) -> None:
        self._wanted = wanted

    def __contains__(self, word: object) -> bool:
        return isinstance(word, str) and word.startswith(STREAM) is self._wanted


#: Every frame and datagram: TCP puts a stream's octets in order, and leaves out what it has already.
NO_STREAM: FrameClasses = _Streams(wanted=False)
_NAMED: dict[str, frozenset[str]] = {
    "rpc": frozenset({"rpc"}),
    "alarms": frozenset({"alarm", "alarm-ack", "alarm-error"}),
    "dcp": frozenset({"dcp"}),
    "arp": frozenset({"arp"}),
    "lldp": frozenset({"lldp"}),
    "datagrams": frozenset({DATAGRAM}),
}
#: Classes of a bus's acyclic frames by the word for them.
_CLASSES: dict[str, FrameClasses] = {**_NAMED, "streams": _Streams(wanted=True)}
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


def check_word(word: str, drive: str, classes: Collection[str] | None) -> None:
    """Raises :class:`InjectionError` for a word that means none of a drive's ``classes`` (None: not known)."""
    named = _CLASSES.get(word)
    if named is None or classes is None or any(one in named for one in classes):
        return
    has = [one for one, some in _CLASSES.items() if any(known in some for known in classes)]
    allowed = ", ".join(("all", "cyclic", "acyclic", *has))
    raise InjectionError([("params.frames", f"{drive} has no frames of this class on its bus", allowed)])
