"""tcp-refuse: the drive does not listen."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.effects.effect import Effect, Tally, Window
from pnfarm.faults.effects.sockets import SOCKETS
from pnfarm.faults.kind import HELD, InjectionKind

if TYPE_CHECKING:
    from pnfarm.faults.effects.evidence import Evidence
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive

__all__ = ["KINDS"]


class TcpRefuse(Effect):
    """From begin to end, also over a reboot."""

    needs = (SOCKETS,)

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        self._sockets = drive.part(SOCKETS)
        self._tally = Tally()
        self._refusing = False

    def begin(self, window: Window, now: int) -> None:
        del window
        self._refusing = True
        self._sockets.refuse()
        # the listener is closed; who is refused, the drive never learns
        self._tally.note(now, confirmed=True)

    def end(self, now: int) -> None:
        del now
        if self._refusing:
            self._refusing = False
            self._sockets.accept()

    def evidence(self) -> Evidence:
        return self._tally.seen


KINDS = (
    InjectionKind(
        "tcp-refuse",
        "connection",
        "The drive does not listen any more: new TCP connections are refused; existing ones continue.",
        "closing the listener",
        TcpRefuse,
        takes=HELD,
        place=94,
        wire="Each SYN is answered by RST.",
        reports="A running connection stays. Without a session none can be made: the device stays failed.",
    ),
)
