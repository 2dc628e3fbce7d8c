"""Effects on frames: lost or changed, cyclic ones by the engine, acyclic ones by the gate."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar

from pnfarm.faults.effects.connection import CONNECTION
from pnfarm.faults.effects.effect import POLL_NS, Effect, Window, seed_of
from pnfarm.faults.effects.evidence import NOTHING, Evidence
from pnfarm.faults.effects.wire import WIRE, Impairing
from pnfarm.faults.gate.choice import Choice
from pnfarm.faults.gate.frame_words import check_word
from pnfarm.faults.gate.gate import EVERY_FRAME, GateRule
from pnfarm.table.impairment import LOSS

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.wire import Wire
    from pnfarm.faults.gate.gate import FrameClasses
    from pnfarm.wire.direction import Direction

__all__ = ["ChosenFramesEffect", "Frames", "FramesEffect"]


@dataclass(eq=False)
class Frames:
    """Rows of the engine and a rule of the gate that act together on one drive's frames.

    ``cyclic`` is the action on cyclic frames (:mod:`pnfarm.table.impairment`, None: none) with its ``settings`` for
    each direction, ``acyclic`` the classes of acyclic frames (None: none), which a ``rule`` of the gate loses or
    changes.  Frames are chosen by ``choice``; without one, each with the injection's probability.
    """

    spec: InjectionFields
    drive: str
    wire: Wire
    directions: tuple[Direction, ...]
    cyclic: int | None = LOSS
    acyclic: FrameClasses | None = EVERY_FRAME
    settings: Callable[[Direction], Mapping[str, float]] = lambda _: {}
    choice: Choice | None = None
    rule: Callable[..., GateRule] = GateRule
    _rows: dict[int, Direction] = field(default_factory=dict)
    _gated: GateRule | None = None
    _done: Evidence = NOTHING
    _after: int = 0

    def begin(self, window: Window) -> None:
        probability = 1.0 if self.spec.probability is None else self.spec.probability
        choice = self.choice or Choice(start=probability)
        seed = seed_of(self.spec, self.drive)
        self._after = window.after
        try:
            for index, direction in enumerate(self.directions if self.cyclic is not None else ()):
                impairing = Impairing(
                    choice.start,
                    seed + index,
                    self.spec.count or 0,
                    window,
                    {**choice.settings(), **self.settings(direction)},
                )
                self._rows[self.wire.impair(direction, self.cyclic or 0, impairing)] = direction
            if self.spec.count and len(self._rows) == 2:
                self.wire.share_limit(*self._rows)
        except BaseException:
            self.end()
            raise
        if self.acyclic is not None:
            self._gated = self.rule(
                self.directions,
                self.acyclic,
                choice=choice,
                seed=seed + 16,
                count=self.spec.count or 0,
                stop_ns=window.stop_ns,
                armed=self._armed,
                spent=self._spent,
                lost=self._gate_lost,
            )
            self.wire.gate(self._gated)

    def _spent(self) -> int:
        """Cyclic frames that the engine acted on."""
        return sum(self.wire.impairment(row).activations for row in self._rows)

    def _gate_lost(self) -> None:
        """An acyclic frame was lost: subtract it from the rest of ``count`` for the cyclic ones."""
        if self.spec.count and self._gated is not None:
            for number in self._rows:
                self.wire.set_limit(number, self.spec.count - self._gated.evidence().activations)

    def _armed(self) -> bool:
        """The engine has let the healthy frames pass."""
        return not self._after or any(self.wire.impairment(row).checks > self._after for row in self._rows)

    def end(self) -> None:
        rows, self._rows = self._rows, {}
        for number in rows:
            self._done += self.wire.unimpair(number)
        if self._gated is not None:
            self.wire.ungate(self._gated)
            self._done += self._gated.evidence()
            self._gated = None

    def evidence(self) -> Evidence:
        seen = self._done
        for number in self._rows:
            seen += self.wire.impairment(number)
        return seen if self._gated is None else seen + self._gated.evidence()

    @property
    def waiting(self) -> int:
        """Frames that are held at present."""
        waiting = sum(self.wire.waiting(number) for number in self._rows)
        return waiting if self._gated is None else waiting + self._gated.waiting

    @property
    def remaining(self) -> int:
        """Occurrences left of ``count``; 1 without such a limit."""
        if self.spec.count is None:
            return 1
        return self.spec.count - self.evidence().activations


class FramesEffect(Effect):
    """Frames are lost or changed from start to end."""

    wire = WIRE
    connection = CONNECTION
    #: As for :class:`Frames`.
    cyclic: ClassVar[int | None] = LOSS
    acyclic: ClassVar[FrameClasses | None] = EVERY_FRAME
    #: Further fields of the engine's row (:mod:`pnfarm.table.impairment`), each with the parameter that it has.
    row: ClassVar[Mapping[str, str]] = MappingProxyType({})

    def prepare(self) -> None:
        check_word(self.values.get("frames", "all"), self.drive.name, self.wire.classes)
        self._cyclic, acyclic = self.acts_on()
        self._frames = Frames(
            self.spec,
            self.drive.name,
            self.wire,
            self.spec.directions,
            cyclic=self._cyclic,
            acyclic=acyclic,
            settings=self.settings,
            choice=self.choice(),
            rule=self.rule,
        )
        self.counts_frames = self._cyclic is not None

    def acts_on(self) -> tuple[int | None, FrameClasses | None]:
        """``cyclic`` and ``acyclic`` of this injection."""
        return self.cyclic, self.acyclic

    def settings(self, direction: Direction) -> dict[str, float]:
        """Further fields of the engine's row for one direction."""
        del direction
        return self.fields()

    def fields(self) -> dict[str, float]:
        """The same, if they are those of both directions."""
        return {field: self.values[param] for field, param in self.row.items()}

    def choice(self) -> Choice | None:
        """How frames are chosen; None: each with the probability of the injection."""
        return None

    def rule(self, *args: Any, **fields: Any) -> GateRule:
        """The rule of the gate for acyclic frames."""
        return GateRule(*args, **fields)

    def begin(self, now: int) -> None:
        self._frames.begin(self.window)
        self.check(now)

    def check(self, now: int) -> None:
        self._due = None
        if self.spec.count is None:
            return
        remaining = self._frames.remaining
        # ending earlier would let the last ones go on before their time
        self.finished = remaining <= 0 and not self._frames.waiting
        connection = self.connection.now()
        if not self.finished and connection is not None and self._cyclic is not None:
            self._due = now + max(1, remaining) * connection.cycle_ns
        elif not self.finished:
            self._due = now + POLL_NS

    def take(self) -> None:
        self._frames.end()

    def evidence(self) -> Evidence:
        return self._frames.evidence()


class ChosenFramesEffect(FramesEffect):
    """None of them, unless a subclass says which."""

    cyclic: ClassVar[int | None] = None
    acyclic: ClassVar[FrameClasses | None] = None
