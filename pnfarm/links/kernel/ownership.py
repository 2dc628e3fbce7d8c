"""Ownership of interfaces: names and tags of those that a farm makes, and the lock that lets a farm run only once.

An interface is the farm's when its name has the farm's prefix *and* it carries the farm's tag as its
alias (``ip link`` shows it).  The tag is set a moment after the interface is made; for a run killed in
between, the interface group, which is set on creation, marks it.  Other interfaces are never touched.

A shard of a farm owns its interfaces under a name of its own (:func:`owner_of`): what another shard made is not its.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import re
import socket
import struct
from pathlib import Path
from typing import TYPE_CHECKING, Self
from urllib.parse import quote

from pnfarm.errors import ConfigError, EnvironmentError_

if TYPE_CHECKING:
    from collections.abc import Iterable
    from types import TracebackType

__all__ = [
    "FarmLock",
    "bridge_name",
    "doomed_group_of",
    "group_of",
    "interface_prefix",
    "is_own",
    "owner_of",
    "shards_in",
    "tag",
]

_ALIAS_OCTETS = 255  # IFALIASZ less the closing zero


#: Sockets of this network namespace.
_SOCKETS = Path("/proc/net/unix")


def owner_of(farm: str, shard: str = "") -> str:
    """The name under which a farm, or its shard ``I/N``, owns interfaces: no farm's or controller's has a slash."""
    return f"{farm} {shard}" if shard else farm


def shards_in(farm: str, aliases: Iterable[str]) -> list[str]:
    """The shards ``I/N`` of a farm that made interfaces with these aliases, in order."""
    head = re.escape(tag(farm, "").removesuffix(":"))
    found = {(int(m[2]), int(m[1])) for m in (re.match(rf"{head} (\d+)%2F(\d+):", alias) for alias in aliases) if m}
    return [f"{index}/{count}" for count, index in sorted(found)]


def interface_prefix(farm: str) -> str:
    """``pf<hash>``: six characters, the same for a farm's name on every machine."""
    return f"pf{hashlib.blake2b(farm.encode(), digest_size=2).hexdigest()}"


def bridge_name(farm: str) -> str:
    """The bridge that a farm makes for itself; its controller joins it by this name."""
    return f"{interface_prefix(farm)}-br"


def group_of(farm: str) -> int:
    """The farm's interface group: 29 bits of a digest under a bit that keeps it off small numbers."""
    digest = hashlib.blake2b(farm.encode(), digest_size=4, person=b"group").digest()
    return int.from_bytes(digest, "big") & 0x1FFFFFFF | 0x40000000


def doomed_group_of(farm: str) -> int:
    """The group into which interfaces are put to be removed at once; differs from every farm's own group."""
    return group_of(farm) ^ 0x60000000


def tag(farm: str, station: str) -> str:
    """The alias ``pnfarm:<farm>:<station>``; a colon in the farm's name is quoted, a long station is cut.

    Raises :class:`~pnfarm.errors.ConfigError` for a farm's name that leaves no room for a station.
    """
    head = f"pnfarm:{quote(farm, safe=' ')}:"
    if len(head) > _ALIAS_OCTETS - 32:
        raise ConfigError(
            f"the farm's name is too long to mark its interfaces with: at most 200 letters, has {len(farm)}"
        )
    return (head.encode() + station.encode())[:_ALIAS_OCTETS].decode(errors="ignore")


def is_own(farm: str, name: str, alias: str, group: int) -> bool:
    """Whether an interface with these marks was made by a farm of this name."""
    if re.fullmatch(rf"{interface_prefix(farm)}-\w+", name) is None:
        return False
    if alias:
        return alias.startswith(tag(farm, ""))
    return group in {group_of(farm), doomed_group_of(farm)}


class FarmLock:
    """Holds a farm's name while it runs; a second run of the same name is refused.

    Two locks, both dropped by the kernel when the process ends in whatever way: an abstract unix socket,
    whose scope is the network namespace like that of the interfaces, and (where a state folder is given) a
    lock on ``<state>/<farm>.lock``, which also holds for two containers that share the folder.

    With a ``shard`` ``I/N`` only this shard's name is held: beside it may run the others of the same N, and neither the
    whole farm nor shards of another N, which would have the same drives.
    """

    def __init__(self, farm: str, state: Path | None = None, *, shard: str = "") -> None:
        self._farm = farm
        self._state = state
        self._shard = shard
        self._socket: socket.socket | None = None
        self._files: list[int] = []

    def acquire(self) -> None:
        """Take all locks.  Raises :class:`~pnfarm.errors.EnvironmentError_` naming the process that has them."""
        if self._socket is not None:
            return
        try:
            self._socket = self._bind()
            if self._state is not None:
                self._lock_files(self._state)
        except BaseException:
            self.release()
            raise

    def _bind(self) -> socket.socket:
        common = "pnfarm:" + hashlib.blake2b(self._farm.encode(), digest_size=16).hexdigest()
        name = f"{common}:{self._shard}" if self._shard else common
        address = b"\0" + name.encode()
        sock = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            sock.bind(address)
            sock.listen(128)  # never accepted from: connect() alone gives a peer this process's id
        except OSError as exc:
            sock.close()
            raise self._refused(_pid_behind(address), self._shard) from exc
        # looked at once the own name is taken: of two that start at once, one at least sees the other
        for other in _names_from(common):
            shard = other.removeprefix(common).removeprefix(":")
            if other != name and self.excludes(shard):
                pid = _pid_behind(b"\0" + other.encode())
                sock.close()
                raise self._refused(pid, shard)
        return sock

    def excludes(self, other: str) -> bool:
        """Whether this one and another shard (or, empty, the whole farm) have drives in common."""
        return not (self._shard and other) or self._shard.partition("/")[2] != other.partition("/")[2]

    def _lock_files(self, state: Path) -> None:
        farm = quote(self._farm, safe=" ")
        try:
            state.mkdir(parents=True, exist_ok=True)
        except OSError as exc:
            raise EnvironmentError_(f"state folder {state} cannot be written: {exc.strerror}") from exc
        # all shards share the farm's own lock, which the whole farm would have alone
        self._lock_file(state / f"{farm}.lock", "", alone=not self._shard)
        if not self._shard:
            return
        self._lock_file(state / f"{farm} {quote(self._shard, safe='')}.lock", self._shard, alone=True)
        for path in sorted(state.glob("*%2F*.lock")):
            found = re.fullmatch(rf"{re.escape(farm)} (\d+)%2F(\d+)\.lock", path.name)
            if found is not None and self.excludes(other := f"{found[1]}/{found[2]}"):
                os.close(self._locked(path, other, alone=False))

    def _lock_file(self, path: Path, shard: str, *, alone: bool) -> None:
        fd = self._locked(path, shard, alone=alone)
        self._files.append(fd)
        # the former owner has ended
        os.ftruncate(fd, 0)
        if alone:
            os.write(fd, f"{os.getpid()}\n".encode())

    def _locked(self, path: Path, shard: str, *, alone: bool) -> int:
        try:
            fd = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        except OSError as exc:
            raise EnvironmentError_(f"state folder {path.parent} cannot be written: {exc.strerror}") from exc
        try:
            fcntl.flock(fd, (fcntl.LOCK_EX if alone else fcntl.LOCK_SH) | fcntl.LOCK_NB)
        except OSError as exc:
            holder = os.read(fd, 32).decode(errors="replace").strip()
            os.close(fd)
            raise self._refused(int(holder) if holder.isdecimal() else None, shard) from exc
        return fd

    def _refused(self, pid: int | None, shard: str) -> EnvironmentError_:
        """``shard``: the one that runs, empty for the whole farm."""
        who = f" (pid {pid})" if pid else ""
        what = f"shard {shard} of farm {self._farm}" if shard else f"farm {self._farm}"
        remedy = "or give this one another name" if shard == self._shard else "as it has drives of this one"
        return EnvironmentError_(f"{what} is already running{who}: stop it first, {remedy}")

    def release(self) -> None:
        """Release both locks; harmless when none is held."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None
        for fd in self._files:
            os.close(fd)
        self._files.clear()

    def __enter__(self) -> Self:
        self.acquire()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()


def _names_from(common: str) -> list[str]:
    """Abstract addresses in this network namespace that begin so.

    Raises :class:`~pnfarm.errors.EnvironmentError_` where the kernel does not report it.
    """
    try:
        lines = _SOCKETS.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError as exc:
        raise EnvironmentError_(f"{_SOCKETS} cannot be read, which lists what runs: {exc.strerror}") from exc
    names = (line.rpartition(" @")[2] for line in lines if f" @{common}" in line)
    return sorted(set(names))


def _pid_behind(name: bytes) -> int | None:
    """Process id of the listener at an abstract address, if it is known."""
    with contextlib.closing(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)) as sock:
        sock.setblocking(False)
        try:
            sock.connect(name)
            credentials = sock.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12)
        except OSError:  # gone in the meantime, or its queue is full
            return None
    pid, _uid, _gid = struct.unpack("iII", credentials)
    return int(pid) or None
