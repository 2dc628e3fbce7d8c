"""A network namespace of one's own, also for an ordinary user: where ``pnfarm demo`` runs.

Inside, this process may make interfaces and raw sockets, and nothing of it is seen outside: the namespace and
every interface in it vanish with the last process. As root it is a private network namespace; as an ordinary
user a user namespace comes first, in which the user is root.

Namespaces belong to threads: enter before any thread exists (an import of NumPy may start some). Sources:
unshare(2), user_namespaces(7).
"""

from __future__ import annotations

import ctypes
import fcntl
import os
import socket
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from pnfarm.errors import EnvironmentError_, InternalError
from pnfarm.links.kernel.capabilities import SYS_ADMIN, has
from pnfarm.links.kernel.namespace_settings import remedy, why

__all__ = ["Sandbox", "enter_sandbox"]

_CLONE_NEWNS = 0x00020000
_CLONE_NEWUSER = 0x10000000
_CLONE_NEWNET = 0x40000000
_MS_NOSUID_NODEV_NOEXEC = 0x2 | 0x4 | 0x8
_MS_REC = 0x4000
_MS_PRIVATE = 1 << 18

_SIOCGIFFLAGS = 0x8913
_SIOCSIFFLAGS = 0x8914
_IFF_UP = 0x1

_libc = ctypes.CDLL(None, use_errno=True)


@dataclass(frozen=True, slots=True)
class Sandbox:
    """Where this process is now.  ``notes`` says what the machine did not allow and what that costs."""

    kind: Literal["user", "root"]
    notes: tuple[str, ...] = ()


def enter_sandbox() -> Sandbox:
    """Leave the machine's network for a private one, with loopback up.

    Raises :class:`~pnfarm.errors.EnvironmentError_` where the machine forbids it, :class:`~pnfarm.errors.InternalError`
    when threads exist already.
    """
    if len(list(Path("/proc/self/task").iterdir())) > 1:
        raise InternalError("a sandbox must be entered before threads start: enter it before importing the engine")
    kind: Literal["user", "root"] = "root" if has(SYS_ADMIN) else "user"
    if kind == "root":
        _unshare(_CLONE_NEWNET | _CLONE_NEWNS)
    else:
        uid, gid = os.geteuid(), os.getegid()
        _unshare(_CLONE_NEWUSER | _CLONE_NEWNET | _CLONE_NEWNS)
        _map_to_root(uid, gid)
    notes = _show_own_interfaces()
    _set_loopback_up()
    return Sandbox(kind, notes)


def _unshare(flags: int) -> None:
    if _libc.unshare(flags) == 0:
        return
    raise EnvironmentError_(f"a private network namespace could not be made: {why(ctypes.get_errno())}")


def _map_to_root(uid: int, gid: int) -> None:
    try:
        # user_namespaces(7): without this an unprivileged process may not write gid_map
        Path("/proc/self/setgroups").write_text("deny", encoding="utf-8")
        Path("/proc/self/uid_map").write_text(f"0 {uid} 1", encoding="utf-8")
        Path("/proc/self/gid_map").write_text(f"0 {gid} 1", encoding="utf-8")
    except OSError as exc:
        raise EnvironmentError_(
            f"the user namespace could not be set up ({exc.strerror}): run as root, or allow "
            "unprivileged user namespaces on this machine"
        ) from exc
    # Ubuntu 24.04 lets the namespace be made and then takes its capabilities away
    if not has(SYS_ADMIN):
        raise EnvironmentError_(f"the user namespace came without capabilities: {remedy()}")


def _mount(source: bytes, target: bytes, kind: bytes | None, flags: int) -> int:
    """0, or the error number."""
    return 0 if _libc.mount(source, target, kind, ctypes.c_ulong(flags), None) == 0 else ctypes.get_errno()


def _show_own_interfaces() -> tuple[str, ...]:
    """Mount /sys again: it shows the interfaces of the namespace it was mounted in."""
    code = _mount(b"none", b"/", None, _MS_REC | _MS_PRIVATE)
    code = code or _mount(b"sysfs", b"/sys", b"sysfs", _MS_NOSUID_NODEV_NOEXEC)
    if code:
        why = os.strerror(code)
        note = f"/sys still shows the machine's interfaces ({why}): tools that look there are misled, pnfarm is not"
        return (note,)
    return ()


def _set_loopback_up() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        request = struct.pack("16sH22x", b"lo", 0)
        try:
            flags = struct.unpack_from("H", fcntl.ioctl(sock, _SIOCGIFFLAGS, request), 16)[0]
            fcntl.ioctl(sock, _SIOCSIFFLAGS, struct.pack("16sH22x", b"lo", flags | _IFF_UP))
        except OSError as exc:
            raise EnvironmentError_(
                f"loopback could not be brought up in the private namespace: {exc.strerror}"
            ) from exc
