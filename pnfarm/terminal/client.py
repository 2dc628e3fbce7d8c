"""Client of a running farm's HTTP API; every failure is raised as one of the package's errors."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self
from urllib.parse import quote

from pnfarm.errors import ConfigError, EnvironmentError_, PnfarmError
from pnfarm.vocabulary.trust import CA_VARIABLE, client_context, why_untrusted

if TYPE_CHECKING:
    from types import TracebackType

    import httpx

__all__ = ["FarmClient", "FarmError", "RefusedError", "sendable", "token_in"]

#: Environment variable that names a file with the token; used if neither --token nor PNFARM_TOKEN is given.
FILE_VARIABLE = "PNFARM_TOKEN_FILE"
#: A farm answers in milliseconds; a power cycle or a thousand drives take longer.
TIMEOUT_SECONDS = 10.0
#: Longest silence of a stream: a farm sends a comment every 15 s.
SILENCE_SECONDS = 40.0


class FarmError(PnfarmError):
    """The farm had an internal error while it answered."""

    exit_code = 5


def _base(address: str, *, secure: bool, where: str) -> str:
    """``HOST:PORT`` or a URL, as the URL of the API; ``secure``: https where there is no scheme."""
    url = address.strip().rstrip("/")
    if "://" not in url:
        url = f"{'https' if secure else 'http'}://{url}"
    scheme, _, rest = url.partition("://")
    if scheme not in {"http", "https"} or not rest or "/" in rest.removesuffix("/api/v1"):
        raise ConfigError(f"{address!r} is not the address of a farm; give a URL such as http://127.0.0.1:8702{where}")
    return url if url.endswith("/api/v1") else f"{url}/api/v1"


def token_in(variable: str = FILE_VARIABLE) -> str | None:
    """The token in the file that an environment variable names, if it does.  Raises :class:`ConfigError`."""
    name = os.environ.get(variable)
    if not name:
        return None
    try:
        token = Path(name).read_text("ascii").strip()
    except (OSError, UnicodeError) as exc:
        why = (getattr(exc, "strerror", None) or str(exc)).lower()
        raise ConfigError(f"the token's file {name} ({variable}) cannot be read: {why}") from exc
    if not token:
        # a server without a token is open
        raise ConfigError(f"the token's file {name} ({variable}) is empty")
    return token


def sendable(token: str | None) -> str | None:
    """A token without the blanks around it, as of a file's last line; None for none.

    Raises :class:`ConfigError` for one that no header can carry: an error of the library below would show it.
    """
    found = (token or "").strip()
    if not all("!" <= letter <= "~" for letter in found):
        raise ConfigError(
            "the token has characters that no header can carry; allowed: letters, digits and signs of ASCII, no blanks"
        )
    return found or None


class RefusedError(ConfigError):
    """The farm refused a request; ``errors`` has an entry for each thing that is wrong, if the farm names them."""

    def __init__(self, detail: str, errors: object = None) -> None:
        super().__init__(detail)
        self.errors: list[Any] = errors if isinstance(errors, list) else []


class FarmClient:
    """A context manager.  ``address`` is a URL or HOST:PORT; paths are relative to ``/api/v1``.

    ``tls_ca`` is the file of the authority of a farm at https, and makes https the scheme of HOST:PORT; left out,
    the one that PNFARM_TLS_CA names, or the system's authorities.  ``option`` is where a user gives the address;
    None for a caller without options.
    """

    def __init__(
        self,
        address: str,
        token: str | None = None,
        tls_ca: str | Path | None = None,
        *,
        option: str | None = "--api",
    ) -> None:
        import httpx

        self.address = address
        self._where = f" with {option}" if option else ""
        token = sendable(token) or sendable(token_in())
        url = _base(address, secure=bool(tls_ca or os.environ.get(CA_VARIABLE)), where=self._where)
        trust = client_context(tls_ca) if url.startswith("https:") else True
        headers = {"Authorization": f"Bearer {token}"} if token else {}
        try:
            # a farm is on the local network: do not use the environment's proxies
            self._client = httpx.Client(
                base_url=url, headers=headers, timeout=TIMEOUT_SECONDS, trust_env=False, verify=trust
            )
            # decodes a name like xn--..., which each request does
            _ = self._client.base_url.host
        except (httpx.InvalidURL, UnicodeError) as exc:
            raise ConfigError(f"{address!r} is not the address of a farm ({exc}); give a URL{self._where}") from exc

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._client.close()

    def get(self, *path: str, query: Mapping[str, Any] | None = None) -> Any:
        """Read ``path``; its parts are quoted and may hold any characters."""
        return self._ask("GET", path, query=query)

    def put(self, *path: str, body: Mapping[str, Any]) -> Any:
        return self._ask("PUT", path, body)

    def post(self, *path: str, body: Mapping[str, Any] | None = None, query: Mapping[str, Any] | None = None) -> Any:
        return self._ask("POST", path, body, query)

    def patch(self, *path: str, body: Mapping[str, Any], query: Mapping[str, Any] | None = None) -> Any:
        return self._ask("PATCH", path, body, query=query)

    def delete(self, *path: str, query: Mapping[str, Any] | None = None) -> Any:
        return self._ask("DELETE", path, query=query)

    def _ask(
        self,
        method: str,
        path: tuple[str, ...],
        body: Mapping[str, Any] | None = None,
        query: Mapping[str, Any] | None = None,
    ) -> Any:
        with self._asking():
            response = self._client.request(method, _joined(path), json=body, params=query)
        self._raise_for(response)
        if not response.content:
            return None
        try:
            return response.json()
        except ValueError as exc:
            raise self._not_a_farm() from exc

    @contextmanager
    def _asking(self) -> Iterator[None]:
        """Requests inside it fail with sentences for users."""
        import httpx

        try:
            yield
        except httpx.HTTPError as exc:
            raise self._unreachable(exc) from exc
        except httpx.InvalidURL as exc:
            raise ConfigError(f"no farm can be asked for this: {str(exc).lower()}") from exc
        except UnicodeEncodeError as exc:
            # a shell hands on any octets
            odd = ascii(exc.object[max(0, exc.start - 20) : exc.end + 20])
            raise ConfigError(f"{odd} has octets that are not text in UTF-8") from exc

    def metrics(self) -> str:
        """The farm's metrics in Prometheus's text format."""
        with self._asking():
            response = self._client.get(self._client.base_url.join("/metrics"))
        self._raise_for(response)
        return response.text

    def events(self, drive: str | None = None, *, follow: bool = True) -> Iterator[dict[str, Any]]:
        """The farm's event log, of one drive or of all; with ``follow`` also new entries until the farm stops."""
        return (entry for _, entry in self.entries(drive, follow=follow))

    def entries(
        self, drive: str | None = None, *, follow: bool = True, after: str = "0"
    ) -> Iterator[tuple[str, dict[str, Any]]]:
        """As :meth:`events`, each with its position; those after the position ``after``."""
        chosen = {"drive": drive} if drive else {}
        if not follow:
            chosen["follow"] = "false"
        return self._stream("events", chosen, {"Last-Event-ID": after})

    def values(self, devices: Sequence[str]) -> Iterator[dict[str, Any]]:
        """The signals of these devices, or of ``["all"]``: at first each, then what changed; until the farm stops.

        A dictionary is a ChangedSignals of the API's description.
        """
        return (data for _, data in self._stream("live", {"device": list(devices), "overview": "false"}, {}))

    def _stream(
        self, path: str, query: Mapping[str, Any], headers: Mapping[str, str]
    ) -> Iterator[tuple[str, dict[str, Any]]]:
        import httpx

        patience = httpx.Timeout(TIMEOUT_SECONDS, read=SILENCE_SECONDS)
        sent = {"Accept": "text/event-stream", **headers}
        stream = self._client.stream("GET", path, headers=sent, timeout=patience, params=query)
        # a farm that ends while it sends events is no error
        with self._asking(), suppress(httpx.RemoteProtocolError), stream as response:
            if response.is_error:
                response.read()
            self._raise_for(response)
            yield from _messages(response.iter_lines())

    def _raise_for(self, response: httpx.Response) -> None:
        if response.is_success:
            return
        try:
            found = response.json()
        except ValueError:
            found = None
        detail = found.get("detail") if isinstance(found, dict) else None
        if not isinstance(detail, str):
            raise self._not_a_farm()
        if response.status_code == 503:
            raise EnvironmentError_(detail)
        if response.status_code >= 500:
            raise FarmError(f"{detail} (the farm at {self.address})")
        if response.status_code == 401:
            hint = "give --token, PNFARM_TOKEN or PNFARM_TOKEN_FILE"
            # of a token that it knows, the farm says what is wrong with it
            is_known = "invalid_token" in response.headers.get("www-authenticate", "")
            if is_known:
                raise ConfigError(f"{detail}: {hint}")
            sent = "authorization" in response.request.headers
            raise ConfigError(
                f"the farm does not know this token: {hint}" if sent else f"the farm needs its token: {hint}"
            )
        raise RefusedError(detail, found.get("errors"))

    def _not_a_farm(self) -> EnvironmentError_:
        return EnvironmentError_(f"the server at {self.address} is not a farm; give the farm's address{self._where}")

    def _unreachable(self, exc: httpx.HTTPError) -> PnfarmError:
        import httpx

        if (why := why_untrusted(exc)) is not None:
            return ConfigError(f"the farm at {self.address} is not asked: {why}")
        if isinstance(exc, httpx.ConnectError):
            return EnvironmentError_(
                f"no farm answers at {self.address}: start one with `pnfarm up FILE`, or give its address{self._where}"
            )
        if isinstance(exc, httpx.TimeoutException):
            return EnvironmentError_(f"the farm at {self.address} gave no answer within {TIMEOUT_SECONDS:g} s")
        if isinstance(exc, httpx.UnsupportedProtocol):
            return ConfigError(f"{self.address!r} is not the address of a farm; give a URL{self._where}")
        hint = (
            "" if str(self._client.base_url).startswith("https:") else "; if it speaks TLS, give its https:// address"
        )
        return EnvironmentError_(f"the connection to the farm at {self.address} failed: {str(exc).rstrip('.')}{hint}")


def _joined(path: tuple[str, ...]) -> str:
    for part in path:
        # a URL with these is that of another path
        if part in ("", ".", ".."):
            raise ConfigError(f"{part!r} is no name: nothing in a farm is called so")
    return "/".join(quote(part, safe="") for part in path)


def _messages(lines: Iterator[str]) -> Iterator[tuple[str, dict[str, Any]]]:
    """The JSON objects of an event stream (WHATWG HTML, 9.2.6), one for each message with data, and the last id."""
    data: list[str] = []
    last = ""
    for line in lines:
        if line.startswith("data:"):
            data.append(line[5:].removeprefix(" "))
        elif line.startswith("id:"):
            last = line[3:].removeprefix(" ")
        elif not line and data:
            found = json.loads("\n".join(data))
            data = []
            if isinstance(found, dict):
                yield last, found
