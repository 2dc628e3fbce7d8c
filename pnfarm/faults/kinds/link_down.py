"""link-down: the cable is pulled."""

from __future__ import annotations

from pnfarm.faults.effects.cable import CableEffect
from pnfarm.faults.effects.effect import POLL_NS
from pnfarm.faults.kind import HELD, InjectionKind

__all__ = ["KIND"]


class LinkDown(CableEffect):
    """Once; checked until the link has confirmed it."""

    def begin(self, now: int) -> None:
        super().begin(now)
        self._due = now + POLL_NS

    def check(self, now: int) -> None:
        if self._look():
            self._due = None
        if self._due is not None and now >= self._due:
            self._due = now + POLL_NS


KIND = InjectionKind(
    "link-down",
    "link",
    "The cable is pulled: no carrier, no frame in or out.",
    "pulling the cable",
    LinkDown,
    takes=HELD,
    place=30,
    wire="No carrier at the drive's port: no frame in either direction.",
    reports="Port down at the switch; after the watchdog, IO device failure (S7-1500: OB86; CODESYS: the device is "
    "shown as not running (assumed)).",
)
