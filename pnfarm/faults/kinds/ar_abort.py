"""ar-abort: the drive aborts the connection."""

from __future__ import annotations

from pnfarm.faults.effects.breaking import BreakingEffect
from pnfarm.faults.kind import EACH, InjectionKind

__all__ = ["KIND"]


class ArAbort(BreakingEffect):
    """As its bus does, with a code where the bus has one."""

    def break_off(self, now: int) -> int:
        return self.connection.abort(self.values.get("code", 0), now)


KIND = InjectionKind(
    "ar-abort",
    "connection",
    "The drive aborts the connection, in the way of its bus.",
    "one broken connection; without `count` and `for` it happens once",
    ArAbort,
    takes=EACH,
    place=10,
    wire="The drive's cyclic frames end; before them, its bus's message that ends a connection, if it has one.",
    reports="IO device failure (S7-1500: OB86; CODESYS: the device is shown as not running (assumed)). The device "
    "comes back.",
)
