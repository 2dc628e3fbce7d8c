"""The arguments of a hub's command line, checked: addresses and tokens."""

from __future__ import annotations

import re

import httpx
from pydantic import ValidationError

from pnfarm.errors import ConfigError
from pnfarm.farm.file.sections import Api
from pnfarm.vocabulary.problem import Problem

__all__ = ["api_of", "name_of", "url_of"]

_HOST = r"(?:[A-Za-z0-9](?:[A-Za-z0-9._-]{0,251}[A-Za-z0-9])?|\[[0-9A-Fa-f:.]+\])"
_URL = re.compile(rf"(?:(https?)://)?({_HOST})(?::([0-9]{{1,5}}))?/?")
_NAME = re.compile(r"([A-Za-z0-9](?:[A-Za-z0-9._-]{0,251}[A-Za-z0-9])?):([0-9]{1,5})")
#: Of a farm's API, where a URL has none.
PORT = 8702


def url_of(text: str, *, secure: bool = False) -> str:
    """A shard's address as a URL without a path; ``secure``: https where it has no scheme.

    Raises :class:`ConfigError`.
    """
    found = _URL.fullmatch(text.strip())
    scheme, host, port = found.groups() if found is not None else ("", "", "")
    number = int(port) if port else PORT
    url = f"{scheme or ('https' if secure else 'http')}://{host.lower()}:{number}"
    if found is None or not 0 < number < 65536 or not _is_valid(url):
        raise ConfigError(f"--shard {text!r} is not the address of a farm; give a URL such as http://10.0.0.3:8702")
    return url


def _is_valid(url: str) -> bool:
    """Whether it can be asked: digits and dots may be no IP address."""
    try:
        httpx.URL(url)
    except httpx.InvalidURL:
        return False
    return True


def name_of(text: str) -> tuple[str, int]:
    """A name and the port of the farms behind it.  Raises :class:`ConfigError`."""
    found = _NAME.fullmatch(text.strip())
    if found is None or not 0 < int(found[2]) < 65536:
        raise ConfigError(f"--discover {text!r} is not a name with a port; give NAME:PORT such as tasks.farm:8702")
    return found[1], int(found[2])


def api_of(listen: str, token: str | None, read_token: str | None) -> Api:
    """As the section ``api`` of a farm file.  Raises :class:`ConfigError`."""
    given = {"listen": listen, "token": token, "read_token": read_token}
    try:
        return Api.model_validate({key: value for key, value in given.items() if value is not None})
    except ValidationError as exc:
        error = exc.errors(include_url=False)[0]
        flag = {"listen": "--api", "token": "--api-token", "read_token": "--api-read-token"}.get(
            str(error["loc"][0]) if error["loc"] else "", "--api"
        )
        problem = error.get("ctx", {}).get("error")
        what = f"{problem.what}; allowed: {problem.allowed}" if isinstance(problem, Problem) else error["msg"].lower()
        raise ConfigError(f"{flag}: {what}") from exc
