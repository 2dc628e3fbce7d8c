"""What a hub asks a shard: each question with a bound of its time and of its answer's size, never redirected."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from http import HTTPStatus
from typing import TYPE_CHECKING, Any

import anyio
import httpx

from pnfarm.hub.shards import AwayError
from pnfarm.hub.states import ShardEvent
from pnfarm.vocabulary.trust import why_untrusted

if TYPE_CHECKING:
    import ssl
    from collections.abc import AsyncIterator, Mapping

__all__ = ["REQUEST_SECONDS", "Answer", "ShardClient"]

#: From a request to the whole answer.
REQUEST_SECONDS = 2.0
#: Octets of an answer: ten thousand drives in full have 30 million.
MOST_OCTETS = 64_000_000
#: Octets of a stream without a line's end: all drives of the largest farm at a glance have two million.
MOST_LINE = 4_000_000
#: Longest silence of a stream: a farm sends a comment every 15 s.
SILENCE_SECONDS = 40.0
#: Connections to one shard at once.
MOST_CONNECTIONS = 64


@dataclass(frozen=True, slots=True)
class Answer:
    """``media_type`` and ``tag`` (ETag) as the shard sent them."""

    status: int
    body: bytes
    media_type: str
    tag: str | None = None

    @property
    def good(self) -> bool:
        return 200 <= self.status < 300

    def object(self) -> dict[str, Any]:
        """The JSON object of the body.  Raises :class:`ValueError`."""
        found = _parsed(self.body)
        if not isinstance(found, dict):
            raise ValueError("it is not a JSON object")  # noqa: TRY004 - it is the answer that is wrong
        return found


def _plain(header: str | None) -> str | None:
    """A header that can be passed on, else None."""
    return header if header is not None and header.isascii() else None


def _finite(text: str) -> float:
    found = float(text)
    if not math.isfinite(found):
        raise ValueError(f"it has {text[:20]}, which is no number of JSON")
    return found


def _parsed(octets: bytes) -> Any:
    """JSON, which others can be made of again.  Raises :class:`ValueError`."""
    try:
        return json.loads(octets, parse_float=_finite, parse_constant=_finite)
    except RecursionError as exc:
        raise ValueError("it is nested too deeply") from exc


class ShardClient:
    """Of one shard.  ``transport`` is for tests; raises :class:`AwayError` for whatever is no answer of a farm.

    With https, ``trust`` checks its certificate, None by the system's authorities, and the certificate must be for
    ``server_name``, None for the URL's host.
    """

    def __init__(
        self,
        url: str,
        token: str | None,
        transport: httpx.AsyncBaseTransport | None = None,
        *,
        trust: ssl.SSLContext | None = None,
        server_name: str | None = None,
    ) -> None:
        headers = {"Accept-Encoding": "identity"} | ({"Authorization": f"Bearer {token}"} if token else {})
        self._label = url.partition("://")[2]
        self._extensions = {"sni_hostname": server_name} if server_name and url.startswith("https:") else {}
        # shards are on the local network: the environment's proxies are not for them
        self._client = httpx.AsyncClient(
            base_url=url,
            headers=headers,
            timeout=None,  # noqa: S113 - each request has a bound for all of it
            trust_env=False,
            verify=True if trust is None else trust,
            follow_redirects=False,
            transport=transport,
            limits=httpx.Limits(max_connections=MOST_CONNECTIONS, max_keepalive_connections=8, keepalive_expiry=5.0),
        )

    async def close(self) -> None:
        await self._client.aclose()

    async def ask(
        self,
        method: str,
        path: str,
        *,
        body: Mapping[str, Any] | bytes | None = None,
        query: Mapping[str, Any] | str | None = None,
        headers: Mapping[str, str] | None = None,
        seconds: float = REQUEST_SECONDS,
    ) -> Answer:
        """One request; ``path`` is quoted already and begins with a slash."""
        content = body if isinstance(body, bytes) or body is None else json.dumps(body).encode()
        sent = {**({"Content-Type": "application/json"} if content is not None else {}), **(headers or {})}
        url = f"{path}?{query}" if isinstance(query, str) and query else path
        params = query if not isinstance(query, str) else None
        try:
            with anyio.fail_after(seconds):
                request = self._client.build_request(
                    method, url, content=content, headers=sent, params=params, extensions=self._extensions
                )
                response = await self._client.send(request, stream=True)
                try:
                    return await self._read(response)
                finally:
                    await response.aclose()
        except TimeoutError as exc:
            raise AwayError(f"{self._label} gave no answer within {seconds:g} s", ShardEvent.MISSED, "timeout") from exc
        except httpx.HTTPError as exc:
            raise self._failed(exc) from exc

    async def _read(self, response: httpx.Response) -> Answer:
        # 304 is no redirection: the client has the answer
        if response.is_redirect and response.status_code != HTTPStatus.NOT_MODIFIED:
            raise AwayError(f"{self._label} redirects elsewhere, which no farm does", slug="redirect")
        octets = bytearray()
        async for chunk in response.aiter_bytes():
            octets += chunk
            if len(octets) > MOST_OCTETS:
                raise AwayError(f"{self._label} answers with more than {MOST_OCTETS} octets", slug="flood")
        media_type, tag = (_plain(response.headers.get(key)) for key in ("content-type", "etag"))
        return Answer(response.status_code, bytes(octets), media_type or "", tag)

    def _failed(self, exc: httpx.HTTPError) -> AwayError:
        if isinstance(exc, httpx.TimeoutException):
            return AwayError(f"{self._label} gave no answer in time", ShardEvent.MISSED, "timeout")
        if (why := why_untrusted(exc)) is not None:
            return AwayError(f"{self._label} is not asked: {why}", slug="untrusted")
        if isinstance(exc, httpx.ConnectError):
            return AwayError(f"{self._label} refuses the connection: no program listens there", slug="refused")
        if isinstance(exc, httpx.RemoteProtocolError):
            return AwayError(f"{self._label} does not answer as a farm does: {exc}", slug="garbage")
        return AwayError(f"the connection to {self._label} failed: {exc or type(exc).__name__}", slug="broken")

    async def stream(
        self, path: str, *, query: Mapping[str, Any] | None = None, last: str | None = None
    ) -> AsyncIterator[tuple[str, dict[str, Any]]]:
        """The messages of an event stream, as (event, data), until the shard ends it."""
        headers = {"Accept": "text/event-stream"} | ({"Last-Event-ID": last} if last is not None else {})
        request = self._client.build_request("GET", path, headers=headers, params=query, extensions=self._extensions)
        try:
            with anyio.fail_after(REQUEST_SECONDS):
                response = await self._client.send(request, stream=True)
            try:
                if response.status_code != 200 or "text/event-stream" not in response.headers.get("content-type", ""):
                    raise AwayError(f"{self._label} has no stream: it answers {response.status_code}", slug="garbage")
                async for message in _messages(response):
                    yield message
            finally:
                with anyio.CancelScope(shield=True), anyio.move_on_after(0.2):
                    await response.aclose()
        except TimeoutError as exc:
            raise AwayError(f"the stream of {self._label} is silent", ShardEvent.MISSED, "timeout") from exc
        except httpx.HTTPError as exc:
            raise self._failed(exc) from exc
        except ValueError as exc:
            raise AwayError(f"the stream of {self._label} holds what no farm sends: {exc}", slug="garbage") from exc


async def _messages(response: httpx.Response) -> AsyncIterator[tuple[str, dict[str, Any]]]:
    """WHATWG HTML, 9.2.6, as far as a farm uses it.  Raises :class:`ValueError` and :class:`TimeoutError`."""
    chunks = response.aiter_bytes().__aiter__()
    rest = b""
    event, data = "message", b""
    while True:
        with anyio.fail_after(SILENCE_SECONDS):
            try:
                chunk = await anext(chunks)
            except StopAsyncIteration:
                return
        *lines, rest = (rest + chunk).split(b"\n")
        if len(rest) > MOST_LINE:
            raise ValueError(f"a line of more than {MOST_LINE} octets")
        for line in lines:
            if line.startswith(b"event:"):
                event = line[6:].strip().decode("ascii", "replace")
            elif line.startswith(b"data:"):
                data = line[5:].strip()
            elif not line and data:
                if isinstance(found := _parsed(data), dict):
                    yield event, found
                event, data = "message", b""
