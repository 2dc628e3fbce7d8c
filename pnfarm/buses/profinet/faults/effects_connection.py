"""Faults of the connection and of records."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pnfarm.faults.frames import POLL_NS, Chance, Effect, Tally, Window, seed_of
from pnfarm.faults.gate import DelayRule, is_rpc
from pnfarm.protocols.profinet.errors import ErrorCode, PnioStatus, RecordError, pnio_error
from pnfarm.station.splitmix import SplitMix64

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.faults.plan import FaultSpec
    from pnfarm.faults.target import Evidence, FaultTarget

__all__ = [
    "AbortEffect",
    "BusyEffect",
    "ExpireEffect",
    "ReadyEffect",
    "RecordDelayEffect",
    "RecordErrorEffect",
    "RefuseEffect",
    "RpcDelayEffect",
]


class AbortEffect(Effect):
    """ar-abort: each connection that comes to data exchange is broken off, by default one."""

    def __init__(self, spec: FaultSpec, target: FaultTarget) -> None:
        super().__init__(spec, target)
        self._chance = Chance(spec, target, spec.count if spec.count or spec.for_ns else 1)
        self._passed: frozenset[int] = frozenset()

    def begin(self, window: Window, now: int) -> None:
        del window
        self.check(now)

    def check(self, now: int) -> None:
        connection = self.target.connection()
        if self.finished or connection is None or not connection.established or connection.keys & self._passed:
            return
        self._passed = connection.keys
        happens = self._chance.falls()
        if happens:
            happens = self._break(now) > 0
        self._chance.tally.note(now, happened=happens, confirmed=happens)
        self.finished = self._chance.exhausted

    def _break(self, now: int) -> int:
        return self.target.abort(self.values["code"], now)

    def evidence(self) -> Evidence:
        return self._chance.tally.seen


class ExpireEffect(AbortEffect):
    """watchdog-expire: as ar-abort, the drive's own way."""

    def _break(self, now: int) -> int:
        return self.target.expire(now)


class RefuseEffect(Effect):
    """connect-refuse."""

    def __init__(self, spec: FaultSpec, target: FaultTarget) -> None:
        super().__init__(spec, target)
        self._chance = Chance(spec, target, spec.count)
        self._status = pnio_error(ErrorCode.CONNECT, self.values["code1"], self.values["code2"])

    def begin(self, window: Window, now: int) -> None:
        del window, now
        self.target.hook_connect(self._asked)

    def _asked(self, now: int) -> PnioStatus | None:
        if self.finished:
            return None
        happens = self._chance.falls()
        self._chance.tally.note(now, happened=happens, confirmed=happens)
        self.finished = self._chance.exhausted
        return self._status if happens else None

    def end(self, now: int) -> None:
        del now
        self.target.unhook_connect(self._asked)

    def evidence(self) -> Evidence:
        return self._chance.tally.seen


class ReadyEffect(Effect):
    """no-application-ready (``delay`` None) and late-application-ready."""

    def __init__(self, spec: FaultSpec, target: FaultTarget) -> None:
        super().__init__(spec, target)
        self._chance = Chance(spec, target, spec.count)
        self._delay: int | None = self.values["delay"]
        self._decided = False
        self._acts = False
        self._held: frozenset[int] = frozenset()

    def begin(self, window: Window, now: int) -> None:
        del window, now
        self.target.hold_ready(self)

    def decide(self) -> tuple[bool, int | None]:
        """For one connection that is being set up."""
        self._acts = not self.finished and self._chance.falls()
        self._decided = True
        return self._acts, self._delay

    def check(self, now: int) -> None:
        waiting = self.target.waiting_for_ready()
        if self._decided and waiting - self._held:
            self._decided = False
            self._chance.tally.note(now, happened=self._acts, confirmed=self._acts)
            if self._acts:
                self._held |= waiting
        # ending earlier would hand the ApplicationReady to the very connection that shall not get it
        self._held &= waiting
        self.finished = self._chance.exhausted and not self._held

    def end(self, now: int) -> None:
        self.target.unhold_ready(self, now)

    def evidence(self) -> Evidence:
        return self._chance.tally.seen


@dataclass(frozen=True, slots=True)
class _CountedError(RecordError):
    """A refusal that tells when it is given out."""

    given: Callable[[], None] = field(kw_only=True)

    def status(self, service: int) -> PnioStatus:
        self.given()
        # a dataclass with slots is made twice, so that a bare super() would look for the first
        return RecordError.status(self, service)


class RecordErrorEffect(Effect):
    """record-error."""

    def __init__(self, spec: FaultSpec, target: FaultTarget) -> None:
        super().__init__(spec, target)
        self._tally = Tally()
        self._given = 0
        self._in_force = False
        self._error = _CountedError(self.values["code"], self.values["code2"], given=self._refused)

    def begin(self, window: Window, now: int) -> None:
        del window, now
        self._in_force = True
        self.target.refuse_records(self._error)

    def _refused(self) -> None:
        self._given += 1
        if self.spec.count is not None and self._tally.seen.activations + self._given >= self.spec.count:
            self._allow()

    def _allow(self) -> None:
        if self._in_force:
            self._in_force = False
            self.target.allow_records(self._error)

    def check(self, now: int) -> None:
        for _ in range(self._given):
            self._tally.note(now, confirmed=True)
        self._given = 0
        self.finished = not self._in_force

    def end(self, now: int) -> None:
        self.check(now)
        self._allow()

    def evidence(self) -> Evidence:
        return self._tally.seen


class BusyEffect(Effect):
    """parameter-busy."""

    def __init__(self, spec: FaultSpec, target: FaultTarget) -> None:
        super().__init__(spec, target)
        self._chance = Chance(spec, target, spec.count)

    def begin(self, window: Window, now: int) -> None:
        del window, now
        self.target.hold_responses(self._asked)

    def _asked(self, now: int) -> bool:
        if self.finished:
            return False
        happens = self._chance.falls()
        self._chance.tally.note(now, happened=happens, confirmed=happens)
        self.finished = self._chance.exhausted
        return happens

    def end(self, now: int) -> None:
        del now
        self.target.let_responses(self._asked)

    def evidence(self) -> Evidence:
        return self._chance.tally.seen


class _LateEffect(Effect):
    """What the drive says leaves late: a fixed time, and up to ``jitter`` more."""

    def __init__(self, spec: FaultSpec, target: FaultTarget) -> None:
        super().__init__(spec, target)
        self._chance = Chance(spec, target, spec.count)
        self._delay: int = self.values["delay"]
        self._jitter: int = self.values["jitter"]
        # another sequence than that of the probability
        self._random = SplitMix64(seed_of(spec, target.name) + 1)
        self._held = 0
        self._due: int | None = None

    def asked(self, now: int) -> int:
        """A :class:`~pnfarm.faults.target.LateRule`."""
        if self._chance.exhausted:
            return 0
        wait = self._delay + int(self._random.uniform() * (self._jitter + 1))
        happens = self._chance.falls() and wait > 0
        self._chance.tally.note(now, happened=happens)
        self._held += happens
        return wait if happens else 0

    def left(self, *, sent: bool) -> None:
        self._held -= 1
        if sent:
            self._chance.tally.confirm()

    def check(self, now: int) -> None:
        # ending earlier would let the last one go in time
        self.finished = self._chance.exhausted and not self._held
        self._due = now + POLL_NS if self._chance.exhausted and self._held else None

    def evidence(self) -> Evidence:
        return self._chance.tally.seen

    def next_deadline(self) -> int | None:
        return self._due


class RpcDelayEffect(_LateEffect):
    """rpc-delay: the datagrams, so that the drive's stack seems slow."""

    def __init__(self, spec: FaultSpec, target: FaultTarget) -> None:
        super().__init__(spec, target)
        self._rule = DelayRule(is_rpc, self)

    def begin(self, window: Window, now: int) -> None:
        del window, now
        self.target.delay(self._rule)

    def end(self, now: int) -> None:
        del now
        self.target.undelay(self._rule)


class RecordDelayEffect(_LateEffect):
    """record-delay: the answers, so that the drive's application seems slow."""

    def begin(self, window: Window, now: int) -> None:
        del window, now
        self.target.delay_answers(self)

    def end(self, now: int) -> None:
        self.target.answer_in_time(self, now)
