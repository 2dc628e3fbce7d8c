"""How much a client may ask for, so that it costs neither the farm's time nor its memory without bound.

asyncua limits connections, subscriptions, queues and sessions that are not activated when it is given the numbers; it
does not limit the octets of a chunk that never ends, the answers that a client does not read, sessions of one
connection, registrations as a discovery server, intervals and what one request asks for: these are limited here.
"""

from __future__ import annotations

import asyncio
import secrets
from typing import TYPE_CHECKING, Any

from asyncua import ua
from asyncua.common.connection import TransportLimits
from asyncua.common.utils import ServiceError
from asyncua.server.binary_server_asyncio import BinaryServer, OPCUAProtocol
from asyncua.server.internal_server import InternalServer
from asyncua.server.server import Server

if TYPE_CHECKING:
    import socket
    from collections.abc import Callable

    from asyncua.server.internal_session import InternalSession

__all__ = ["MOST_ITEMS", "MOST_OPERATIONS", "BoundedInternalServer", "BoundedServer", "transport_limits"]

MOST_CONNECTIONS = 32
MOST_SESSIONS = 64
MOST_SUBSCRIPTIONS = 128
#: Monitored items of all clients together.
MOST_ITEMS = 10_000
#: Nodes in one request.
MOST_OPERATIONS = 1000
MOST_QUEUED = 100
#: Octets of a chunk, and of a message.
CHUNK = 65_535
MESSAGE = 4 * 1024 * 1024
#: A connection and a session without a user, and a client that does not read, end after this.
PENDING_SECONDS = 20.0
SESSION_MS = 300_000
#: Intervals between two notifications that a client gets, at most.
LONGEST_MS = 3_600_000.0
_STALL_SECONDS = 20.0


def transport_limits() -> TransportLimits:
    """Octets of messages and chunks."""
    return TransportLimits(CHUNK, CHUNK, MESSAGE // CHUNK + 1, MESSAGE)


class BoundedInternalServer(InternalServer):
    """``make_session`` makes those of clients."""

    def __init__(self, user_manager: Any, make_session: Callable[..., InternalSession]) -> None:
        super().__init__(user_manager)
        self._make_session = make_session
        self._sessions: set[InternalSession] = set()
        self.max_session_timeout_ms = SESSION_MS
        self.max_monitored_item_queue_size = MOST_QUEUED
        self.max_unacked_messages_per_subscription = MOST_QUEUED
        self.max_pending_messages_per_connection = 64
        self.max_connections = MOST_CONNECTIONS
        self.max_pending_activation_seconds = PENDING_SECONDS
        self.max_subscriptions = MOST_SUBSCRIPTIONS
        self.max_lifetime_count = 3000
        self.max_keep_alive_count = 1000

    def create_session(self, name: Any, user: Any = None, external: bool = False) -> InternalSession:
        """One for a client; it ends if it is not activated."""
        del user  # until the session is activated, no user
        if len(self._sessions) >= MOST_SESSIONS:
            raise ServiceError(ua.StatusCodes.BadTooManySessions)
        session = self._make_session(self, self.aspace, self.subscription_service, name, external=external)
        task = asyncio.create_task(self._end_unused(session))
        session.pending = task  # kept, or it could be collected
        return session

    async def _end_unused(self, session: InternalSession) -> None:
        await asyncio.sleep(PENDING_SECONDS)
        if not session.is_activated():
            await session.close_session()

    def register_external_session(self, session: InternalSession) -> None:
        # who knows it may go on with the session on another connection
        session.auth_token = ua.NodeId(secrets.token_bytes(32))
        super().register_external_session(session)
        self._sessions.add(session)

    def unregister_external_session(self, session: InternalSession) -> None:
        super().unregister_external_session(session)
        self._sessions.discard(session)

    def register_server(self, server: Any, conf: Any = None) -> None:
        """The farm is no discovery server."""
        del server, conf
        raise ServiceError(ua.StatusCodes.BadServiceUnsupported)


class _Protocol(OPCUAProtocol):
    """One connection: no more octets than a chunk has wait for the rest of it, and none for a client that stalls."""

    _buffer: bytes
    _stalled: asyncio.TimerHandle | None = None

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        if self.transport is not None and len(self._buffer) > CHUNK:
            self._buffer = b""
            self.transport.abort()

    def pause_writing(self) -> None:
        if self.transport is not None and not self.transport.is_closing():
            self.transport.pause_reading()
            self._stalled = asyncio.get_running_loop().call_later(_STALL_SECONDS, self.transport.abort)

    def resume_writing(self) -> None:
        if self._stalled is not None:
            self._stalled.cancel()
        if self.transport is not None and not self.transport.is_closing():
            self.transport.resume_reading()

    def connection_lost(self, ex: BaseException | None) -> None:
        if self._stalled is not None:
            self._stalled.cancel()
        super().connection_lost(ex)


class _Binary(BinaryServer):
    """On a socket that listens already."""

    def __init__(self, found: socket.socket, internal: InternalServer, limits: TransportLimits) -> None:
        host, port = found.getsockname()[:2]
        super().__init__(internal, host, port, limits)
        self._found = found

    def _make_protocol(self) -> OPCUAProtocol:
        return _Protocol(self.iserver, self._policies, self.clients, self.closing_tasks, self.limits)

    async def start(self) -> None:
        self._server = await asyncio.get_running_loop().create_server(self._make_protocol, sock=self._found)
        self.cleanup_task = asyncio.create_task(self._close_task_loop())


class BoundedServer(Server):
    """A server with connections of :class:`_Protocol`, on ``found``."""

    def __init__(self, found: socket.socket, internal: InternalServer) -> None:
        super().__init__(iserver=internal)
        self._found = found
        self.limits = transport_limits()

    async def start(self) -> None:
        await self._setup_server_nodes()
        await self.iserver.start()
        self.bserver = _Binary(self._found, self.iserver, self.limits)
        self.bserver.set_policies(self._policies)
        await self.bserver.start()
