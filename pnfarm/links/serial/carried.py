"""How long the kernel takes to carry an octet of a serial line: its workers can stall while processes run.

The octets of every tty, of an adapter as of a pty, wait in the kernel for a worker of one common queue.  A pty of the
farm's own goes the same way, so that what is late there was late on the line.
"""

from __future__ import annotations

import asyncio
import os
import tty
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["BY_TTY", "CarriedOctets"]

#: Kinds of lines whose octets go this way; those of a socket do not.
BY_TTY = frozenset({"pty", "port"})


class Delays(Protocol):
    """Where delays are noted: ``due_ns`` is when the octet under way was sent, 0 without one."""

    due_ns: int

    def note(self, now: int, late_ns: int) -> None:
        """An octet came at ``now``, or has not come yet, which was carried for ``late_ns``."""


class CarriedOctets:
    """``delays`` has the time at which an octet came and how long it was carried, and when one under way was due.

    Raises :class:`OSError` where no pty can be opened.
    """

    def __init__(self, delays: Delays, clock: Callable[[], int]) -> None:
        self._delays, self._clock = delays, clock
        self._near, self._far = os.openpty()
        tty.setraw(self._far)
        os.set_blocking(self._near, False)
        asyncio.get_running_loop().add_reader(self._far, self._arrived)

    def beat(self) -> None:
        """Send an octet; if one is under way still, note for how long."""
        now = self._clock()
        if self._delays.due_ns:
            self._delays.note(now, now - self._delays.due_ns)
        else:
            self._delays.due_ns = now
            os.write(self._near, b"-")

    def close(self) -> None:
        """Harmless when closed."""
        if self._near >= 0:
            asyncio.get_running_loop().remove_reader(self._far)
            os.close(self._near)
            os.close(self._far)
            self._near = -1

    def _arrived(self) -> None:
        os.read(self._far, 16)
        now = self._clock()
        self._delays.note(now, now - self._delays.due_ns)
        self._delays.due_ns = 0
