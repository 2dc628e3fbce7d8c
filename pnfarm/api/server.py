"""Serves the API in the farm's own event loop."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import socket
from typing import TYPE_CHECKING, Any

import anyio
import uvicorn
from anyio import TASK_STATUS_IGNORED

from pnfarm.api.access.audit import AuditLog, kept
from pnfarm.api.access.connections import BACKLOG, Connections, ListeningSocket, connection_limit, protocol_of
from pnfarm.api.access.tls import ServerTls, door_of
from pnfarm.api.access.token import token_of
from pnfarm.api.app import make_app
from pnfarm.api.problems import REPORTED
from pnfarm.errors import EnvironmentError_
from pnfarm.farm.events import ApiListening
from pnfarm.vocabulary.endpoints import host_port

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Generator

    from anyio.abc import TaskStatus
    from fastapi import FastAPI
    from starlette.types import ASGIApp, Receive, Scope, Send

    from pnfarm.farm.farm import Farm
    from pnfarm.farm.file.reading import FarmConfig

__all__ = ["api_url", "audit_of", "listen", "serve", "serve_farm", "tls_of"]

#: Time that open requests get when the server stops.
GRACE_SECONDS = 2
#: Octets of a request's head: a browser sends one or two thousand.
MAX_HEAD = 16_384


class _Server(uvicorn.Server):
    """A server without signal handlers: the program handles signals."""

    def __init__(self, config: uvicorn.Config) -> None:
        super().__init__(config)
        self.up = anyio.Event()

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        self.up.set()

    @contextlib.contextmanager
    def capture_signals(self) -> Generator[None, None, None]:
        yield


class Contained:
    """Drops errors of the application that have been answered and logged.

    The framework raises them nevertheless, and the server would log each a second time.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            await self._app(scope, receive, send)
        except Exception:
            if not scope.get(REPORTED):
                raise


def listen(host: str, port: int, *, what: str = "the API", key: str = "api") -> socket.socket:
    """A listening socket; raises :class:`EnvironmentError_` with the reason and a remedy.

    ``what`` is to listen, as ``key`` of the farm file says.
    """
    where = host_port(host, port)
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        found = ListeningSocket(family, kind, protocol)
    except socket.gaierror as exc:
        raise EnvironmentError_(f"{host!r} is not an address of this machine ({exc}); set {key}: HOST:PORT") from exc
    except OSError as exc:
        raise EnvironmentError_(f"{what} cannot listen on {where}: {exc.strerror}") from exc
    try:
        found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        found.bind(address)
        found.listen(BACKLOG)
        found.setblocking(False)
    except OSError as exc:
        found.close()
        reasons = {
            errno.EADDRINUSE: f"another program (another farm?) uses this port; set another one under {key}:",
            errno.EACCES: f"ports below 1024 need CAP_NET_BIND_SERVICE; set a higher one under {key}:",
            errno.EADDRNOTAVAIL: "no interface of this machine has this address",
        }
        why = reasons.get(exc.errno or 0, str(exc))
        raise EnvironmentError_(f"{what} cannot listen on {where}: {why}") from exc
    return found


def api_url(host: str, port: int, *, secure: bool) -> str:
    """The address of an API as clients write it."""
    return f"{'https' if secure else 'http'}://{host_port(host, port)}"


def tls_of(config: FarmConfig) -> ServerTls | None:
    """The certificate of a farm's API, None without one.  Raises :class:`~pnfarm.errors.ConfigError`."""
    section = config.api
    if section is None or section.tls_cert is None:
        return None
    return ServerTls(config.beside(section.tls_cert), config.beside(section.tls_key) if section.tls_key else None)


def audit_of(config: FarmConfig) -> AuditLog | None:
    """The audit log of a farm's API, None without one; the state folder has the note of its end.

    Raises :class:`~pnfarm.errors.ConfigError` and :class:`EnvironmentError_`.
    """
    section = config.api
    if section is None or section.audit is None:
        return None
    path, state = config.beside(section.audit), config.state_directory
    if state is None:
        return AuditLog(path)
    # shards of one file share the state folder, and each has a log of its own
    place = hashlib.sha256(str(path.resolve()).encode()).hexdigest()
    return AuditLog(path, state / f"audit-end-{place[:8]}.json")


async def serve(
    app: FastAPI,
    host: str,
    port: int,
    *,
    tls: ServerTls | None = None,
    task_status: TaskStatus[tuple[str, int]] = TASK_STATUS_IGNORED,
) -> None:
    """Serve ``app`` until cancelled; started with the address and port that it has (port 0 takes a free one).

    Leaving ends every event stream and lets requests finish.  Raises :class:`EnvironmentError_`.
    """
    await _serve(app, listen(host, port), tls, task_status.started)


async def _serve(
    app: FastAPI, found: socket.socket, tls: ServerTls | None, up: Callable[[tuple[str, int]], None]
) -> None:
    connections = Connections(connection_limit())
    served = protocol_of(connections)
    config = uvicorn.Config(
        Contained(app),
        http=served if tls is None else door_of(connections, tls, served),
        backlog=BACKLOG,
        h11_max_incomplete_event_size=MAX_HEAD,
        log_config=None,
        access_log=False,
        # a client of this machine could name any other one as itself, and the audit log would have it
        proxy_headers=False,
        lifespan="off",
        ws="none",
        server_header=False,
        timeout_graceful_shutdown=GRACE_SECONDS,
    )
    server = _Server(config)
    stopped = anyio.Event()

    async def run() -> None:
        try:
            await server.serve(sockets=[found])
        finally:
            stopped.set()

    try:
        async with anyio.create_task_group() as group:
            group.start_soon(_shielded, run)
            try:
                await server.up.wait()
                bound: Any = found.getsockname()
                up((bound[0], bound[1]))
                await stopped.wait()
            finally:
                app.state.context.close()
                connections.stop()
                server.should_exit = True
    finally:
        found.close()


async def _shielded(run: Callable[[], Awaitable[None]]) -> None:
    """Ask the server to stop instead of cancelling it; it stops when its requests are done."""
    with anyio.CancelScope(shield=True):
        await run()


async def serve_farm(farm: Farm, *, task_status: TaskStatus[tuple[str, int]] = TASK_STATUS_IGNORED) -> None:
    """Serve a running farm as its file's ``api`` section says; returns at once when that is ``off``.

    A farm that listens beyond loopback has a token (:mod:`pnfarm.api.access.token`): the log reports its file, or the
    token itself where it is not in a file.
    """
    section = farm.config.api
    if section is None:
        task_status.started(("", 0))
        return
    tls = tls_of(farm.config)
    token = token_of(farm.config)
    audit = audit_of(farm.config)
    app = make_app(
        farm.core,
        now=farm.now,
        poke=farm.driver.poke,
        token=token.value,
        read_token=token.read,
        tokens=token.tokens,
        audit=audit,
        states=farm.states,
    )
    token_place: dict[str, str] = {}
    if token.file is not None:
        token_place["token_file"] = str(token.file)
    elif token.in_log is not None:
        token_place["token"] = token.in_log

    def up(address: tuple[str, int]) -> None:
        farm.log.record(farm.now(), "", ApiListening(api_url(*address, secure=tls is not None), **token_place))
        task_status.started(address)

    try:
        async with kept(audit, farm.core.name):
            await _serve(app, listen(section.host, section.port), tls, up)
    finally:
        app.state.context.collector.close()
