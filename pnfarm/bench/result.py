"""Figures of a benchmark: several windows of one measurement, the row that they make, and what a run's rows decide."""

from __future__ import annotations

import statistics
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from pnfarm.errors import InternalError

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

__all__ = ["WINDOWS", "Result", "Windows", "exit_code", "judged"]

#: A measurement is cut into so many windows; its figure is the median one, which a disturbance of three does not move.
WINDOWS = 8
#: Exit codes: a goal was missed, something could not be judged.
MISSED, INCONCLUSIVE = 1, 3


@dataclass(frozen=True, slots=True)
class Result:
    """One figure.  ``ratio_to_floor`` is None if there is no floor; ``ok``: ``value`` meets ``goal``.

    ``spread``: the lowest and the highest window, None where there was one.  ``beside_load``: cores that others used
    meanwhile, None where they used next to nothing; otherwise ``ok`` is None, because the row gives no verdict.
    """

    name: str
    value: float
    unit: str
    ratio_to_floor: float | None
    goal: str
    ok: bool | None
    spread: tuple[float, float] | None = None
    beside_load: float | None = None


class Windows:
    """The same figure in several windows of one measurement."""

    __slots__ = ("values",)

    def __init__(self, values: Iterable[float]) -> None:
        self.values = tuple(values)
        if not self.values:
            raise InternalError("a measurement without windows")

    @property
    def median(self) -> float:
        return statistics.median(self.values)

    @property
    def spread(self) -> tuple[float, float] | None:
        return (min(self.values), max(self.values)) if len(self.values) > 1 else None

    def over(self, floor: Windows) -> float:
        """Ratio of the medians; infinite over a floor of nothing."""
        return self.median / floor.median if floor.median else float("inf")

    def less(self, usual: float) -> Windows:
        """What each window has more than ``usual``."""
        return Windows(value - usual for value in self.values)

    def row(
        self, name: str, unit: str, ratio: float | None = None, goal: str = "none", ok: bool | None = True
    ) -> Result:
        return Result(name, self.median, unit, ratio, goal, ok, self.spread)


def judged(results: Sequence[Result], beside_load: float | None) -> list[Result]:
    """The rows of one benchmark, with the cores that others used meanwhile: beside load they give no verdict."""
    if beside_load is None:
        return list(results)
    return [replace(result, ok=None, beside_load=beside_load) for result in results]


def exit_code(results: Iterable[Result]) -> int:
    """1 if a goal was missed, otherwise 3 if one could not be judged, otherwise 0."""
    verdicts = [result.ok for result in results if result.goal != "none"]
    if any(ok is False for ok in verdicts):
        return MISSED
    return INCONCLUSIVE if any(ok is None for ok in verdicts) else 0
