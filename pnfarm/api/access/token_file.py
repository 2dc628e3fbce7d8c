"""A file of tokens, one a line: name, role, when it expires, and the SHA-256 of its secret.

::

    # name  role    expires                secret
    ci      inject  2027-01-31T00:00:00Z   sha256:9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08
    wall    read    never                  sha256:60303ae22b998861bce3b28f33eec1be758a213c86c93c076dbe9f558c11c752

Who reads the file learns no secret: these are random, and too long to be guessed.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import re
import secrets
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from typing import TYPE_CHECKING

import structlog

from pnfarm.api.access.watched_files import WatchedFiles
from pnfarm.errors import ConfigError, EnvironmentError_
from pnfarm.vocabulary.quoting import shown
from pnfarm.vocabulary.regular_file import read_regular
from pnfarm.vocabulary.whole_files import write_whole
from pnfarm.web.roles import Role

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

__all__ = ["NEVER", "Holder", "TokenFile", "add_token", "digest_of", "moment", "read_tokens", "remove_tokens"]

#: Octets of the file, and tokens in it.
MOST_OCTETS, MOST_TOKENS = 262_144, 1000
NEVER = "never"
#: Names of what is not in the file.
RESERVED = frozenset({"token", "read_token", "loopback", "anybody"})
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._@-]{0,63}")
_SECRET = re.compile(r"sha256:([0-9a-fA-F]{64})")
_HEADER = "# name  role  expires  secret; `pnfarm token add` adds a line\n"

logger = structlog.get_logger("pnfarm.api")


@dataclass(frozen=True, slots=True)
class Holder:
    """Who shows a token; ``ends`` is in seconds since 1970, None for never."""

    name: str
    role: Role
    digest: bytes
    ends: float | None = None

    @property
    def until(self) -> str:
        """When it expires, as the file has it."""
        return NEVER if self.ends is None else f"{datetime.fromtimestamp(self.ends, UTC):%Y-%m-%dT%H:%M:%SZ}"


def digest_of(secret: str) -> bytes:
    """What is kept of a secret."""
    return hashlib.sha256(secret.encode(errors="surrogateescape")).digest()


def new_secret() -> str:
    """Of 256 random bits; the prefix lets scanners of repositories find one that was left there."""
    return f"pnfarm_{secrets.token_urlsafe(32)}"


def _lines(text: str) -> Iterator[tuple[int, list[str]]]:
    for number, line in enumerate(text.splitlines(), 1):
        words = line.partition("#")[0].split()
        if words:
            yield number, words


def parse_tokens(text: str) -> list[Holder]:
    """Raises :class:`ValueError` with the first wrong line and what is wrong with it."""
    found: dict[str, Holder] = {}
    digests: set[bytes] = set()
    for number, words in _lines(text):
        try:
            holder = _holder(words)
            if holder.name in found:
                raise ValueError(f"a second token is called {holder.name}")
            if holder.digest in digests:
                raise ValueError(f"{holder.name} has the secret of another token")
        except ValueError as exc:
            raise ValueError(f"line {number}: {exc}") from exc
        found[holder.name] = holder
        digests.add(holder.digest)
        if len(found) > MOST_TOKENS:
            raise ValueError(f"it has more than {MOST_TOKENS} tokens")
    return list(found.values())


def _holder(words: list[str]) -> Holder:
    if len(words) != 4:
        raise ValueError("a line has four words: name, role, when it expires, sha256:HEX")
    name, role, until, secret = words
    check_name(name)
    if role not in set(Role):
        raise ValueError(f"there is no role {shown(role)}; there are {', '.join(Role)}")
    digest = _SECRET.fullmatch(secret)
    if digest is None:
        raise ValueError("the last word is not sha256: with 64 hexadecimal digits")
    return Holder(name, Role(role), bytes.fromhex(digest[1]), moment(until))


def check_name(name: str) -> None:
    """Raises :class:`ValueError` for a name that no token can have."""
    if not _NAME.fullmatch(name):
        raise ValueError(f"{shown(name)} is not a name: letters, digits and . _ @ -, at most 64")
    if name in RESERVED:
        raise ValueError(f"{name} is a name of pnfarm's own; give another one")


def moment(text: str) -> float | None:
    """In seconds since 1970, None for never; raises :class:`ValueError`."""
    if text == NEVER:
        return None
    try:
        found = datetime.fromisoformat(text)
        # a year that UTC does not have is no time either
        return (found if found.tzinfo is not None else found.replace(tzinfo=UTC)).astimezone(UTC).timestamp()
    except (ValueError, OverflowError) as exc:
        raise ValueError(f"{shown(text)} is not a time such as 2027-01-31T12:00:00Z, nor `never`") from exc


def read_tokens(path: Path) -> list[Holder]:
    """Raises :class:`ConfigError` for a file that cannot be read, or has a wrong line."""
    return parse(path, _text(path))


def parse(path: Path, text: str) -> list[Holder]:
    """As :func:`parse_tokens`; raises :class:`ConfigError` with the file's name."""
    try:
        return parse_tokens(text)
    except ValueError as exc:
        raise ConfigError(f"the tokens' file {path}: {exc}") from exc


def _text(path: Path) -> str:
    try:
        octets = read_regular(path, MOST_OCTETS + 1)
        if len(octets) > MOST_OCTETS:
            raise ConfigError(f"the tokens' file {path} has more than {MOST_OCTETS} octets")
        return octets.decode("utf-8")
    except FileNotFoundError as exc:
        raise ConfigError(
            f"the tokens' file {path} cannot be read: there is none; `pnfarm token add {path} NAME` makes it"
        ) from exc
    except (OSError, UnicodeError) as exc:
        why = (getattr(exc, "strerror", None) or str(exc)).lower()
        raise ConfigError(f"the tokens' file {path} cannot be read: {why}") from exc


def add_token(path: Path, name: str, role: Role, ends: float | None) -> str:
    """Add a line, in a new file where there is none; the secret, which is kept nowhere.

    Raises :class:`ConfigError` and :class:`EnvironmentError_`.
    """
    try:
        check_name(name)
    except ValueError as exc:
        raise ConfigError(str(exc)) from exc
    with _changing(path) as file:
        text = _text(file) if file.exists() else _HEADER
        if any(holder.name == name for holder in parse(path, text)):
            raise ConfigError(f"{path} has a token {name} already; `pnfarm token remove` takes it away")
        secret = new_secret()
        holder = Holder(name, role, digest_of(secret), ends)
        line = f"{name}  {role}  {holder.until}  sha256:{holder.digest.hex()}\n"
        changed = f"{text}{'' if text.endswith(chr(10)) or not text else chr(10)}{line}"
        parse(path, changed)
        _write(file, changed)
    return secret


def remove_tokens(path: Path, names: Iterable[str]) -> None:
    """Take their lines out; the others stay as they are.  Raises as :func:`add_token`."""
    with _changing(path) as file:
        text = _text(file)
        known = {holder.name for holder in parse(path, text)}
        wanted = set(names)
        if missing := sorted(wanted - known):
            raise ConfigError(f"{path} has no token {', '.join(missing)}; it has {', '.join(sorted(known)) or 'none'}")
        gone = {number for number, words in _lines(text) if words[0] in wanted}
        lines = text.splitlines(keepends=True)
        _write(file, "".join(line for number, line in enumerate(lines, 1) if number not in gone))


@contextmanager
def _changing(path: Path) -> Iterator[Path]:
    """The file itself, behind links; another change waits until this one is over, as both read and then write."""
    file = path.resolve()
    try:
        folder = os.open(file.parent, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except OSError as exc:
        raise EnvironmentError_(f"the folder of the tokens' file {path} cannot be opened: {_why(exc)}") from exc
    try:
        fcntl.flock(folder, fcntl.LOCK_EX)
        yield file
    finally:
        os.close(folder)


def _why(exc: OSError) -> str:
    return (exc.strerror or str(exc)).lower()


def _write(path: Path, text: str) -> None:
    try:
        write_whole({path: text.encode()}, None if path.exists() else 0o644)
    except OSError as exc:
        raise EnvironmentError_(f"the tokens' file {path} cannot be written: {_why(exc)}") from exc


class TokenFile:
    """The tokens of a file as it was at the last :meth:`follow`.

    While it cannot be read or has a wrong line, none of its tokens is taken, so that a line that somebody took out is
    not in force by mistake.  Raises :class:`ConfigError` for one that is wrong from the start.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = WatchedFiles([path], partial(read_tokens, path), self._renewed, self._failed)
        self.holders = self._file.first

    async def follow(self) -> None:
        """Check whether the file has changed."""
        await self._file.follow()

    def _renewed(self, holders: list[Holder]) -> None:
        self.holders = holders
        logger.info("tokens read again", file=str(self.path), tokens=len(holders))

    def _failed(self, reason: str) -> None:
        self.holders = []
        logger.warning("no token of the file is taken", reason=reason)
