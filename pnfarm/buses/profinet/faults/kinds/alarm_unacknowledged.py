"""alarm-unacknowledged: the alarm handshake breaks."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.profinet.faults.alarms import ALARMS
from pnfarm.buses.profinet.faults.frame_class import ALARM, ALARM_ACK, acknowledging_nothing
from pnfarm.buses.profinet.faults.frames import PROFINET_FRAMES
from pnfarm.buses.profinet.faults.modules import MODULES
from pnfarm.buses.profinet.faults.own_alarm import NEVER_BY_ITSELF, OWN_ALARM_PARAMS, own_alarm
from pnfarm.faults.effects.connection import CONNECTION
from pnfarm.faults.effects.effect import POLL_NS, Chance, Effect, Window
from pnfarm.faults.gate.gate import GateRule
from pnfarm.faults.kind import EACH, InjectionKind, ParamSpec

if TYPE_CHECKING:
    from pnfarm.faults.effects.evidence import Evidence
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive

__all__ = ["KINDS"]


class AlarmUnacknowledged(Effect):
    """Answers are lost until the connection ends; then repeated as ``count`` says."""

    needs = (CONNECTION, PROFINET_FRAMES, ALARMS, MODULES)

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        self._connection = drive.part(CONNECTION)
        self._wire = drive.part(PROFINET_FRAMES)
        self._alarms = drive.part(ALARMS)
        self._chance = Chance(spec, drive, spec.count if spec.count or spec.for_ns else 1)
        self._alarm = own_alarm(self.values, drive.part(MODULES)) if self.values["raise"] else None
        self._rule: GateRule | None = None
        self._keys: frozenset[int] = frozenset()
        self._passed: frozenset[int] = frozenset()
        self._due: int | None = None

    def begin(self, window: Window, now: int) -> None:
        del window
        self.check(now)

    def check(self, now: int) -> None:
        connection = self._connection.now()
        standing = connection.keys if connection else frozenset()
        if self._rule is not None:
            if standing & self._keys:
                self._due = now + POLL_NS
                return
            self._hear_again()
            self.finished = self._chance.exhausted
        if not self.finished and connection and connection.established and not standing & self._passed:
            self._passed = standing
            happens = self._chance.happens()
            if happens:
                self._rule, self._keys = self._new_rule(), standing
                self._wire.gate(self._rule)
                self._due = now + POLL_NS
                if self._alarm is not None:
                    self._alarms.send(self._alarm, now)
            self._chance.tally.note(now, happened=happens)

    def _new_rule(self) -> GateRule:
        if self.values["what"] == "no-ack":
            # an AlarmAck that never came gets no acknowledgement, not even in a later alarm
            return GateRule(("in",), frozenset({ALARM}))
        return GateRule(("in",), frozenset({ALARM, ALARM_ACK}), instead=acknowledging_nothing)

    def _hear_again(self) -> None:
        """Answers pass again; the lost ones prove that the controller sent some."""
        if self._rule is not None:
            self._wire.ungate(self._rule)
            if self._rule.evidence().confirmed:
                self._chance.tally.confirm()
            self._rule = None
        self._due = None

    def end(self, now: int) -> None:
        self._hear_again()
        if self._alarm is not None:
            self._alarms.correct(self._alarm, now)

    def evidence(self) -> Evidence:
        return self._chance.tally.seen

    def next_deadline(self) -> int | None:
        return self._due


KINDS = (
    InjectionKind(
        "alarm-unacknowledged",
        "alarms",
        "The alarm handshake breaks.  With `no-ack` the drive sends an alarm and never acknowledges the controller's "
        "AlarmAck, so that the controller repeats it and ends the connection.  With `repeat` the drive repeats its "
        "alarm, as if the controller's acknowledgement had not come, and then ends the connection.  " + NEVER_BY_ITSELF,
        "one broken connection; without `count` and `for` it happens once",
        AlarmUnacknowledged,
        {
            "what": ParamSpec("word", "Which side gets no answer.", "no-ack", words={"no-ack": 0, "repeat": 1}),
            "raise": ParamSpec(
                "yes or no", "Begin with an alarm of its own; otherwise with the drive's next one.", default=True
            ),
            **OWN_ALARM_PARAMS,
        },
        takes=EACH,
        place=20,
        wire="An alarm of the drive, then no acknowledgement for the controller's AlarmAck (`no-ack`), or the alarm "
        "again and again (`repeat`); then an ERR-RTA-PDU.",
        reports=(
            "When its repetitions are used up, the controller ends the connection: IO device failure (S7-1500: "
            "OB86; CODESYS: the device is shown as not running (assumed))."
        ),
    ),
)
