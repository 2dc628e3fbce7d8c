"""How long the kernel takes to carry an octet of a serial line: its workers can stand while processes run on.

The octets of every tty, of an adapter as of a pty, wait in the kernel for a worker of one common queue.  A pty of the
farm's own goes the same way, so that what is late there was late on the line.
"""

from __future__ import annotations

import asyncio
import os
import tty
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["BY_TTY", "CarriedOctets"]

#: Kinds of lines whose octets go this way; those of a socket do not.
BY_TTY = frozenset({"pty", "port"})


class CarriedOctets:
    """``note`` gets the time at which an octet came and how long it was carried, ns; from the event loop.

    Raises :class:`OSError` where no pty can be opened.
    """

    def __init__(self, note: Callable[[int, int], None], clock: Callable[[], int]) -> None:
        self._note, self._clock = note, clock
        self._near, self._far = os.openpty()
        tty.setraw(self._far)
        os.set_blocking(self._near, False)
        #: When the octet was written that is under way; None: none is.
        self._sent_ns: int | None = None
        asyncio.get_running_loop().add_reader(self._far, self._arrived)

    def beat(self) -> None:
        """Send an octet; if one is under way still, note for how long."""
        if self._sent_ns is None:
            self._sent_ns = self._clock()
            os.write(self._near, b"-")
        else:
            self._came()

    def close(self) -> None:
        """Harmless when closed."""
        if self._near >= 0:
            asyncio.get_running_loop().remove_reader(self._far)
            os.close(self._near)
            os.close(self._far)
            self._near = -1

    def _arrived(self) -> None:
        os.read(self._far, 16)
        self._came()
        self._sent_ns = None

    def _came(self) -> None:
        now = self._clock()
        self._note(now, now - (now if self._sent_ns is None else self._sent_ns))
