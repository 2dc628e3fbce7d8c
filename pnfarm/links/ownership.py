"""Ownership of interfaces: names and tags of those that a farm makes, and the lock that lets a farm run only once.

An interface is the farm's when its name has the farm's prefix *and* it carries the farm's tag as its
alias (``ip link`` shows it).  The tag is set a moment after the interface is made; for a run killed in
between, the interface group, which is set on creation, marks it.  Other interfaces are never touched.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import re
import socket
import struct
from typing import TYPE_CHECKING, Self
from urllib.parse import quote

from pnfarm.errors import ConfigError, EnvironmentError_

if TYPE_CHECKING:
    from pathlib import Path
    from types import TracebackType

__all__ = ["FarmLock", "bridge_name", "doomed_group_of", "group_of", "interface_prefix", "is_own", "tag"]

_ALIAS_OCTETS = 255  # IFALIASZ less the closing zero


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
    """

    def __init__(self, farm: str, state: Path | None = None) -> None:
        self._farm = farm
        self._state = state
        self._socket: socket.socket | None = None
        self._file: int | None = None

    def acquire(self) -> None:
        """Take both locks.  Raises :class:`~pnfarm.errors.EnvironmentError_` naming the process that has them."""
        if self._socket is not None:
            return
        try:
            self._socket = self._bind()
            if self._state is not None:
                self._file = self._lock_file(self._state)
        except BaseException:
            self.release()
            raise

    def _bind(self) -> socket.socket:
        name = b"\0pnfarm:" + hashlib.blake2b(self._farm.encode(), digest_size=16).hexdigest().encode()
        sock = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            sock.bind(name)
            sock.listen(128)  # never accepted from: connect() alone gives a peer this process's id
        except OSError as exc:
            sock.close()
            raise self._refused(_pid_behind(name)) from exc
        return sock

    def _lock_file(self, state: Path) -> int:
        path = state / f"{quote(self._farm, safe=' ')}.lock"
        try:
            state.mkdir(parents=True, exist_ok=True)
            fd = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        except OSError as exc:
            raise EnvironmentError_(f"state folder {state} cannot be written: {exc.strerror}") from exc
        try:
            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as exc:
            holder = os.read(fd, 32).decode(errors="replace").strip()
            os.close(fd)
            raise self._refused(int(holder) if holder.isdecimal() else None) from exc
        os.ftruncate(fd, 0)
        os.write(fd, f"{os.getpid()}\n".encode())
        return fd

    def _refused(self, pid: int | None) -> EnvironmentError_:
        who = f" (pid {pid})" if pid else ""
        return EnvironmentError_(
            f"farm {self._farm} is already running{who}: stop it first, or give this one another name"
        )

    def release(self) -> None:
        """Release both locks; harmless when none is held."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def __enter__(self) -> Self:
        self.acquire()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()


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
