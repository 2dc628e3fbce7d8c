"""A shard's lease: the right to speak with its drives' addresses, for a time that must be renewed.

A sans-I/O machine: ``now`` is the holder's own monotonic clock, ns; who owns it sends what :meth:`Lease.asks` says and
hands back the answers.  The database keeps one claim for each drive and judges by its own clock when one has expired.
The two clocks are never compared:

* a claim that is granted or renewed ends ``ttl`` after the database handled the request, by the database's clock;
* the holder counts from **before it sent** that request, by its own clock, and speaks for ``ttl - margin`` at most.

So it is mute before anyone else may begin, as long as the two clocks' rates differ by less than the margin within a
time to live, however late requests and answers are.  An answer that comes too late to leave any time is as none.

=========  =================  =========  =============================================================
state      event              state
=========  =================  =========  =============================================================
WAITING    GRANTED            HELD       all claims were free
WAITING    REFUSED            WAITING    others hold some of them
HELD       GRANTED            HELD       renewed
HELD       EXPIRED            LOST       no renewal was confirmed in time: mute
HELD       REFUSED            WAITING    another has taken over: mute
LOST       GRANTED            HELD       the database answers again
LOST       REFUSED            WAITING    another has taken over meanwhile
=========  =================  =========  =============================================================
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

__all__ = [
    "DEFAULT_TTL_NS",
    "LONGEST_TTL_NS",
    "SHORTEST_TTL_NS",
    "Lease",
    "LeaseChanged",
    "LeaseState",
    "margin_ns",
    "renewal_ns",
]

#: The kernel counts the life of its addresses in whole seconds, which a shorter one does not leave.
SHORTEST_TTL_NS, DEFAULT_TTL_NS, LONGEST_TTL_NS = 3_000_000_000, 5_000_000_000, 60_000_000_000
_LONGEST_RENEWAL_NS = 1_000_000_000


class LeaseState(StrEnum):
    """See the module's docstring."""

    WAITING = "waiting"
    HELD = "held"
    LOST = "lost"


class LeaseEvent(StrEnum):
    """What happens to a lease."""

    GRANTED = "granted"
    REFUSED = "refused"
    EXPIRED = "expired"


_STATES = {
    (LeaseState.WAITING, LeaseEvent.GRANTED): LeaseState.HELD,
    (LeaseState.WAITING, LeaseEvent.REFUSED): LeaseState.WAITING,
    (LeaseState.HELD, LeaseEvent.GRANTED): LeaseState.HELD,
    (LeaseState.HELD, LeaseEvent.EXPIRED): LeaseState.LOST,
    (LeaseState.HELD, LeaseEvent.REFUSED): LeaseState.WAITING,
    (LeaseState.LOST, LeaseEvent.GRANTED): LeaseState.HELD,
    (LeaseState.LOST, LeaseEvent.REFUSED): LeaseState.WAITING,
}


@dataclass(frozen=True, slots=True)
class LeaseChanged:
    """The state is another one.  ``anew``: HELD, and others may have run the drives since it was held last."""

    state: LeaseState
    anew: bool = False


def margin_ns(ttl_ns: int) -> int:
    """A fifth of the time to live: what may pass from the last reading of the clock to the wire, and clocks' drift."""
    return ttl_ns // 5


def renewal_ns(ttl_ns: int) -> int:
    """Between two renewals: a second, or a fifth of the time to live if that is less."""
    return min(_LONGEST_RENEWAL_NS, ttl_ns // 5)


class Lease:
    """See the module's docstring.  Begins in WAITING."""

    def __init__(self, ttl_ns: int) -> None:
        self.ttl_ns = ttl_ns
        self.state = LeaseState.WAITING
        #: Until when it may speak; 0: it may not.
        self.until_ns = 0
        #: When the newest request that was granted was sent, None for none.
        self.renewed_ns: int | None = None
        #: Which period of holding it is, by the database: others had the claims between two of them.
        self._period: str | None = None
        self._due_ns: int | None = None
        self._changes: list[LeaseChanged] = []

    def may_speak(self, now: int) -> bool:
        """Whether the drives may send at this moment."""
        return now < self.until_ns

    def next_request(self, now: int) -> int:
        return now if self._due_ns is None else self._due_ns

    def asked(self, now: int) -> int:
        """A request is about to be sent: what to hand back with its answer."""
        self._due_ns = now + renewal_ns(self.ttl_ns)
        return now

    def is_new(self, period: str) -> bool:
        """Whether others may have had the claims before this period."""
        return period != self._period

    def granted(self, sent_ns: int, period: str, now: int) -> None:
        """The database granted or renewed the claims for the request of ``sent_ns``."""
        until = sent_ns + self.ttl_ns - margin_ns(self.ttl_ns)
        if now >= until:
            # the claims are its own, and the next request may tell so in time
            self.handle_timeout(now)
            return
        anew, self._period = self.is_new(period), period
        self.until_ns = max(self.until_ns, until)
        self.renewed_ns = sent_ns
        self._move(LeaseEvent.GRANTED, anew=anew)

    def refused(self, now: int) -> None:
        """Others hold some of the claims."""
        del now
        self.until_ns = 0
        self._move(LeaseEvent.REFUSED)

    def handle_timeout(self, now: int) -> None:
        """Notice the end of the time to speak; :meth:`may_speak` needs no notice."""
        if self.state is LeaseState.HELD and now >= self.until_ns:
            self.until_ns = 0
            self._move(LeaseEvent.EXPIRED)

    def changes(self) -> list[LeaseChanged]:
        """What changed since the last call."""
        drained, self._changes = self._changes, []
        return drained

    def _move(self, event: LeaseEvent, *, anew: bool = False) -> None:
        before, self.state = self.state, _STATES[self.state, event]
        if self.state is not before or anew:
            self._changes.append(LeaseChanged(self.state, anew))
