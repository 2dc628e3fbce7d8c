"""fault-not-acknowledging: requests to acknowledge are ignored."""

from __future__ import annotations

from pnfarm.faults.effects.confirmed import ConfirmedEffect
from pnfarm.faults.effects.connection import Status
from pnfarm.faults.effects.servo import SERVO
from pnfarm.faults.kind import InjectionKind

__all__ = ["KIND"]

#: More requests than any farm gets.
_FOREVER = 1 << 62


class NotAcknowledging(ConfirmedEffect):
    """The firmware ignores the requests and counts them; a frame that still reports the fault confirms it."""

    servo = SERVO
    status = Status.FAULT
    # an error of positioning is acknowledged as well, and is no fault
    must_show = False

    def put(self) -> None:
        self._seen, _ = self.servo.acknowledgements_refused
        self._until = _FOREVER if self.spec.count is None else self._seen + self.spec.count
        self.servo.refusals.put(self._until)

    def check(self, now: int) -> None:
        refused, last_ns = self.servo.acknowledgements_refused
        refused = min(refused, self._until)
        for _ in range(self._seen, refused):
            self.tally.note(last_ns)
            self._look_since, self._missed_ns = last_ns, None
        self._seen = refused
        self._look(now)
        # with a connection the next frame shows whether the fault is still reported
        self.finished = refused >= self._until and self._due is None

    def end(self, now: int) -> None:
        self.check(now)
        self._due = None
        self.servo.refusals.take(self._until)


KIND = InjectionKind(
    "fault-not-acknowledging",
    "drive",
    "A fault stays although it is acknowledged: requests to acknowledge are ignored, whether they come by STW1.7, by a "
    "parameter or by the hardware enable.  Switching the supply off and on still clears the fault.",
    "a request that is ignored while there is something to acknowledge",
    NotAcknowledging,
    takes=frozenset({"count", "for", "cycles"}),
    place=35,
    wire="ZSW1.3 (fault present) stays set after an edge of STW1.7; PNU 945 and 947 keep the number.",
    reports="The bus reports nothing: the program acknowledges and sees ZSW1.3 as before. S7-1500: a technology "
    "object's drive alarm comes again after MC_Reset (assumed). CODESYS: MC_Reset ends with an error (assumed).",
)
