"""alarm-unacknowledged: the alarm handshake breaks."""

from __future__ import annotations

from pnfarm.buses.profinet.faults.alarms import ALARMS
from pnfarm.buses.profinet.faults.frame_class import ALARM, ALARM_ACK, acknowledging_nothing
from pnfarm.buses.profinet.faults.frames import PROFINET_FRAMES
from pnfarm.buses.profinet.faults.modules import MODULES
from pnfarm.buses.profinet.faults.own_alarm import NEVER_BY_ITSELF, OWN_ALARM_PARAMS, own_alarm
from pnfarm.faults.effects.connection import CONNECTION
from pnfarm.faults.effects.effect import POLL_NS, ChanceEffect
from pnfarm.faults.gate.gate import GateRule
from pnfarm.faults.kind import EACH, InjectionKind, ParamSpec

__all__ = ["KIND"]


class AlarmUnacknowledged(ChanceEffect):
    """Answers are lost until the connection ends; then repeated as ``count`` says."""

    connection = CONNECTION
    wire = PROFINET_FRAMES
    alarms = ALARMS
    modules = MODULES
    once = True
    _rule: GateRule | None = None
    _keys: frozenset[int] = frozenset()
    _passed: frozenset[int] = frozenset()

    def prepare(self) -> None:
        super().prepare()
        self._alarm = own_alarm(self.values, self.modules) if self.values["raise"] else None

    def begin(self, now: int) -> None:
        self.check(now)

    def check(self, now: int) -> None:
        connection = self.connection.now()
        standing = connection.keys if connection else frozenset()
        if self._rule is not None:
            if standing & self._keys:
                self._due = now + POLL_NS
                return
            self._hear_again()
            self.finished = self.exhausted
        if not self.finished and connection and connection.established and not standing & self._passed:
            self._passed = standing
            happens = self.happens()
            if happens:
                self._rule, self._keys = self._new_rule(), standing
                self.wire.gate(self._rule)
                self._due = now + POLL_NS
                if self._alarm is not None:
                    self.alarms.send(self._alarm, now)
            self.tally.note(now, happened=happens)

    def _new_rule(self) -> GateRule:
        if self.values["what"] == "no-ack":
            # an AlarmAck that never came gets no acknowledgement, not even in a later alarm
            return GateRule(("in",), frozenset({ALARM}))
        return GateRule(("in",), frozenset({ALARM, ALARM_ACK}), instead=acknowledging_nothing)

    def _hear_again(self) -> None:
        """Answers pass again; the lost ones prove that the controller sent some."""
        if self._rule is not None:
            self.wire.ungate(self._rule)
            if self._rule.evidence().confirmed:
                self.tally.confirm()
            self._rule = None
        self._due = None

    def end(self, now: int) -> None:
        self._hear_again()
        if self._alarm is not None:
            self.alarms.correct(self._alarm, now)


KIND = InjectionKind(
    "alarm-unacknowledged",
    "alarms",
    "The alarm handshake breaks.  With `no-ack` the drive sends an alarm and never acknowledges the controller's "
    "AlarmAck, so that the controller repeats it and ends the connection.  With `repeat` the drive repeats its alarm, "
    "as if the controller's acknowledgement had not come, and then ends the connection.  " + NEVER_BY_ITSELF,
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
    wire="An alarm of the drive, then no acknowledgement for the controller's AlarmAck (`no-ack`), or the alarm again "
    "and again (`repeat`); then an ERR-RTA-PDU.",
    reports="When its repetitions are used up, the controller ends the connection: IO device failure (S7-1500: OB86; "
    "CODESYS: the device is shown as not running (assumed)).",
)
