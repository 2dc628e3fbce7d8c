"""baud-change: the line has another rate for one slave."""

from __future__ import annotations

from pnfarm.buses.profibus.faults.slave_effect import SlaveEffect
from pnfarm.faults.kind import HELD, InjectionKind

__all__ = ["KIND"]


class BaudChange(SlaveEffect):
    """Confirmed once the slave is out of its data exchange."""

    what = "deaf"

    def seen(self) -> int:
        return 0 if self.slave.exchanging else 1


KIND = InjectionKind(
    "baud-change",
    "link",
    "The slave has another baud rate than the line: it receives only garbage, and searches the rate again.",
    "the change",
    BaudChange,
    takes=HELD,
    place=60,
    wire="No answer of the slave; at the end it finds the rate, and is parametrised again.",
    reports="S7-300/400: station failure (OB86); CODESYS: the slave is not running (assumed).",
)
