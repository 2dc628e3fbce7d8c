"""alarm-storm: the drive sends one alarm after the other."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.profinet.faults.alarms import ALARMS
from pnfarm.buses.profinet.faults.modules import MODULES
from pnfarm.buses.profinet.faults.own_alarm import NEVER_BY_ITSELF, OWN_ALARM_PARAMS, own_alarm
from pnfarm.faults.effects.connection import CONNECTION
from pnfarm.faults.effects.effect import POLL_NS, Effect
from pnfarm.faults.errors import InjectionError
from pnfarm.faults.kind import InjectionKind, ParamSpec
from pnfarm.vocabulary.quoting import shown

if TYPE_CHECKING:
    from pnfarm.protocols.profinet.cm.device.events import AlarmConfirmed

__all__ = ["KIND"]

#: More than ten thousand alarms a second test nothing more; in virtual time, time would stop.
SHORTEST_INTERVAL_NS = 100_000


class AlarmStorm(Effect):
    """As fast as they are acknowledged, or at a rate."""

    connection = CONNECTION
    alarms = ALARMS
    modules = MODULES
    _keys: frozenset[int] = frozenset()

    def prepare(self) -> None:
        self._alarm = own_alarm(self.values, self.modules)
        self._interval: int = self.values["interval"]
        self._unanswered: set[int] = set()
        if self._interval < SHORTEST_INTERVAL_NS:
            given = shown(self.spec.params["interval"])
            raise InjectionError([("params.interval", f"is {given}", "a duration from 100us")])

    def begin(self, now: int) -> None:
        self.alarms.listen(self._hear)
        self._next = now
        self.check(now)

    def _hear(self, event: AlarmConfirmed, now: int) -> None:
        del now
        if event.number in self._unanswered:
            self._unanswered.discard(event.number)
            self.tally.confirm()

    def check(self, now: int) -> None:
        self._due = None
        count = self.spec.count
        if count is not None and self.tally.seen.activations >= count:
            # its last alarms are answered like the others
            self.finished = not self._unanswered or not self._connected()
            self._due = None if self.finished else now + POLL_NS
            return
        if not self._connected() or (self.values["wait"] and self._unanswered):
            self._due = now + POLL_NS
            return
        if now >= self._next:
            numbers = self.alarms.send(self._alarm, now)
            if numbers is None:
                self._due = now + POLL_NS
                return
            self._unanswered.update(numbers)
            self.tally.note(now, happened=bool(numbers))
            self._next = now + self._interval
        self._due = self._next

    def _connected(self) -> bool:
        """The AlarmAcks of an ended connection never come."""
        connection = self.connection.now()
        keys = connection.keys if connection is not None and connection.established else frozenset()
        if keys != self._keys:
            self._keys = keys
            self._unanswered.clear()
        return bool(keys)

    def end(self, now: int) -> None:
        self.alarms.stop_listening(self._hear)
        self.alarms.correct(self._alarm, now)


KIND = InjectionKind(
    "alarm-storm",
    "alarms",
    "The drive sends one alarm after the other, as fast as the controller acknowledges them, or at a rate.  When this "
    "ends, a plug alarm corrects what they said about submodules.  " + NEVER_BY_ITSELF,
    "an alarm; one that finds the alarm queue full is a check without an activation",
    AlarmStorm,
    {
        **OWN_ALARM_PARAMS,
        "interval": ParamSpec("duration", "From one alarm to the next, at least; 100us is the shortest.", "1ms"),
        "wait": ParamSpec("yes or no", "For the controller's AlarmAck before the next alarm.", default=True),
    },
    takes=frozenset({"count", "for"}),
    place=10,
    wire="Alarm notifications one after the other, each after the acknowledgement of the one before.",
    reports="S7-1500: an alarm OB for each (OB82, OB83 by the type), and entries in the diagnosis buffer. CODESYS: an "
    "entry in the device's diagnosis for each (assumed).",
)
