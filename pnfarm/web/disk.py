"""Calls that wait for a disk: one that does not answer holds up neither the event loop nor the end of the program."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import threading
from functools import partial
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["disk_call", "silent_disk"]

_T = TypeVar("_T")


def disk_call(work: Callable[[], _T], name: str) -> asyncio.Future[_T]:
    """Make a call in a thread of its own, for which the end of the program does not wait; what it returns or raises."""
    found: asyncio.Future[_T] = asyncio.get_running_loop().create_future()
    try:
        threading.Thread(target=_run, args=(work, found), name=name, daemon=True).start()
    except RuntimeError:
        found.set_exception(OSError(errno.EAGAIN, "the machine has no thread left"))
    return found


def _run(work: Callable[[], _T], found: asyncio.Future[_T]) -> None:
    try:
        told = partial(found.set_result, work())
    except BaseException as exc:  # noqa: BLE001 - whatever it is, it is raised where the call is awaited
        told = partial(found.set_exception, exc)
    # the loop may have ended
    with contextlib.suppress(RuntimeError):
        found.get_loop().call_soon_threadsafe(told)


def silent_disk(seconds: float) -> OSError:
    """For a call that took longer."""
    return OSError(errno.ETIMEDOUT, f"the disk has not answered for {seconds:g} s")
