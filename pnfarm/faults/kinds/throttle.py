"""throttle: the line is slow."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.faults.effects.shaped import MOST_NS, ShapedEffect
from pnfarm.faults.gate.frame_words import FRAMES_PARAM
from pnfarm.faults.gate.gate import GateRule
from pnfarm.faults.gate.shaping import LINE_OCTETS
from pnfarm.faults.gate.socket_gate import STREAM
from pnfarm.faults.kind import EVERY_DIRECTION, HELD, InjectionKind, ParamSpec
from pnfarm.table.impairment import THROTTLE

if TYPE_CHECKING:
    from pnfarm.faults.gate.gate import DueFrame
    from pnfarm.wire.direction import Direction

__all__ = ["KIND"]

#: Nanoseconds that an octet takes at 1 kbit/s.
OCTET_NS = 8_000_000.0
#: Octets of Ethernet, IPv4 and TCP in front of a message.
HEADERS = 54


class SlowLine(GateRule):
    """Acyclic frames wait until those before them have passed."""

    def __init__(self, *args: Any, octet_ns: float, queue_ns: int, **fields: Any) -> None:
        super().__init__(*args, **fields)
        self.is_repeated = False
        self._octet_ns = octet_ns
        self._queue_ns = queue_ns
        self._free_ns: dict[Direction, int] = {"out": 0, "in": 0}
        self._now = 0

    def chooses(self, direction: Direction, now: int) -> bool:
        self._now = now
        return self._free_ns[direction] > now

    def left(
        self, direction: Direction, frame_class: str, frame: bytes, due: int, *, hit: bool, bare: bool = False
    ) -> list[DueFrame]:
        del hit
        if not self.acts(direction, frame_class, self._now):
            return [(due, frame)]
        starts = max(due, self._free_ns[direction])
        # a stream's octets are repeated until they have come
        if starts - due > self._queue_ns and not frame_class.startswith(STREAM):
            return []
        octets = len(frame) + LINE_OCTETS + HEADERS * bare
        self._free_ns[direction] = starts + int(octets * self._octet_ns)
        return [(starts, frame)]


class Throttle(ShapedEffect):
    """A line for cyclic frames, and one for acyclic ones."""

    cyclic = THROTTLE

    def fields(self) -> dict[str, float]:
        return {"octet_ns": OCTET_NS / self.values["rate"], "delay_ns": self.values["queue"]}

    def rule(self, *args: Any, **fields: Any) -> GateRule:
        rate = OCTET_NS / self.values["rate"]
        return SlowLine(*args, octet_ns=rate, queue_ns=self.values["queue"], **fields)


KIND = InjectionKind(
    "throttle",
    "frames",
    "The line is slow: frames wait for those before them, and are lost when they would wait too long.  Cyclic and "
    "acyclic frames have such a line each.",
    "a frame that had to wait, or was lost",
    Throttle,
    {
        "frames": FRAMES_PARAM,
        "rate": ParamSpec(
            "number", "Of frames with preamble, check and gap.", default=100.0, unit="kbit/s", low=1.0, high=1e6
        ),
        "queue": ParamSpec("duration", "Longest wait.", default="100ms", high=MOST_NS),
    },
    directions=EVERY_DIRECTION,
    takes=HELD,
    wire="Frames are no closer than the rate permits; when they are more than that, some are missing.",
    reports="A drive whose frames need more than the rate: IO device failure (S7-1500; CODESYS assumed).",
    place=60,
)
