"""Limits the rate of log lines, whatever a peer does: repeated lines are counted and summed up.

A line's *kind* is its event, its drive and, of what a client changed, that client; or the place in the code that wrote
it.  Each kind has a token bucket that
refills slowly, so that a start-up or a trip is logged line by line while a flood is not; all kinds together share a
larger one.  Lines above the limit are held back; once a second the last line of each such kind is written with
``repeated``, the number of lines that it stands for.
"""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import structlog

if TYPE_CHECKING:
    import logging
    from collections.abc import Callable, Mapping, MutableMapping

__all__ = ["LineLimit"]

#: Burst and rate of the lines of one kind.
KIND_LINES, KIND_LINES_PER_SECOND = 12.0, 1.0
#: An empty bucket is full again; at this interval kinds to forget are searched.
FILL_SECONDS = KIND_LINES / KIND_LINES_PER_SECOND
#: The same for all kinds together: enough for the start of a thousand drives; a disk bears this rate for weeks.
ALL_LINES, ALL_LINES_PER_SECOND = 20_000.0, 100.0
#: Kinds that are limited separately; further ones share one.
MAX_KINDS = 4096
#: Kinds that get a summary line of their own each second; the others share one.
MAX_SUMS = 20
PERIOD_SECONDS = 1.0

_SUM = "_sum"
_OTHERS = ("", "", "")


class _Timer(Protocol):
    def __call__(self, seconds: float, action: Callable[[], None], /) -> None: ...


def _thread_timer(seconds: float, action: Callable[[], None]) -> None:
    """Runs ``action`` in a thread of its own, so that it needs no event loop and does not wait for a busy one."""
    timer = threading.Timer(seconds, action)
    timer.daemon = True
    timer.start()


class _Credit:
    """A token bucket of log lines."""

    __slots__ = ("_at", "_left", "_most", "_per_second")

    def __init__(self, most: float, per_second: float, now: float) -> None:
        self._left, self._most, self._per_second, self._at = most, most, per_second, now

    def take(self, now: float) -> bool:
        self._left = min(self._most, self._left + (now - self._at) * self._per_second)
        self._at = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True

    def is_full(self, now: float) -> bool:
        return self._left + (now - self._at) * self._per_second >= self._most


@dataclass(slots=True)
class _Kind:
    credit: _Credit
    held: int = 0
    level: str = "info"
    last: Mapping[str, Any] | None = None


class LineLimit:
    """A processor of structlog (:meth:`__call__`) and a filter of :mod:`setup`'s handlers (:meth:`filter`).

    ``clock`` gives seconds; ``timer`` calls :meth:`flush` later; both are replaced by tests.
    """

    def __init__(self, *, clock: Callable[[], float] = time.monotonic, timer: _Timer = _thread_timer) -> None:
        self._clock = clock
        self._timer = timer
        self._lock = threading.Lock()
        self._kinds: dict[tuple[str, str, str], _Kind] = {}
        self._all = _Credit(ALL_LINES, ALL_LINES_PER_SECOND, clock())
        self._forget_at = 0.0
        self._waiting = False

    def __call__(self, logger: Any, method: str, line: MutableMapping[str, Any]) -> MutableMapping[str, Any]:
        """Pass a line on; raises :class:`structlog.DropEvent` for one that is held back."""
        del logger
        if line.pop(_SUM, False):
            return line
        event, drive = str(line.get("event", "")), str(line.get("drive", ""))
        # what one client changes does not hide what another does
        client = f"{line['who']} {line.get('peer', '')}" if "who" in line else ""
        if not self._passes((event[:200], drive[:200], client[:200]), method, line):
            raise structlog.DropEvent
        return line

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether a library's line is written now."""
        line = {"event": str(record.msg)[:500], "logger": record.name}
        where = f"{record.pathname}:{record.lineno}"
        return self._passes((record.name, "", where), record.levelname.lower(), line)

    def _passes(self, key: tuple[str, str, str], level: str, line: Mapping[str, Any]) -> bool:
        now = self._clock()
        with self._lock:
            kind = self._kind(key, now)
            if kind.held == 0 and kind.credit.take(now) and self._all.take(now):
                return True
            # an entry of the event log may stand for several
            kind.held += int(line.get("repeated", 1))
            kind.level, kind.last = level, dict(line)
            start, self._waiting = not self._waiting, True
        if start:
            self._start()
        return False

    def _kind(self, key: tuple[str, str, str], now: float) -> _Kind:
        found = self._kinds.get(key)
        if found is not None:
            return found
        if now >= self._forget_at:
            # a kind with a full bucket and nothing held back says nothing that a new one would not
            self._forget_at = now + FILL_SECONDS
            self._kinds = {k: kind for k, kind in self._kinds.items() if kind.held or not kind.credit.is_full(now)}
        if len(self._kinds) >= MAX_KINDS:
            key = _OTHERS
        return self._kinds.setdefault(key, _Kind(_Credit(KIND_LINES, KIND_LINES_PER_SECOND, now)))

    def _start(self) -> None:
        try:
            self._timer(PERIOD_SECONDS, self.flush)
        except RuntimeError:
            # no thread could be started: the next line that is held back tries again
            with self._lock:
                self._waiting = False

    def flush(self) -> None:
        """Write the sums of what was held back."""
        with self._lock:
            self._waiting = False
            held = sorted((kind for kind in self._kinds.values() if kind.held), key=lambda kind: -kind.held)
            sums = [(kind.level, kind.held, kind.last) for kind in held[:MAX_SUMS]]
            rest = sum(kind.held for kind in held[MAX_SUMS:])
            for kind in held:
                kind.held, kind.last = 0, None
        for level, count, last in sums:
            line = {key: value for key, value in (last or {}).items() if key != "exc_info"}
            _write(level, str(line.pop("event", "")), {**line, "repeated": count})
        if rest:
            _write("info", "other log lines held back", {"repeated": rest, "kinds": len(held) - MAX_SUMS})


def _write(level: str, event: str, data: Mapping[str, Any]) -> None:
    logger = structlog.get_logger()
    writer = getattr(logger, level, logger.info)
    writer(event, **{**data, _SUM: True})
