"""The fields of an injection that its effect reads: the fields of :class:`pnfarm.faults.plan.InjectionSpec`.

Why a type of its own: a kind names its effect, and an injection its kind; so an effect must not need the injection's
class.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol, Self

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.wire.direction import Direction

__all__ = ["InjectionFields", "NamedKind"]


class NamedKind(Protocol):
    """What an effect reads of its kind."""

    @property
    def name(self) -> str: ...


class InjectionFields(Protocol):
    """Times are nanoseconds; None is a field that was left out."""

    @property
    def kind(self) -> NamedKind: ...

    @property
    def params(self) -> Mapping[str, Any]:
        """The kind's parameters as they were given."""

    @property
    def probability(self) -> float | None: ...
    @property
    def seed(self) -> int | None: ...
    @property
    def count(self) -> int | None: ...
    @property
    def for_ns(self) -> int | None: ...
    @property
    def cycles(self) -> int | None: ...

    @property
    def directions(self) -> tuple[Direction, ...]:
        """Those in force; empty for a kind that has none."""

    def without(self, *fields: str) -> Self:
        """A copy without these fields."""

    def limited_to(self, count: int) -> Self:
        """A copy with this ``count``."""

    def values(self) -> dict[str, Any]:
        """Every parameter of the kind as its effect uses it: given, preset or default."""
