"""drive-fault: the drive has a fault."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.effects.confirmed import ConfirmedEffect
from pnfarm.faults.effects.connection import Status
from pnfarm.faults.effects.effect import POLL_NS
from pnfarm.faults.effects.servo import SERVO
from pnfarm.faults.errors import InjectionError
from pnfarm.faults.kind import InjectionKind, Misfits, ParamSpec
from pnfarm.vocabulary.problem import Problem

if TYPE_CHECKING:
    from pnfarm.faults.effects.injection_fields import InjectionFields

__all__ = ["HOLD", "KIND", "DriveFault", "check_repetition"]

HOLD = ParamSpec("yes or no", "The cause stays: the fault cannot be acknowledged until this is cleared.", default=False)


class DriveFault(ConfirmedEffect):
    """Raised once or ``count`` times, or held with its cause."""

    servo = SERVO
    ends_by_itself = True
    status = Status.FAULT
    _was_active = False
    _raised_before = 0
    #: The supply went before the drive had the fault.
    _missed = False

    def prepare(self) -> None:
        self._hold = bool(self.values["hold"]) or self.spec.for_ns is not None or self.spec.cycles is not None
        self._fault = self.servo.find_fault(self.values["fault"])
        if self._fault.warning:
            what = f"{self._fault.label} is a warning of this drive"
            raise InjectionError([("params.fault", what, "a fault; drive-warning raises warnings")])

    def begin(self, now: int) -> None:
        if self._hold:
            self.servo.hold_fault(self._fault)
            self._occurred(now)
        else:
            self._raise(now)

    def _raise(self, now: int) -> None:
        """Raised once; on a drive without supply when it is back."""
        if not self.servo.powered:
            self._due = now + POLL_NS
            return
        self._was_active = self._missed = False
        self._raised_before = self.servo.fault_count(self._fault)
        self.servo.raise_fault(self._fault)
        self._occurred(now)

    def check(self, now: int) -> None:
        self._look(now)
        if self._hold:
            return
        seen = self.tally.seen.activations
        active = self.servo.fault_is_active(self._fault)
        if not seen or (self._missed and self.servo.powered):
            self._raise(now)
        elif active:
            self._was_active = True
        elif self.servo.ignores_fault(self._fault):
            # without effect
            self.tally.contradict(f"a parameter of the drive has it ignore {self._fault.label}")
            self.finished = True
        elif self._was_active or self.servo.fault_count(self._fault) > self._raised_before:
            if seen >= (self.spec.count or 1):
                self.finished = True
            else:
                self._raise(now)
        elif not self.servo.powered:
            self._missed = True
            self._due = now + POLL_NS

    def end(self, now: int) -> None:
        self._look(now)
        self._due = None
        if self._hold:
            self.servo.release_fault(self._fault)


def check_repetition(spec: InjectionFields) -> Misfits:
    """While its cause stays, the fault cannot come again."""
    stays = spec.params.get("hold") is True or spec.for_ns is not None or spec.cycles is not None
    if spec.count is not None and stays:
        yield "count", Problem("does not go with a cause that stays", "either count, or one of hold, for and cycles")


KIND = InjectionKind(
    "drive-fault",
    "drive",
    "The drive has a fault: ZSW1.3, its reaction, its entry in the fault buffer.  With `for` or `cycles` its cause "
    "stays for that time.",
    "the fault; with `count` it comes again once it was acknowledged",
    DriveFault,
    {"fault": ParamSpec("fault", "Which fault.", required=True), "hold": HOLD},
    takes=frozenset({"count", "for", "cycles"}),
    misfits=check_repetition,
    place=10,
    wire="ZSW1.3 (fault present) is set, ZSW1.2 falls; the fault buffer (PNU 945, 947) has the number; a diagnosis "
    "alarm where the drive's manual has one.",
    reports="The program sees ZSW1.3. S7-1500: a technology object raises its drive alarm; a diagnosis alarm calls "
    "OB82. CODESYS: SoftMotion reports an axis error (assumed).",
)
