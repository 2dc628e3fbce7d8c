"""TLS of the API: a certificate and its key from files, which are read again when they change.

A connection counts from its first octet, not only from the end of its handshake: one that does not finish has
:data:`HANDSHAKE_SECONDS`, and where the limit of connections is reached a new one replaces it
(:mod:`pnfarm.api.access.connections`).
"""

from __future__ import annotations

import asyncio
import ssl
import time
from asyncio import sslproto
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import structlog

from pnfarm.api.access.watched_files import WatchedFiles
from pnfarm.errors import ConfigError
from pnfarm.vocabulary.regular_file import read_regular

if TYPE_CHECKING:
    from pathlib import Path

    from pnfarm.api.access.connections import Connections

__all__ = ["ServerTls", "TlsDoor", "door_of"]

#: From a connection to the end of its handshake.
HANDSHAKE_SECONDS = 10.0
#: Handshakes that are begun in a second, and at once after a quiet time: each costs the farm's event loop about as much
#: as a request, and an unknown client could request any number.
PER_SECOND, AT_ONCE = 200.0, 32
#: For a client to say that it has seen the end.
SHUTDOWN_SECONDS = 2.0
#: Octets that wait for a client before the application does.
WRITE_BUFFER = 65_536
#: Octets that are decrypted at once, and held for each connection: the most that a record of TLS has.  asyncio's own is
#: sixteen times as much, 64 MB for as many unknown clients as may be connected.
READ_BUFFER = 16_384
#: Octets of a certificate's file, with the chain, and of a key's.
MOST = 262_144
#: A certificate that ends sooner is reported at the start.
SOON_SECONDS = 14 * 86_400

logger = structlog.get_logger("pnfarm.api")


class _Loaded(NamedTuple):
    """``names`` are those that the certificate is for, ``ends`` is when it expires, in seconds since 1970."""

    context: ssl.SSLContext
    names: tuple[str, ...]
    ends: float


class ServerTls:
    """The context for each next connection.  Raises :class:`ConfigError` for files that cannot serve.

    ``names`` are those that the certificate is for, ``ends`` is when it expires, in seconds since 1970.
    """

    def __init__(self, certificate: Path, key: Path | None = None) -> None:
        self._files = (certificate, key or certificate)
        # of the class: start_tls takes no argument for it
        sslproto.SSLProtocol.max_size = READ_BUFFER
        self._watched = WatchedFiles(self._files, self._load, self._renewed, self._failed)
        self._loaded = self._watched.first
        if (left := self.ends - time.time()) < SOON_SECONDS:
            logger.warning("certificate expires soon", file=str(certificate), days=int(left // 86_400))

    @property
    def names(self) -> tuple[str, ...]:
        return self._loaded.names

    @property
    def ends(self) -> float:
        return self._loaded.ends

    async def context(self) -> ssl.SSLContext:
        """Of the files as they are now; while these cannot serve, of what was read before."""
        await self._watched.follow()
        return self._loaded.context

    def _renewed(self, loaded: _Loaded) -> None:
        self._loaded = loaded
        logger.info("certificate renewed", file=str(self._files[0]), names=list(loaded.names))

    @staticmethod
    def _failed(reason: str) -> None:
        logger.warning("certificate not renewed", reason=reason)

    def _load(self) -> _Loaded:
        certificate, key = self._files
        self._check(certificate, "certificate", b"-----BEGIN CERTIFICATE-----")
        self._check(key, "key", b"PRIVATE KEY-----")
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.minimum_version = ssl.TLSVersion.TLSv1_2
        # a client cannot make the farm calculate without end on one connection
        context.options |= ssl.OP_NO_COMPRESSION | ssl.OP_NO_RENEGOTIATION
        context.set_alpn_protocols(["http/1.1"])
        try:
            # without a password OpenSSL would ask the terminal for one
            context.load_cert_chain(certificate, key, password=lambda: "")
        except ssl.SSLError as exc:
            if exc.reason == "KEY_VALUES_MISMATCH":
                raise ConfigError(f"the key {key} does not belong to the certificate {certificate}") from exc
            raise ConfigError(f"{certificate} and {key} are no certificate and its key in PEM: {exc.reason}") from exc
        except OSError as exc:
            raise ConfigError(f"{certificate} and {key} cannot be read: {(exc.strerror or str(exc)).lower()}") from exc
        return _Loaded(context, *_tried(context, certificate))

    @staticmethod
    def _check(path: Path, what: str, mark: bytes) -> None:
        try:
            text = read_regular(path, MOST)
        except OSError as exc:
            why = (exc.strerror or str(exc)).lower()
            raise ConfigError(f"the {what} {path} cannot be read: {why}") from exc
        if mark not in text:
            raise ConfigError(f"{path} holds no {what} in PEM")
        if what == "key" and b"ENCRYPTED" in text:
            raise ConfigError(f"the key {path} has a passphrase, which the farm cannot ask for; give one without")


def _tried(context: ssl.SSLContext, certificate: Path) -> tuple[tuple[str, ...], float]:
    """Names and end of the certificate, by a handshake in memory that trusts it; raises :class:`ConfigError`."""
    asking = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    asking.check_hostname = False
    # of a chain, the server's own certificate alone is judged
    asking.verify_flags |= ssl.VerifyFlags.VERIFY_X509_PARTIAL_CHAIN
    there, back = ssl.MemoryBIO(), ssl.MemoryBIO()
    try:
        asking.load_verify_locations(certificate)
        client = asking.wrap_bio(back, there)
        server = context.wrap_bio(there, back, server_side=True)
        for _ in range(8):
            done = [_shaken(end) for end in (client, server)]
            if all(done):
                break
    except ssl.SSLCertVerificationError as exc:
        raise ConfigError(f"the certificate {certificate} cannot serve: {exc.verify_message}") from exc
    except ssl.SSLError as exc:
        raise ConfigError(f"the certificate {certificate} cannot serve: {exc.reason}") from exc
    found: Any = client.getpeercert() or {}
    names = tuple(str(value) for _, value in found.get("subjectAltName", ()))
    return names, float(ssl.cert_time_to_seconds(found["notAfter"]))


def _shaken(end: ssl.SSLObject) -> bool:
    try:
        end.do_handshake()
    except ssl.SSLWantReadError:
        return False
    return True


class Pace:
    """Lets the handshakes of one server begin one after the other, in the order of their coming."""

    def __init__(self) -> None:
        self._turn = asyncio.Lock()
        self._next = 0.0

    async def wait(self, transport: asyncio.Transport) -> None:
        """Until it is this connection's turn, or it has been closed, which takes no turn."""
        loop = asyncio.get_running_loop()
        async with self._turn:
            if transport.is_closing():
                return
            self._next = max(self._next, loop.time() - AT_ONCE / PER_SECOND) + 1 / PER_SECOND
            if (left := self._next - loop.time()) > 0:
                # a handshake takes milliseconds of the event loop, which the drives' answers need between two of them
                await asyncio.sleep(left)


class TlsDoor(asyncio.Protocol):
    """A connection until its handshake is done; then a connection of the server has it.

    :func:`door_of` makes a subclass for one server.
    """

    registry: ClassVar[Connections]
    tls: ClassVar[ServerTls]
    pace: ClassVar[Pace]
    served: ClassVar[type[asyncio.Protocol]]

    def __init__(self, **server: Any) -> None:
        self._server = server
        self._early = b""
        self._task: asyncio.Task[None] | None = None
        self.client: tuple[str, int] | None = None
        self.transport: asyncio.Transport

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        peer = transport.get_extra_info("peername")
        self.client = (str(peer[0]), int(peer[1])) if isinstance(peer, tuple) else None
        # what arrives is for the handshake, which begins in the next turn
        transport.pause_reading()
        self.registry.opened(self)
        self.registry.idle(self, idle=True)
        self._task = asyncio.get_running_loop().create_task(self._shake())

    def data_received(self, data: bytes) -> None:
        # came with the end of the handshake
        self._early += data

    async def _shake(self) -> None:
        tls = None
        try:
            await self.pace.wait(self.transport)
            context = await self.tls.context()
            if not self.transport.is_closing():
                tls = await asyncio.get_running_loop().start_tls(
                    self.transport,
                    self,
                    context,
                    server_side=True,
                    ssl_handshake_timeout=HANDSHAKE_SECONDS,
                    ssl_shutdown_timeout=SHUTDOWN_SECONDS,
                )
        except OSError as exc:
            # the registry has counted one that it closed
            if not isinstance(exc, ConnectionResetError):
                self.registry.count(self, _why(exc))
        finally:
            self.registry.gone(self)
        if tls is None:
            self.transport.abort()
            return
        if tls.is_closing():
            return
        # as much as without TLS: what a client does not read waits with the farm no longer than that
        tls.set_write_buffer_limits(high=WRITE_BUFFER)
        served = self.served(**self._server)
        tls.set_protocol(served)
        served.connection_made(tls)
        if self._early:
            served.data_received(self._early)


def _why(exc: OSError) -> str:
    if isinstance(exc, ssl.SSLError):
        return "plain HTTP where TLS is spoken" if exc.reason == "HTTP_REQUEST" else "no TLS"
    return "no handshake in time"


def door_of(connections: Connections, tls: ServerTls, served: type[asyncio.Protocol]) -> type[TlsDoor]:
    """The class of one server's connections before they are ``served``."""
    return type("ServedDoor", (TlsDoor,), {"registry": connections, "tls": tls, "pace": Pace(), "served": served})
