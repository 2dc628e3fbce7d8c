"""Effects that pull the cable and plug it in again."""

from __future__ import annotations

from pnfarm.faults.effects.effect import Effect, Window
from pnfarm.faults.effects.frames import Frames
from pnfarm.faults.effects.wire import WIRE

__all__ = ["CableEffect"]


class CableEffect(Effect):
    """While the cable is out, every frame is lost as well: a link may take a while to drop the carrier."""

    wire = WIRE
    _frames: Frames | None = None

    def begin(self, now: int) -> None:
        self._pull(now)

    @property
    def _is_out(self) -> bool:
        return self._frames is not None

    def _pull(self, now: int) -> None:
        frames = Frames(self.spec.without("count"), self.drive.name, self.wire, ("out", "in"))
        frames.begin(Window())
        self._frames = frames
        self.wire.pull_cable()
        self.tally.note(now)

    def _plug(self) -> None:
        if self._frames is not None:
            self.wire.plug_cable()
            self._frames.end()
            self._frames = None

    def _look(self) -> bool:
        """Whether the cable is out and the link has confirmed it."""
        confirmed = self._is_out and self.wire.carrier_off
        if confirmed:
            self.tally.confirm()
        return confirmed

    def take(self) -> None:
        self._plug()
        self._due = None
