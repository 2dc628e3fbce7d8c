"""The drives' non-volatile memory in PostgreSQL, and the lease of the shard that runs them.

A thread of its own owns the connection.  Every value is read once, when the claims are held (without a lease: at the
start), and held from then on: what a drive reads never waits.  A save is handed to the thread and waited for
:data:`SAVE_SECONDS` at most; with no answer by then the database counts as away, and saves are refused at once until it
has answered again.  Whatever became of a save without an answer, what is held is written before the next one.

The event loop calls :meth:`PostgresState.check` when something is new, and at times by itself.
"""

from __future__ import annotations

import contextlib
import os
import socket
import threading
import time
import uuid
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.config.database import redacted
from pnfarm.errors import EnvironmentError_
from pnfarm.farm.lease import Lease, LeaseState
from pnfarm.farm.memory.postgres_tables import Owner, Tables
from pnfarm.farm.memory.rows import rows_of, values_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from pnfarm.farm.lease import LeaseChanged
    from pnfarm.farm.memory.postgres_tables import Holder

__all__ = ["PostgresState", "answer_seconds", "lease_clock", "require_driver"]

#: How long a save may take.
SAVE_SECONDS = 0.25
#: How long the database may take to answer at the start.
START_SECONDS = 10.0
#: A statement or a connection without an answer is given up after so long.
STUCK_SECONDS = 4.0
#: Between two checks of whether the database is there, without a lease.
ALIVE_SECONDS = 1.0
#: Times the lease's time to live: a farm whose event loop stalls for longer does not renew its claims.
ABSENT_FACTOR = 2
#: Before another try to connect, the first and the longest.
AGAIN_SECONDS, AGAIN_MOST_SECONDS = 0.25, 2.0


def lease_clock() -> int:
    """Of the holder: monotonic, and goes on while the machine sleeps, ns."""
    return time.clock_gettime_ns(time.CLOCK_BOOTTIME)


def require_driver() -> Any:
    """psycopg.  Raises :class:`EnvironmentError_` where it is not installed."""
    try:
        import psycopg  # noqa: PLC0415 - an extra
    except ImportError as exc:
        raise EnvironmentError_(
            f"a `state` in PostgreSQL needs psycopg: install it with `pip install 'pnfarm[postgres]'` ({exc})"
        ) from exc
    return psycopg


@dataclass(slots=True, eq=False)
class _Save:
    station: str
    rows: list[tuple[str, str]]
    done: bool = False
    #: Why it did not happen.
    refused: str = ""


@dataclass(slots=True)
class Standing:
    """How the database and the lease are, for the event log, the metrics and ``inspect``."""

    up: bool = False
    reason: str = ""
    losses: int = 0
    refused: int = 0
    waiting_for: Holder | None = None
    #: Answers that said so.
    waiting: int = 0


class PostgresState:
    """A :class:`pnfarm.drives.parameters.memory.NonVolatile`; see the module's docstring.

    ``lease``: also claims the drives, under the name ``shard``; ``until`` then hears until when they may speak (the
    time of :func:`lease_clock`; 1: they may not), in the thread.  ``news`` is called in the thread when
    :meth:`check` has something to tell.
    """

    def __init__(
        self,
        url: str,
        farm: str,
        stations: Sequence[str],
        *,
        lease: Lease | None = None,
        shard: str = "",
        news: Callable[[], None] = lambda: None,
        until: Callable[[int], None] = lambda _: None,
        clock: Callable[[], int] = lease_clock,
    ) -> None:
        self._driver = require_driver()
        self.where = redacted(url)
        self._url, self._farm, self._stations = url, farm, list(stations)
        self.lease = lease
        self.news, self.until = news, until
        self._clock = clock
        ttl = 0.0 if lease is None else lease.ttl_ns / 1e9
        self._owner = None if lease is None else Owner(uuid.uuid4().hex, socket.gethostname(), shard, ttl)
        #: Guards everything that both sides use.
        self.changed = threading.Condition()
        self.standing = Standing(reason="it was not asked yet")
        self._held: dict[str, list[tuple[str, str]]] = {}
        self._is_read = False
        #: Stations of which the database may have other rows than are held.
        self._unsure: dict[str, None] = {}
        self._saves: deque[_Save] = deque()
        #: When the event loop was last seen to run, by the clock; None: it is not watched.
        self._attended_ns: int | None = None
        self._closing = False
        self._fatal: EnvironmentError_ | None = None
        self._thread: threading.Thread | None = None

    # -- life, in the event loop or a thread of the caller's

    def start(self) -> None:
        """Begin; returns once the database has answered.  Raises :class:`EnvironmentError_`.  Blocks."""
        self.conninfo()
        self._thread = threading.Thread(target=self._run, name="pnfarm-memory", daemon=True)
        self._thread.start()
        with self.changed:
            ready = lambda: self.standing.up or self._fatal is not None or self.standing.waiting  # noqa: E731
            self.changed.wait_for(ready, START_SECONDS)
            fatal, standing = self._fatal, self.standing
        if fatal is not None or not (standing.up or standing.waiting):
            self.close()
            raise fatal or EnvironmentError_(
                f"the drives' memory {self.where} did not answer within {START_SECONDS:.0f} s: {standing.reason}"
            )

    def close(self) -> None:
        """Give the claims back and end the connection; waits a moment for it."""
        with self.changed:
            self._closing = True
            self.changed.notify_all()
        if self._thread is not None:
            self._thread.join(STUCK_SECONDS + 1)
            self._thread = None

    def check(self) -> list[LeaseChanged]:
        """What became of the lease since the last call; notices its end."""
        if self.lease is None:
            return []
        with self.changed:
            self.lease.handle_timeout(self._clock())
            return self.lease.changes()

    def attended(self, *, watched: bool = True) -> None:
        """The event loop runs; claims are renewed only while it does.  Not ``watched``: they are in any case."""
        self._attended_ns = self._clock() if watched else None

    @property
    def lease_state(self) -> str:
        """``none`` without a lease."""
        return "none" if self.lease is None else str(self.lease.state)

    def may_speak(self) -> bool:
        """Whether the drives may send now."""
        return self.lease is None or self.lease.may_speak(self._clock())

    def speaking_seconds(self) -> float:
        """How long the drives may still speak by their lease."""
        return 0.0 if self.lease is None else max(0.0, (self.lease.until_ns - self._clock()) / 1e9)

    def renewed_seconds_ago(self) -> float | None:
        """Since the newest renewal was asked for that was granted, None without one."""
        if self.lease is None or self.lease.renewed_ns is None:
            return None
        return (self._clock() - self.lease.renewed_ns) / 1e9

    # -- the memory, in the event loop

    @property
    def ready(self) -> bool:
        return self.standing.up

    def load(self, station: str) -> dict[str, Any] | None:
        """What is held for this station."""
        with self.changed:
            rows = self._held.get(station)
        return None if rows is None else values_of(rows, station, self.damaged)

    def save(self, station: str, values: dict[str, Any]) -> None:
        """See :meth:`pnfarm.drives.parameters.memory.NonVolatile.save`; waits for :data:`SAVE_SECONDS` at most."""
        save = _Save(station, rows_of(values))
        with self.changed:
            if not self.standing.up:
                self.standing.refused += 1
                raise self._away()
            self._saves.append(save)
            self.changed.notify_all()
            self.changed.wait_for(lambda: save.done or bool(save.refused) or not self.standing.up, SAVE_SECONDS)
            if save.done:
                self._held[station] = save.rows
                return
            self.standing.refused += 1
            with contextlib.suppress(ValueError):
                self._saves.remove(save)
            if not save.refused and self.standing.up:
                self._lost(f"it did not answer within {SAVE_SECONDS:g} s")
            raise EnvironmentError_(save.refused) if save.refused else self._away()

    def hold(self, station: str, values: dict[str, Any]) -> None:
        rows = rows_of(values)
        with self.changed:
            self._held[station] = rows
            self._unsure[station] = None
            self.changed.notify_all()

    def damaged(self, detail: str) -> EnvironmentError_:
        return EnvironmentError_(
            f"the drives' memory {self.where} is damaged: {detail}; it was left as it is - restore a copy, or delete "
            f"the rows of farm {self._farm} and the drives start as from the factory"
        )

    def _away(self) -> EnvironmentError_:
        return EnvironmentError_(f"the drives' memory {self.where} is away: {self.standing.reason}")

    # -- the thread

    def conninfo(self) -> str:
        """What libpq is given.  Raises :class:`EnvironmentError_` for a URL that it does not take."""
        given: dict[str, Any]
        try:
            given = self._driver.conninfo.conninfo_to_dict(self._url)
        except self._driver.Error:
            # libpq's own sentence may quote a password
            raise EnvironmentError_(
                f"{self.where} is not the URL of a database: postgresql://USER@HOST:PORT/DATABASE"
            ) from None
        usual = {
            "connect_timeout": 3,
            "keepalives_idle": 2,
            "tcp_user_timeout": int(STUCK_SECONDS * 1000),
            "application_name": f"pnfarm {self._farm}",
        }
        # whatever the database has: without an encoding the driver gives octets for text
        return str(self._driver.conninfo.make_conninfo(**(usual | given), client_encoding="UTF8"))

    def _run(self) -> None:
        again = AGAIN_SECONDS
        while not self._closing:
            try:
                connection = self._driver.connect(self.conninfo(), autocommit=True)
                with contextlib.closing(connection):
                    tables = Tables(connection, self._farm, self._stations)
                    with self._bounded(connection):
                        connection.execute(f"SET statement_timeout = {int(STUCK_SECONDS * 900)}")
                        tables.prepare(self.where)
                    again = AGAIN_SECONDS
                    self._serve(connection, tables)
            except EnvironmentError_ as exc:
                self._failed(exc)
            except (self._driver.Error, OSError, RuntimeError) as exc:
                # RuntimeError: the machine has no thread left
                self._broke(exc)
            with self.changed:
                self.changed.wait_for(lambda: self._closing, again)
            again = min(AGAIN_MOST_SECONDS, again * 2)

    def _failed(self, error: EnvironmentError_) -> None:
        """What no other try mends; the start fails with it, or it is reported as a loss."""
        with self.changed:
            self._fatal = error
            self._lost(str(error))

    def _broke(self, error: Exception) -> None:
        text = self.told(error)
        refused = isinstance(error, self._driver.errors.InsufficientPrivilege)
        if refused:
            text += "; let its user own a schema: `CREATE SCHEMA pnfarm AUTHORIZATION USER`"
        with self.changed:
            if refused and not self._is_read:
                self._fatal = EnvironmentError_(f"the drives' memory {self.where} cannot be used: {text}")
            self._lost(text)

    def told(self, error: Exception) -> str:
        """An error of the driver's in one line, without the password."""
        text = " ".join(str(error).split()) or type(error).__name__
        password = self._driver.conninfo.conninfo_to_dict(self._url).get("password")
        return text.replace(str(password), "***") if password else text

    def _lost(self, reason: str) -> None:
        """Under the lock."""
        was, self.standing.up, self.standing.reason = self.standing.up, False, reason
        self.standing.losses += was
        self.changed.notify_all()
        if was:
            self.news()

    @contextlib.contextmanager
    def _bounded(self, connection: Any) -> Iterator[None]:
        """Cut the connection if what is inside takes too long: then it raises an error of the driver's."""
        with socket.socket(fileno=os.dup(connection.fileno())) as wire:
            timer = threading.Timer(STUCK_SECONDS, _cut, (wire,))
            timer.start()
            try:
                yield
            finally:
                timer.cancel()
                timer.join()

    def _serve(self, connection: Any, tables: Tables) -> None:
        """Until closed, or an error of the driver's."""
        alive = 0.0
        while True:
            with self.changed:
                if self._closing:
                    break
            with self._bounded(connection):
                if self.lease is not None:
                    self._renew(tables)
                elif time.monotonic() >= alive:
                    tables.alive()
                    alive = time.monotonic() + ALIVE_SECONDS
                if self.lease is None or self.lease.state is LeaseState.HELD:
                    self._settle(tables)
                    self._write_next(tables)
            with self.changed:
                self.changed.wait_for(
                    lambda: self._closing or (self.standing.up and (self._saves or self._unsure)), self._pause(alive)
                )
        if self._owner is not None:
            with self._bounded(connection):
                tables.release(self._owner)

    def _pause(self, alive: float) -> float:
        """Under the lock: until something is due, s."""
        if self.lease is None:
            return max(0.0, alive - time.monotonic())
        now = self._clock()
        return max(0.0, (self.lease.next_request(now) - now) / 1e9)

    def _renew(self, tables: Tables) -> None:
        lease, owner = self.lease, self._owner
        if lease is None or owner is None:
            return
        with self.changed:
            now = self._clock()
            if lease.next_request(now) > now:
                return
            attended = self._attended_ns
            if attended is not None and now - attended > ABSENT_FACTOR * lease.ttl_ns:
                # its drives answer no request: let another run them, which can
                lease.asked(now)
                lease.handle_timeout(now)
                return
            sent = lease.asked(now)
        answer = tables.claim(owner)
        if isinstance(answer, str) and lease.is_new(answer):
            # others may have written, and what they wrote is newer
            rows = tables.read()
            with self.changed:
                self._held, self._is_read = rows, True
                self._unsure.clear()
        with self.changed:
            lease.handle_timeout(self._clock())
            if isinstance(answer, str):
                self.standing.waiting_for = None
                lease.granted(sent, answer, self._clock())
            else:
                lease.refused(self._clock())
                self.standing.waiting_for = answer
                self.standing.waiting += 1
                self._lost(f"another shard has the drives: {answer.shard or 'the whole farm'} on {answer.host}")
            self.until(lease.until_ns or 1)
            self.changed.notify_all()
        self.news()

    def _settle(self, tables: Tables) -> None:
        """Read what is not held, and write what the database may not have; then it counts as there."""
        if not self._is_read:
            rows = tables.read()
            with self.changed:
                self._held = rows
                self._is_read = True
        while True:
            with self.changed:
                station = next(iter(self._unsure), None)
                if station is None:
                    was, self.standing.up = self.standing.up, True
                    self.changed.notify_all()
                    break
                del self._unsure[station]
                rows_held = self._held.get(station, [])
            try:
                if not tables.write(station, rows_held, self._owner):
                    raise self._driver.OperationalError("another shard has the drive's claim")
            except BaseException:
                with self.changed:
                    self._unsure.setdefault(station, None)
                raise
        if not was:
            self.news()

    def _write_next(self, tables: Tables) -> None:
        while True:
            with self.changed:
                if not self._saves:
                    return
                save = self._saves.popleft()
            written = tables.write(save.station, save.rows, self._owner)
            with self.changed:
                if written:
                    save.done = True
                else:
                    save.refused = f"the drives' memory {self.where} is another shard's now"
                self.changed.notify_all()


def _cut(wire: socket.socket) -> None:
    with contextlib.suppress(OSError):
        wire.shutdown(socket.SHUT_RDWR)


def answer_seconds(url: str, farm: str) -> float:
    """How long a connection to the database takes, with an answer.  Raises :class:`EnvironmentError_`."""
    state = PostgresState(url, farm, [])
    conninfo, began = state.conninfo(), time.monotonic()
    driver = require_driver()
    try:
        with driver.connect(conninfo) as connection:
            connection.execute("SELECT 1")
    except (driver.Error, OSError) as exc:
        raise EnvironmentError_(f"{state.where} does not answer: {state.told(exc)}") from None
    return time.monotonic() - began
