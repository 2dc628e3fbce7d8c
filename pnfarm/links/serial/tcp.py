"""Lines over TCP, octets as they are: to a server, and from a client."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import socket

from pnfarm.errors import EnvironmentError_
from pnfarm.links.serial.descriptor import FdLine
from pnfarm.vocabulary.endpoints import host_port

__all__ = ["ConnectLine", "ListenLine"]

_CONNECT_SECONDS = 5.0


def _ready(sock: socket.socket) -> None:
    """Small telegrams leave at once, and a peer that vanished is noticed."""
    sock.setblocking(False)
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, 10)
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, 5)
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPCNT, 3)


class ConnectLine(FdLine):
    """TCP to a server that passes octets as they are (``ser2net`` in raw mode, a gateway)."""

    kind = "connect"

    def __init__(self, host: str, port: int, *, baud: int | None = None) -> None:
        super().__init__(baud=baud)
        self._peer = (host, port)
        self._socket: socket.socket | None = None
        self._task: asyncio.Task[None] | None = None

    @property
    def where(self) -> str:
        return host_port(*self._peer)

    async def _begin(self) -> None:
        self._try()

    def _try(self) -> None:
        if self._loop is not None:
            self._task = self._loop.create_task(self._connect(self._loop))

    async def _connect(self, loop: asyncio.AbstractEventLoop) -> None:
        try:
            async with asyncio.timeout(_CONNECT_SECONDS):
                sock = await _connected(loop, *self._peer)
        except TimeoutError:
            self._broken("no-answer", f"{self.where} does not answer")
        except OSError as exc:
            self._broken("no-connection", f"{self.where} cannot be reached: {exc.strerror or exc}")
        else:
            self._socket = sock
            self._attach(sock.fileno())

    def _release(self) -> None:
        sock, self._socket = self._socket, None
        if sock is not None:
            sock.close()

    async def _end(self) -> None:
        task, self._task = self._task, None
        if task is not None and not task.done():
            task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await task


async def _connected(loop: asyncio.AbstractEventLoop, host: str, port: int) -> socket.socket:
    """A connected socket; raises :class:`OSError` of the last address that was tried."""
    failed: OSError = OSError(errno.EHOSTUNREACH, "the name has no address")
    for family, kind, protocol, _, address in await loop.getaddrinfo(host, port, type=socket.SOCK_STREAM):
        sock = socket.socket(family, kind, protocol)
        try:
            _ready(sock)
            await loop.sock_connect(sock, address)
        except OSError as exc:
            sock.close()
            failed = exc
        except BaseException:
            sock.close()
            raise
        else:
            return sock
    raise failed


class ListenLine(FdLine):
    """TCP from a client, one at a time.  The newest one stays: a client that was restarted takes its place."""

    kind = "listen"

    def __init__(self, host: str, port: int, *, baud: int | None = None) -> None:
        super().__init__(baud=baud)
        self._host = host
        #: The port that clients connect to; with 0 the kernel's choice, once the line is open.
        self.port = port
        self._server: socket.socket | None = None
        self._client: socket.socket | None = None

    @property
    def where(self) -> str:
        return host_port(self._host, self.port)

    async def _begin(self) -> None:
        loop = asyncio.get_running_loop()
        try:
            family, kind, protocol, _, address = (
                await loop.getaddrinfo(self._host, self.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
            )[0]
            self._server = socket.socket(family, kind, protocol)
            self._server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._server.bind(address)
            self._server.listen(4)
        except OSError as exc:
            raise EnvironmentError_(f"the line cannot listen on {self.where}: {exc.strerror or exc}") from exc
        self._server.setblocking(False)
        self.port = int(self._server.getsockname()[1])
        loop.add_reader(self._server.fileno(), self._accept)
        self._tell(False, f"{self.where}: waits for a client")

    def _accept(self) -> None:
        if self._server is None:
            return
        try:
            client, _ = self._server.accept()
        except OSError:
            self._counters.interruptions["not-accepted"] += 1
            return
        if self._client is not None:
            self._counters.interruptions["replaced"] += 1
            self._detach()
        _ready(client)
        self._client = client
        self._attach(client.fileno())

    def _later(self) -> None:
        """Nothing to try: the next client comes by itself."""

    def _try(self) -> None:
        """See :meth:`_later`."""

    def _release(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            client.close()

    async def _end(self) -> None:
        server, self._server = self._server, None
        if server is not None:
            asyncio.get_running_loop().remove_reader(server.fileno())
            server.close()
