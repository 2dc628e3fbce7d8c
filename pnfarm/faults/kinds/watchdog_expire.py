"""watchdog-expire: the drive's watchdog expires."""

from __future__ import annotations

from pnfarm.faults.effects.breaking import BreakingEffect
from pnfarm.faults.kind import EACH, InjectionKind

__all__ = ["KIND"]


class WatchdogExpire(BreakingEffect):
    """As if the controller's frames did not come."""

    def break_off(self, now: int) -> int:
        return self.connection.expire(now)


KIND = InjectionKind(
    "watchdog-expire",
    "connection",
    "The drive behaves as if its data hold timer had run out, although the controller's frames arrive: the "
    "connection ends (ERR-RTA-PDU), and the drive raises its fault of a lost connection.",
    "one broken connection; without `count` and `for` it happens once",
    WatchdogExpire,
    takes=EACH,
    place=90,
    wire="An ERR-RTA-PDU of the drive (its data hold timer), and its cyclic frames end.",
    reports="IO device failure (S7-1500: OB86; CODESYS: the device is shown as not running (assumed)). The diagnosis "
    "names an abort by the device.",
)
