"""What a stranger does to an API by TLS: each attack is a coroutine that takes some seconds at most and returns the
statuses that it got, 0 for a connection that the server closed.

``Attack.may``: statuses that are right for its requests.  None of them may change anything: the tokens that are shown
are expired, removed, of a role that is too small, or come from another origin.
"""

from __future__ import annotations

import asyncio
import json
import ssl
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from random import Random

from pnfarm.api.access.token_file import add_token, remove_tokens
from pnfarm.web.roles import Role

__all__ = ["ATTACKS", "Attack", "Target", "named", "tokens_of"]

SECONDS = 20.0
FAULT = json.dumps({"kind": "silence", "on": "axis-01"}).encode()
#: Requests that change something, with a body that would do it.
CHANGES = (
    ("POST", "/api/v1/faults", FAULT),
    ("POST", "/api/v1/reset", b"{}"),
    ("POST", "/api/v1/drives/axis-01/power-off", b"{}"),
    ("PUT", "/api/v1/states/stolen", b"{}"),
    ("PUT", "/api/v1/drives/axis-01/params/ACC", b'{"value": 1}'),
    ("DELETE", "/api/v1/faults/1", b""),
)
CHANGE = b"POST /api/v1/faults HTTP/1.1\r\n"
#: What a request may get that is refused, and what one that cannot be read may get.
REFUSED = frozenset({401, 403})
BROKEN = frozenset({0, 400, 404, 405, 408, 411, 413, 414, 415, 422, 431, 501, 505})


def tokens_of(file: Path) -> dict[str, str]:
    """Make a file of tokens: one of each role, one that has expired, and one that is removed; their secrets."""
    secrets = {
        "wall": add_token(file, "wall", Role.READ, None),
        "ci": add_token(file, "ci", Role.INJECT, None),
        "boss": add_token(file, "boss", Role.ADMIN, None),
        "late": add_token(file, "late", Role.ADMIN, time.time() - 1),
        "gone": add_token(file, "gone", Role.ADMIN, None),
    }
    remove_tokens(file, ["gone"])
    return secrets


@dataclass
class Target:
    """One server, and the tokens by what is wrong with them; ``context`` trusts its authority."""

    name: str
    port: int
    context: ssl.SSLContext
    secrets: dict[str, str]
    rng: Random = field(default_factory=Random)

    async def plain(self) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        """A connection without TLS."""
        return await asyncio.wait_for(asyncio.open_connection("127.0.0.1", self.port), SECONDS)

    async def secure(self) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        """A connection by TLS."""
        opening = asyncio.open_connection("127.0.0.1", self.port, ssl=self.context, server_hostname="127.0.0.1")
        return await asyncio.wait_for(opening, SECONDS)

    async def say(self, octets: bytes) -> int:
        """Status of the answer to these octets of a connection."""
        reader, writer = await self.secure()
        try:
            writer.write(octets)
            # a server that refuses the first of them may close before it read the last
            with suppress(OSError, ssl.SSLError, TimeoutError):
                await asyncio.wait_for(writer.drain(), SECONDS)
            return await status_of(reader)
        finally:
            await closed(writer)

    async def ask(self, method: str, path: str, body: bytes, **headers: str) -> int:
        """Status of one well-formed request."""
        shown = {"Host": f"127.0.0.1:{self.port}", "Content-Type": "application/json", **headers}
        lines = "".join(f"{name.replace('_', '-')}: {value}\r\n" for name, value in shown.items())
        head = f"{method} {path} HTTP/1.1\r\n{lines}Content-Length: {len(body)}\r\nConnection: close\r\n\r\n"
        return await self.say(head.encode("latin-1") + body)

    def bearer(self, who: str) -> str:
        """The header with somebody's token."""
        return f"Bearer {self.secrets[who]}"


def named(status: int) -> str:
    """A status as a report names it."""
    return str(status) if status else "closed"


async def status_of(reader: asyncio.StreamReader) -> int:
    """The status in the first line of an answer; 0 for a connection that ends, or that says nothing for 20 s."""
    with suppress(TimeoutError, OSError, ssl.SSLError, asyncio.LimitOverrunError, ValueError):
        line = await asyncio.wait_for(reader.readline(), SECONDS)
        found = line.split(b" ", 2)
        if len(found) > 1 and found[0].startswith(b"HTTP/1.") and found[1].isdigit():
            return int(found[1])
    return 0


async def closed(writer: asyncio.StreamWriter) -> None:
    """Close a connection, whose other side may have done so before."""
    writer.transport.abort()
    with suppress(OSError, ssl.SSLError, TimeoutError):
        await asyncio.wait_for(writer.wait_closed(), SECONDS)


async def _slow(target: Target) -> list[int]:
    """A request whose octets come one by one, and never all."""
    reader, writer = await target.secure()
    try:
        for octet in f"GET /api/v1/drives HTTP/1.1\r\nHost: 127.0.0.1:{target.port}\r\nX: ".encode():
            writer.write(bytes([octet]))
            await asyncio.sleep(0.2)
            if reader.at_eof():
                break
    finally:
        await closed(writer)
    return [0]


async def _half_open(target: Target) -> list[int]:
    """Connections that say nothing, or the head of a handshake."""
    held = []
    try:
        for number in range(40):
            _, writer = await target.plain()
            held.append(writer)
            if number % 2:
                writer.write(bytes.fromhex("160301020001"))
        await asyncio.sleep(2.0)
    finally:
        for writer in held:
            await closed(writer)
    return [0]


async def _oversized(target: Target) -> list[int]:
    """Headers, paths and bodies beyond any bound."""
    host = f"Host: 127.0.0.1:{target.port}\r\n".encode()
    token = b"Authorization: " + target.bearer("wall").encode() + b"\r\n"
    large = b"a" * (1 << 20)
    return [
        await target.say(b"GET /" + large + b" HTTP/1.1\r\n" + host + b"\r\n"),
        await target.say(b"GET / HTTP/1.1\r\n" + host + b"X-A: " + large + b"\r\n\r\n"),
        await target.say(b"GET / HTTP/1.1\r\n" + host + b"X-A: a\r\n" * 100_000 + b"\r\n"),
        await target.say(CHANGE + host + token + b"Content-Length: 99999999999\r\n\r\n" + large),
        await target.say(b"POST / HTTP/1.1\r\n" + host + b"Content-Length: 1048576\r\n\r\ntoken=" + large),
    ]


async def _malformed(target: Target) -> list[int]:
    """What is no HTTP, or two kinds of it at once."""
    rng = target.rng
    host = f"Host: 127.0.0.1:{target.port}\r\n".encode()
    both = CHANGE + host + b"Content-Length: 5\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n"
    return [
        await target.say(rng.randbytes(rng.randrange(1, 2000)) + b"\r\n\r\n"),
        await target.say(b"GET /metrics HTTP/9.9\r\n" + host + b"\r\n"),
        await target.say(b"GET /\x00\xff HTTP/1.1\r\n" + host + b"\r\n"),
        await target.say(both + CHANGE + host + b"\r\n"),
        await target.say(CHANGE + host + b"Transfer-Encoding: chunked\r\n\r\nzz\r\n"),
        await target.say(b"GET / HTTP/1.1\r\n" + host + b"A\x00B: \r\n\r\n"),
        await target.say(b"BREW /api/v1/drives HTTP/1.1\r\n" + host + b"\r\n"),
        await target.say(b"CONNECT 127.0.0.1:22 HTTP/1.1\r\n" + host + b"\r\n"),
        await target.say(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"),
    ]


async def _handshakes(target: Target) -> list[int]:
    """No TLS at a port of TLS, and handshakes of random octets."""
    noise = target.rng.randbytes
    for octets in (b"GET / HTTP/1.0\r\n\r\n", b"\x16\x03\x01\x00\x40" + noise(64), noise(512)):
        reader, writer = await target.plain()
        try:
            writer.write(octets)
            with suppress(OSError, TimeoutError):
                await asyncio.wait_for(reader.read(4096), SECONDS)
        finally:
            await closed(writer)
    return [0]


async def _tokens(target: Target) -> list[int]:
    """Changes with no token, and with one that is wrong, expired, removed, or may only read."""
    guessed = f"Bearer {target.rng.randbytes(24).hex()}"
    shown = ({}, *({"Authorization": one} for one in (guessed, *map(target.bearer, ("late", "gone", "wall")))))
    return [await target.ask(*change, **headers) for change in CHANGES for headers in shown]


async def _other_origins(target: Target) -> list[int]:
    """A page elsewhere uses a browser that has the cookie of somebody who may do everything."""
    cookie = f"pnfarm_token={target.secrets['boss']}"
    origins = ("https://evil.example", f"http://127.0.0.1:{target.port}", "null", "https://127.0.0.1")
    return [
        await target.ask(*change, Cookie=cookie, Origin=origin, Content_Type="text/plain")
        for change in CHANGES
        for origin in origins
    ]


async def _rebinding(target: Target) -> list[int]:
    """A name of somebody else that points to this address; a browser has no cookie for it."""
    name = f"evil.example:{target.port}"
    return [await target.ask(*change, Host=name, Origin=f"https://{name}") for change in CHANGES]


async def _slow_forms(target: Target) -> list[int]:
    """Forms for a token whose body never ends, and beside them somebody who may read, who has an answer at once."""
    held = []
    head = f"POST / HTTP/1.1\r\nHost: 127.0.0.1:{target.port}\r\nContent-Length: 100\r\n"
    head += "Content-Type: application/x-www-form-urlencoded\r\n\r\ntoken="
    try:
        for _ in range(40):
            _, writer = await target.secure()
            held.append(writer)
            writer.write(head.encode())
        return [await target.ask("GET", "/api/v1/faults", b"", Authorization=target.bearer("wall"))]
    finally:
        for writer in held:
            await closed(writer)


async def _deaf_streams(target: Target) -> list[int]:
    """Streams of events that nobody reads, by somebody who may read."""
    held = []
    head = f"GET /api/v1/events?after=0 HTTP/1.1\r\nHost: 127.0.0.1:{target.port}\r\n"
    head += f"Authorization: {target.bearer('wall')}\r\n\r\n"
    try:
        for _ in range(8):
            _, writer = await target.secure()
            held.append(writer)
            writer.write(head.encode())
            writer.transport.pause_reading()
        await asyncio.sleep(2.0)
    finally:
        for writer in held:
            await closed(writer)
    return [200]


async def _flood(target: Target) -> list[int]:
    """Requests by somebody who may read, as fast as they are answered."""
    paths = ("/api/v1/drives", "/metrics", "/api/v1/faults", "/", "/openapi.json")
    return [
        await target.ask("GET", target.rng.choice(paths), b"", Authorization=target.bearer("wall")) for _ in range(10)
    ]


async def _wrong_values(target: Target) -> list[int]:
    """Bodies and paths that nobody would send, by somebody who may disturb: each is refused for what it is."""
    long = b'{"kind": "silence", "on": "' + b"x" * 100_000 + b'"}'
    bodies = (b"[" * 20_000, long, b'{"kind": NaN}', b"\xff\xfe", b"1e999", b"{}")
    paths = ("/api/v1/faults", "/api/v1/scenarios", "/api/v1/traces")
    found = [
        await target.ask("POST", target.rng.choice(paths), body, Authorization=target.bearer("ci")) for body in bodies
    ]
    found += [
        await target.ask("GET", path, b"", Authorization=target.bearer("ci"))
        for path in (
            "/api/v1/../../etc/passwd",
            "/static/..%2f..%2fetc/passwd",
            "/api/v1/drives/%00",
            f"/{'%41' * 9000}",
        )
    ]
    return found


@dataclass(frozen=True)
class Attack:
    """``may``: statuses that are right for it."""

    go: Callable[[Target], Awaitable[list[int]]]
    may: frozenset[int]


ATTACKS = {
    "slow requests": Attack(_slow, frozenset({0})),
    "half-open connections": Attack(_half_open, frozenset({0})),
    # a form, too, which waits for a place among those of strangers
    "oversized requests": Attack(_oversized, BROKEN | REFUSED | {503}),
    "malformed requests": Attack(_malformed, BROKEN | REFUSED),
    "handshakes that are none": Attack(_handshakes, frozenset({0})),
    "tokens without the right": Attack(_tokens, REFUSED),
    "other origins": Attack(_other_origins, REFUSED),
    "names that point here": Attack(_rebinding, REFUSED),
    "slow forms": Attack(_slow_forms, frozenset({200})),
    "streams that nobody reads": Attack(_deaf_streams, frozenset({200})),
    "floods of requests": Attack(_flood, frozenset({200, 503, 0})),
    "wrong values": Attack(_wrong_values, BROKEN),
}
