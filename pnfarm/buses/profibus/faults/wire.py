"""A slave's drop of the line, as injections see it: every telegram passes the gate, cyclic ones as well."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from pnfarm.faults.effects.evidence import Evidence
from pnfarm.faults.effects.wire import Impairing, Wire
from pnfarm.faults.gate.choice import Choice
from pnfarm.faults.gate.gate import GateRule
from pnfarm.faults.gate.shaping import Shape
from pnfarm.table.impairment import ALWAYS, CORRUPT, DELAY, DUPLICATE, INDEPENDENT, LATE, LOSS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.faults.gate.gate import FrameClasses
    from pnfarm.wire.direction import Direction

__all__ = ["ACYCLIC", "CYCLIC", "LineWire"]

#: Classes of telegrams: Data_Exchange both ways, everything else.
CYCLIC: Final = "cyclic"
ACYCLIC: Final = "acyclic"


class _OnLine:
    """A rule as the gate of a line takes it: telegrams have no header that a fault leaves alone."""

    def __init__(self, rule: GateRule, classes: FrameClasses) -> None:
        self._rule = rule
        self.classes = classes

    @property
    def waiting(self) -> int:
        """Telegrams that wait, which the gate counts here."""
        return self._rule.waiting

    @waiting.setter
    def waiting(self, waiting: int) -> None:
        self._rule.waiting = waiting

    @property
    def shape(self) -> Shape | None:
        return self._rule.shape

    def loses(self, direction: Direction, frame_class: str, now: int) -> bool:
        return frame_class in self.classes and self._rule.loses(direction, frame_class, now)

    def left(
        self, direction: Direction, frame_class: str, frame: bytes, due: int, *, hit: bool, bare: bool = False
    ) -> list[tuple[int, bytes]]:
        del bare
        if frame_class not in self.classes:
            return [(due, frame)]
        return self._rule.left(direction, frame_class, frame, due, hit=hit, bare=True)


class _Acyclic:
    """What a rule acts on, without cyclic telegrams: those have rules of their own."""

    def __init__(self, classes: FrameClasses) -> None:
        self._classes = classes

    def __contains__(self, word: object) -> bool:
        return word != CYCLIC and word in self._classes


class _CyclicRule:
    """One rule for the cyclic telegrams of one direction, from its time and number of healthy telegrams on."""

    def __init__(self, rule: GateRule, start_ns: int, after: int) -> None:
        self.rule = rule
        self._start_ns = start_ns
        self._healthy = after
        self.passed = Evidence()

    def armed(self, now: int) -> bool:
        """Whether the present telegram is one that may be hit."""
        if now < self._start_ns:
            return False
        if self._healthy > 0:
            self._healthy -= 1
            self.passed += Evidence(1)
            return False
        return True


class _OnCyclic(_OnLine):
    def __init__(self, one: _CyclicRule) -> None:
        super().__init__(one.rule, frozenset({CYCLIC}))
        self._one = one

    def loses(self, direction: Direction, frame_class: str, now: int) -> bool:
        # a cycle has a telegram of either direction
        if frame_class != CYCLIC or direction not in self._one.rule.directions:
            return False
        return self._one.armed(now) and super().loses(direction, frame_class, now)


def _share(threshold: float) -> float:
    """A probability of the table's unit."""
    return 1.0 if threshold >= ALWAYS else threshold / 2**32


def _shape(kind: int, seed: int, settings: Mapping[str, float]) -> Shape | None:
    """What becomes of a cyclic telegram that is hit; None: it is lost."""
    whole = {key: int(value) for key, value in settings.items()}
    match kind:
        case kind if kind == LOSS:
            return None
        case kind if kind in {DELAY, LATE}:
            return Shape(seed, delay_ns=whole.get("delay_ns", 0), jitter_ns=whole.get("jitter_ns", 0))
        case kind if kind == DUPLICATE:
            return Shape(seed, copies=whole.get("amount", 1))
        case kind if kind == CORRUPT:
            return Shape(seed, bits=whole.get("amount", 1), whole=True)
    raise ValueError(f"a line has no impairment {kind}")


@dataclass(eq=False)
class LineWire(Wire):
    """See the module's docstring; numbers of its cyclic impairments are its own."""

    def __post_init__(self) -> None:
        self._acyclic_rules: dict[int, _OnLine] = {}
        self._cyclic_rules: dict[int, tuple[_CyclicRule, _OnCyclic]] = {}
        #: Occurrences that each may still have, of those that count; and what counts together with what.
        self._limits: dict[int, int] = {}
        self._counted: set[int] = set()
        self._shared: dict[int, int] = {}
        self._number = 0

    def in_force(self) -> list[Any]:
        return [*super().in_force(), *self._cyclic_rules.values()]

    def impair(self, direction: Direction, kind: int, how: Impairing) -> int:
        """See :meth:`Wire.impair`: the gate acts on cyclic telegrams, too."""
        given = dict(how.settings)
        choice = Choice(
            model=int(given.pop("model", INDEPENDENT)),
            start=how.probability,
            burst=int(given.pop("burst", 1)),
            **{key: _share(given.pop(key)) for key in ("enter", "leave", "hit_good", "hit_bad") if key in given},
        )
        self._number += 1
        number = self._number
        self._limits[number] = how.count
        if how.count:
            self._counted.add(number)
        rule = GateRule(
            (direction,),
            frozenset({CYCLIC}),
            seed=how.seed,
            stop_ns=how.window.stop_ns,
            armed=lambda: self._left(number) > 0,
            choice=choice,
            shape=_shape(kind, how.seed, given),
        )
        one = _CyclicRule(rule, how.window.start_ns, how.window.after)
        on_line = _OnCyclic(one)
        self._cyclic_rules[number] = one, on_line
        self._gate.add(self._port, on_line)  # type: ignore[arg-type]  # the gate asks no more of a rule
        return number

    def share_limit(self, one: int, other: int) -> None:
        self._shared |= {one: other, other: one}

    def set_limit(self, number: int, count: int) -> None:
        if number in self._limits:
            self._limits[number] = max(0, count)

    def _left(self, number: int) -> int:
        """Occurrences left of its count; 1 without one."""
        count = self._limits[number]
        if count == 0 and number not in self._counted:
            return 1
        used = sum(
            self._cyclic_rules[one][0].rule.evidence().activations
            for one in (number, self._shared.get(number))
            if one in self._cyclic_rules
        )
        return count - used

    def waiting(self, number: int) -> int:
        return self._cyclic_rules[number][1].waiting

    def impairment(self, number: int) -> Evidence:
        one, _ = self._cyclic_rules[number]
        return one.passed + one.rule.evidence()

    def unimpair(self, number: int) -> Evidence:
        seen = self.impairment(number)
        _, on_line = self._cyclic_rules.pop(number)
        self._gate.remove(self._port, on_line)  # type: ignore[arg-type]  # as above
        self._limits.pop(number)
        self._counted.discard(number)
        self._shared.pop(self._shared.pop(number, 0), None)
        return seen

    def gate(self, rule: GateRule) -> None:
        on_line = _OnLine(rule, _Acyclic(rule.classes))
        self._acyclic_rules[id(rule)] = on_line
        self._gate.add(self._port, on_line)  # type: ignore[arg-type]  # as above

    def ungate(self, rule: GateRule) -> None:
        self._gate.remove(self._port, self._acyclic_rules.pop(id(rule)))  # type: ignore[arg-type]  # as above
