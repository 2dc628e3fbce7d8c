"""Effects that pull the cable and plug it in again."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from pnfarm.faults.effects.effect import Effect, Tally, Window
from pnfarm.faults.effects.frames import Frames
from pnfarm.faults.effects.wire import WIRE

if TYPE_CHECKING:
    from pnfarm.faults.effects.effect import Needs
    from pnfarm.faults.effects.evidence import Evidence
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive

__all__ = ["CableEffect"]


class CableEffect(Effect):
    """While the cable is out, every frame is lost as well: a link may take a while to drop the carrier."""

    needs: ClassVar[Needs] = (WIRE,)

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        self._wire = drive.part(WIRE)
        self._tally = Tally()
        self._frames: Frames | None = None
        self._due: int | None = None

    def begin(self, window: Window, now: int) -> None:
        del window
        self._pull(now)

    @property
    def _is_out(self) -> bool:
        return self._frames is not None

    def _pull(self, now: int) -> None:
        spec = self.spec.without("count")
        frames = Frames(spec, self.drive.name, self._wire, ("out", "in"))
        frames.begin(Window())
        self._frames = frames
        self._wire.pull_cable()
        self._tally.note(now)

    def _plug(self) -> None:
        if self._frames is not None:
            self._wire.plug_cable()
            self._frames.end()
            self._frames = None

    def _look(self) -> bool:
        """Whether the cable is out and the link has confirmed it."""
        confirmed = self._is_out and self._wire.carrier_off
        if confirmed:
            self._tally.confirm()
        return confirmed

    def end(self, now: int) -> None:
        del now
        self._plug()
        self._due = None

    def evidence(self) -> Evidence:
        return self._tally.seen

    def next_deadline(self) -> int | None:
        return self._due
