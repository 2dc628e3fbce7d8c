"""Who is on a line: Slave_Diag to each address, or what is heard where a master is at work.

Telegrams in, telegrams out, no line and no clock.  It takes no part in the token: before its first request it listens,
and once it has heard a request or a token of another master it only listens, and sends nothing any more.  Slave_Diag
is read by any master and changes nothing (EN 50170 part 2, 8.3.1).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from pnfarm.errors import DecodeError
from pnfarm.protocols.profibus.wire.dp import Diagnosis
from pnfarm.protocols.profibus.wire.telegram import FCB, REQUEST, Request, Sap, Telegram, Token, emit_telegram
from pnfarm.protocols.profibus.wire.timing import SYN_BITS, answered_within_ns, bits_ns

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pnfarm.protocols.profibus.wire.telegram import Line

__all__ = ["LineSearch"]

#: Addresses that slaves have; 126 is a new one's.
ADDRESSES: Final = range(127)


class LineSearch:
    """``found``: address -> ident number, None where it was not seen; ``master``: one that is at work.

    ``expected`` are asked first, and twice.  ``latency_ns``: time beyond the bus's own that an answer may take;
    ``listen_ns``: before the first request; ``heard_ns``: how long it listens to a master's work.
    """

    def __init__(
        self,
        own: int,
        baud: int,
        expected: Iterable[int] = (),
        *,
        latency_ns: int = 50_000_000,
        listen_ns: int = 300_000_000,
        heard_ns: int = 5_000_000_000,
    ) -> None:
        self.found: dict[int, int | None] = {}
        self.master: int | None = None
        self._own, self._baud = own, baud
        self._latency_ns, self._listen_ns, self._heard_ns = latency_ns, listen_ns, heard_ns
        known = list(expected)
        self._waiting = [one for one in (*known, *known, *ADDRESSES) if one != own]
        self._asked: int | None = None
        self._asks = False
        self._due_ns: int | None = None

    def start(self, now: int) -> None:
        """Listen first."""
        self._due_ns = now + self._listen_ns

    @property
    def done(self) -> bool:
        return self._due_ns is None

    def next_deadline(self) -> int | None:
        """When :meth:`handle_timeout` is due."""
        return self._due_ns

    def handle_timeout(self, now: int) -> None:
        """An answer that did not come, or the line is free for the next request."""
        if self._due_ns is None or now < self._due_ns:
            return
        self._asked = None
        while self._waiting and self._waiting[0] in self.found:
            self._waiting.pop(0)
        if self.master is not None or not self._waiting:
            self._due_ns = None
        else:
            self._asks = True

    def to_send(self) -> bytes | None:
        """The request to send now, once."""
        if not self._asks or self.done:
            return None
        self._asks = False
        self._asked = self._waiting.pop(0)
        function = REQUEST | FCB | Request.SRD_HIGH
        return emit_telegram(Telegram(self._asked, self._own, function, Sap.SLAVE_DIAGNOSIS, Sap.MASTER))

    def sent(self, octets: int, now: int) -> None:
        """What :meth:`to_send` gave leaves now."""
        self._due_ns = now + answered_within_ns(octets, self._baud) + self._latency_ns

    def receive(self, telegram: Line, now: int) -> None:
        """A telegram of the line."""
        if self.done:
            return
        if isinstance(telegram, Token) or (isinstance(telegram, Telegram) and telegram.is_request):
            # an adapter may hear what this end says itself
            echo = isinstance(telegram, Telegram) and telegram.source == self._own and self._asked is not None
            if not echo and self.master is None:
                self.master, self._asked, self._asks = telegram.source, None, False
                self._due_ns = now + self._heard_ns
        elif isinstance(telegram, Telegram) and telegram.source in ADDRESSES:
            self._heard(telegram)
            if self._asked == telegram.source:
                self._asked, self._due_ns = None, now + bits_ns(SYN_BITS, self._baud)

    def _heard(self, telegram: Telegram) -> None:
        """An answer, to whomever."""
        self.found.setdefault(telegram.source, None)
        if telegram.ssap != Sap.SLAVE_DIAGNOSIS:
            return
        try:
            self.found[telegram.source] = Diagnosis.parse(telegram.data).ident
        except DecodeError:
            return  # it is there, whatever it says
