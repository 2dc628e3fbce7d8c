"""A master of class 2 that is alone on a line and asks one slave for records; it polls no slave.

Telegrams in, telegrams out, no line and no clock.  It takes no part in the token: before its first request it listens,
and a request or a token of another master, then or later, ends its work.  EN 50170 part 2, 4.7; guideline 2.082.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.protocols.profibus.master_access import Connection
from pnfarm.protocols.profibus.wire.telegram import (
    FCB,
    FCV,
    REQUEST,
    Request,
    ShortAck,
    Telegram,
    Token,
    emit_telegram,
)
from pnfarm.protocols.profibus.wire.timing import SYN_BITS, answered_within_ns, bits_ns

if TYPE_CHECKING:
    from pnfarm.protocols.profibus.record_request import RecordRequest
    from pnfarm.protocols.profibus.wire.telegram import Line

__all__ = ["RecordsMaster", "RecordsSettings"]


@dataclass(frozen=True, slots=True)
class RecordsSettings:
    """``latency_ns``: time beyond the bus's own that an answer may take; ``listen_ns``: before the first request.

    ``pause_ns``: between two polls for the same answer.
    """

    slave: int
    address: int = 0
    baud: int = 1_500_000
    latency_ns: int = 100_000_000
    retries: int = 2
    listen_ns: int = 300_000_000
    pause_ns: int = 1_000_000
    request_timeout_ns: int = 5_000_000_000


@dataclass(slots=True)
class _Pending:
    octets: bytes
    left: int
    due_ns: int


class RecordsMaster:
    """See the module's docstring; driven as :class:`~pnfarm.protocols.profibus.master.Master` is.

    ``failure`` says why nothing more is asked.
    """

    def __init__(self, settings: RecordsSettings) -> None:
        self.settings = settings
        self.connection = Connection("class-2", settings.request_timeout_ns)
        self.failure = ""
        self.counts: Counter[str] = Counter()
        self._free_ns: int | None = None
        self._pending: _Pending | None = None
        self._ready: _Pending | None = None
        self._fcb = FCB
        self._valid_fcb = False
        self._ending = False

    def start(self, now: int) -> None:
        """Listen first."""
        self._free_ns = now + self.settings.listen_ns

    def ask(self, request: RecordRequest, now: int) -> None:
        """Ask for a record; the request says when it is done."""
        if self.failure:
            request.fail(self.failure)
            return
        self.connection.ask(request, now)

    def end(self) -> None:
        """Abort the connection, if there is one; :attr:`over` holds afterwards."""
        self._ending = True

    @property
    def over(self) -> bool:
        """Whether nothing is to be sent, or waited for, any more."""
        return bool(self.failure) or (self._ending and not self.connection.is_connected and self._pending is None)

    # -- time and the line -------------------------------------------------------------------------------------------

    def next_deadline(self) -> int | None:
        """When :meth:`handle_timeout` is due."""
        if self.failure or self._ready is not None:
            return None
        if self._pending is not None:
            return self._pending.due_ns
        if self._ending:
            return self._free_ns if self.connection.is_connected else None
        return self._free_ns if self.connection.busy else None

    def handle_timeout(self, now: int) -> None:
        if self.failure or self._free_ns is None:
            return
        pending = self._pending
        if pending is not None:
            if now < pending.due_ns:
                return
            self._missed(pending)
        if self.failure or self._pending is not None or self._ready is not None or now < self._free_ns:
            return
        chosen = self.connection.end() if self._ending else self.connection.request(now)
        if chosen is None:
            return
        dsap, ssap, data = chosen
        telegram = Telegram(self.settings.slave, self.settings.address, self._function(), dsap, ssap, data)
        self._ready = _Pending(emit_telegram(telegram), self.settings.retries, 0)

    def _function(self) -> int:
        """SRD with the next FCB; the first request has none that counts."""
        if self._valid_fcb:
            self._fcb ^= FCB
            return REQUEST | self._fcb | FCV | Request.SRD_LOW
        self._fcb, self._valid_fcb = FCB, True
        return REQUEST | FCB | Request.SRD_LOW

    def to_send(self) -> bytes | None:
        ready, self._ready = self._ready, None
        if ready is None:
            return None
        self._pending = ready
        return ready.octets

    def sent(self, now: int) -> None:
        pending, settings = self._pending, self.settings
        if pending is not None:
            self.counts["requests"] += 1
            pending.due_ns = now + answered_within_ns(len(pending.octets), settings.baud) + settings.latency_ns

    def receive(self, telegram: Line, now: int) -> None:
        """A telegram of the line."""
        settings = self.settings
        if isinstance(telegram, Token) or (isinstance(telegram, Telegram) and telegram.is_request):
            # an adapter may hear what this master says itself
            mine = telegram.source == settings.address and isinstance(telegram, Telegram) and self._pending is not None
            if not mine:
                self._fail(f"master {telegram.source} is active on this line")
            return
        if self._pending is None:
            self.counts["unasked"] += 1
            return
        if isinstance(telegram, Telegram) and (telegram.destination, telegram.source) != (
            settings.address,
            settings.slave,
        ):
            self.counts["others"] += 1
            return
        self._pending = None
        self.counts["answers"] += 1
        self._free_ns = now + bits_ns(SYN_BITS, settings.baud)
        if isinstance(telegram, ShortAck):
            # a slave that has nothing to report yet is not asked again at once
            self._free_ns = max(self._free_ns, now + settings.pause_ns)
        if not self._ending:
            self.connection.answered(telegram)
        self.handle_timeout(now)

    def _missed(self, pending: _Pending) -> None:
        self._pending = None
        if self._ending:
            return
        if pending.left <= 0:
            self._fail(f"station {self.settings.slave} does not answer")
            return
        pending.left -= 1
        self.counts["retries"] += 1
        self._ready = pending

    def _fail(self, why: str) -> None:
        self.failure = why
        self._pending = self._ready = None
        self.connection.lost(why)
