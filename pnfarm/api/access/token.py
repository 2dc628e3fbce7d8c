"""The token that clients of a farm must send: given, read from a file, or generated.

A farm that listens beyond loopback always has one.  Where the farm file names a ``token_file``, or the farm has a
state folder, the token is generated at the first start and kept in that file, so that Prometheus and scripts
keep theirs over a restart.  Only its owner may read the file; in a folder with the set-group-id bit, the folder's
group may read it, too.
"""

from __future__ import annotations

import secrets
import stat
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.api.access.token_file import TokenFile
from pnfarm.errors import EnvironmentError_
from pnfarm.vocabulary.regular_file import read_regular
from pnfarm.vocabulary.whole_files import write_whole

if TYPE_CHECKING:
    from pathlib import Path

    from pnfarm.farm.file.reading import FarmConfig

__all__ = ["FarmToken", "token_of"]

#: Octets of a token file that are read; a token has at most 512.
MOST = 4096
_NEW = 24


@dataclass(frozen=True, slots=True)
class FarmToken:
    """``value`` None: no token is required.  ``file`` holds it; ``in_log`` is a new token without a file.

    ``read`` is the token whose holder may read only, if there is one; ``tokens`` are those of a file of their own.
    """

    value: str | None = None
    file: Path | None = None
    in_log: str | None = None
    read: str | None = None
    tokens: TokenFile | None = None


def token_of(config: FarmConfig) -> FarmToken:
    """The token of a farm's API; generates it, and its file, if there is none yet.

    Raises :class:`EnvironmentError_` for a file that cannot be read or written, or that holds no token, and
    :class:`ConfigError` for a file of tokens that cannot be used.
    """
    section = config.api
    if section is None:
        return FarmToken()
    tokens = None if section.tokens is None else TokenFile(config.beside(section.tokens))
    file = config.token_path
    if file is None:
        if section.token is not None or tokens is not None or not section.needs_token:
            return FarmToken(section.token, read=section.read_token, tokens=tokens)
        made = secrets.token_urlsafe(_NEW)
        return FarmToken(made, in_log=made, read=section.read_token)
    try:
        kept = _read(file)
        value = section.token or kept or secrets.token_urlsafe(_NEW)
        if value != kept:
            _write(file, value)
    except OSError as exc:
        why = (exc.strerror or str(exc)).lower()
        raise EnvironmentError_(
            f"the token's file {file}: {why}; set another token_file, or a token, under api:"
        ) from exc
    if value == section.read_token:
        raise EnvironmentError_(f"the token's file {file} holds the read_token, which may change nothing: remove it")
    return FarmToken(value, file, read=section.read_token, tokens=tokens)


def _read(file: Path) -> str | None:
    try:
        text = read_regular(file, MOST).decode("ascii", "replace").strip()
    except FileNotFoundError:
        return None
    if not 8 <= len(text) <= 512 or not all("!" <= letter <= "~" for letter in text):
        raise EnvironmentError_(
            f"the token's file {file} holds no token: 8 to 512 visible characters in one line; remove it for a new one"
        )
    return text


def _write(file: Path, value: str) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    shared = file.parent.stat().st_mode & stat.S_ISGID
    write_whole({file: f"{value}\n".encode("ascii")}, 0o640 if shared else 0o600)
