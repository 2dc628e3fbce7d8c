"""Limits of connections to the API: their number, the time for each phase, and the memory of each.

The API lives in the farm's own process and event loop, so a client could use up the drives' files, memory
and time.  Therefore

* there are at most as many connections as the limit says, and fewer where the process has few files left
  (:func:`connection_limit`): some are reserved for the farm itself;
* a connection beyond the limit replaces the one that has been idle longest; if none is idle, the new one is closed;
* the head of a request must arrive in time, then its body, and a client must read the response.

State of a connection   waits for                      at most
----------------------  -----------------------------  -----------------
(its door, with TLS)    the end of the handshake       HANDSHAKE_SECONDS
IDLE                    the head of a request          HEAD_SECONDS
BODY                    the rest of its body           BODY_SECONDS
ANSWER                  the application                -
(any, write side)       the client to read             STALL_SECONDS
"""

from __future__ import annotations

import errno
import resource
import socket
import time
from enum import Enum
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import h11
import structlog
from uvicorn.protocols.http.h11_impl import H11Protocol

from pnfarm.farm.process.open_files import open_files

if TYPE_CHECKING:
    import asyncio

__all__ = ["BACKLOG", "Connections", "LimitedProtocol", "ListeningSocket", "connection_limit", "protocol_of"]

#: Upper limit; a farm needs some for pages, scrapes and scripts.
MOST = 256
#: Below this number of connections the API does not listen.
LEAST = 4
#: Files reserved for the farm: sockets for changing interfaces, threads, captures that start a new file.
RESERVED_FILES = 64
#: Backlog of the socket: connections that one turn of the event loop accepts before it serves any.
BACKLOG = 32

#: Rest of the listening socket after there was no file for a connection; shorter than asyncio's own of one second.
REST_SECONDS = 0.5

HEAD_SECONDS = 10.0
BODY_SECONDS = 20.0
STALL_SECONDS = 20.0
#: Send buffer of a connection in the kernel, octets.
SEND_BUFFER = 262_144

logger = structlog.get_logger("pnfarm.api")


class ListeningSocket(socket.socket):
    """Accepts nothing for a while after the process had no file left for a connection.

    Asyncio tries again at once, as often as the backlog says, plans as many further attempts, and logs each.
    """

    _rests_until = 0.0

    def accept(self) -> tuple[socket.socket, Any]:
        """As of the socket; raises :class:`BlockingIOError` while it rests: nobody waits, for the event loop."""
        if time.monotonic() < self._rests_until:
            raise BlockingIOError
        try:
            return super().accept()
        except OSError as exc:
            if exc.errno in {errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM}:
                self._rests_until = time.monotonic() + REST_SECONDS
            raise


def connection_limit() -> int:
    """The most connections that the API may have at once, given the files that this process may open."""
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft == resource.RLIM_INFINITY:
        return MOST
    used = open_files()
    left = soft - used - RESERVED_FILES - BACKLOG
    if left < LEAST:
        logger.warning(
            "few files", limit=soft, used=used, connections=LEAST, advice="give more with `ulimit -n` or LimitNOFILE="
        )
    return max(LEAST, min(MOST, left))


class _Phase(Enum):
    IDLE = "idle"
    BODY = "body"
    ANSWER = "answer"


_SECONDS = {_Phase.IDLE: HEAD_SECONDS, _Phase.BODY: BODY_SECONDS, _Phase.ANSWER: None}


class Connection(Protocol):
    """One connection, whatever it is doing."""

    transport: asyncio.Transport

    @property
    def client(self) -> tuple[str, int] | None: ...


class Connections:
    """Every open connection of one server.  ``closed`` counts those that were closed, by reason."""

    def __init__(self, limit: int) -> None:
        self.limit = limit
        self.closed: dict[str, int] = {}
        self._open: set[Connection] = set()
        # in order of waiting: a dict keeps it
        self._idle: dict[Connection, None] = {}

    def __len__(self) -> int:
        return len(self._open)

    def opened(self, connection: Connection) -> None:
        """Add a connection; if the limit is reached, it replaces the one that has waited longest."""
        self._open.add(connection)
        if len(self._open) > self.limit:
            self.close(next(iter(self._idle), connection), "too many connections")

    def idle(self, connection: Connection, *, idle: bool) -> None:
        """Note whether a connection waits for a request."""
        self._idle.pop(connection, None)
        if idle and connection in self._open:
            self._idle[connection] = None

    def gone(self, connection: Connection) -> None:
        self._open.discard(connection)
        self._idle.pop(connection, None)

    def close(self, connection: Connection, reason: str) -> None:
        """Close it at once; unsent data is lost."""
        self.gone(connection)
        self.count(connection, reason)
        connection.transport.abort()

    def stop(self) -> None:
        """End those that wait for a client, as the server stops."""
        for connection in list(self._idle):
            # one that closes may still have to send the end of its answer
            if not connection.transport.is_closing():
                self.gone(connection)
                connection.transport.abort()

    def count(self, connection: Connection, reason: str) -> None:
        """It is closed, for this reason."""
        self.closed[reason] = self.closed.get(reason, 0) + 1
        logger.info("connection closed", reason=reason, client=connection.client[0] if connection.client else "")


class LimitedProtocol(H11Protocol):
    """One connection, with the states above.  :func:`protocol_of` makes a subclass for one server."""

    registry: ClassVar[Connections]

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._phase: _Phase | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._stall: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]  # as uvicorn's own
        super().connection_made(transport)
        peer: socket.socket | None = transport.get_extra_info("socket")
        if peer is not None:
            peer.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        self.registry.opened(self)
        self._look()

    def connection_lost(self, exc: Exception | None) -> None:
        self.registry.gone(self)
        for timer in (self._timer, self._stall):
            if timer is not None:
                timer.cancel()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        self._look()

    def send_400_response(self, msg: str) -> None:
        """The client broke HTTP, perhaps within a request: what answers this one ends, and the connection with it."""
        if self.cycle is not None and not self.cycle.response_complete:
            self.cycle.disconnected = True
            self.cycle.message_event.set()
        if self.conn.our_state in {h11.IDLE, h11.SEND_RESPONSE}:
            super().send_400_response(msg)
        else:
            # its request is answered, at least in part
            self.transport.close()

    def on_response_complete(self) -> None:
        super().on_response_complete()
        # the next request gets its own time, even if its head has already arrived
        self._phase = None
        self._look()

    def _look(self) -> None:
        """Enter the connection's present phase and start its timer, which received octets do not restart."""
        if self.transport.is_closing():
            if self.transport.get_write_buffer_size() == 0:
                # nothing is left to do for it: with TLS its client may still keep it open
                self.registry.idle(self, idle=True)
            return
        if self.cycle is None or self.cycle.response_complete:
            phase = _Phase.IDLE
        else:
            phase = _Phase.BODY if self.cycle.more_body else _Phase.ANSWER
        if phase is self._phase:
            return
        self._phase = phase
        self.registry.idle(self, idle=phase is _Phase.IDLE)
        if self._timer is not None:
            self._timer.cancel()
        seconds = _SECONDS[phase]
        self._timer = self.loop.call_later(seconds, self._late, phase) if seconds is not None else None

    def _late(self, phase: _Phase) -> None:
        self.registry.close(self, "no request in time" if phase is _Phase.IDLE else "no body in time")

    def pause_writing(self) -> None:
        super().pause_writing()
        if self._stall is None:
            self._stall = self.loop.call_later(STALL_SECONDS, self._stalled)

    def resume_writing(self) -> None:
        super().resume_writing()
        if self._stall is not None:
            self._stall.cancel()
            self._stall = None

    def _stalled(self) -> None:
        self.registry.close(self, "the client does not read")


def protocol_of(connections: Connections) -> type[LimitedProtocol]:
    """The class of one server's connections."""
    return type("ServedProtocol", (LimitedProtocol,), {"registry": connections})
