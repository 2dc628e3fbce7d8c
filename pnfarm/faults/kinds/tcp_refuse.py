"""tcp-refuse: the drive does not listen."""

from __future__ import annotations

from pnfarm.faults.effects.effect import Effect
from pnfarm.faults.effects.sockets import SOCKETS
from pnfarm.faults.kind import HELD, InjectionKind

__all__ = ["KIND"]


class TcpRefuse(Effect):
    """From begin to end, also over a reboot."""

    sockets = SOCKETS

    def begin(self, now: int) -> None:
        self.sockets.refuse()
        # the listener is closed; who is refused, the drive never learns
        self.tally.note(now, confirmed=True)

    def take(self) -> None:
        self.sockets.accept()


KIND = InjectionKind(
    "tcp-refuse",
    "connection",
    "The drive stops listening: new TCP connections are refused; existing ones continue.",
    "closing the listener",
    TcpRefuse,
    takes=HELD,
    place=94,
    wire="Each SYN is answered by RST.",
    reports="A running connection stays. Without a session none can be made: the device stays failed.",
)
