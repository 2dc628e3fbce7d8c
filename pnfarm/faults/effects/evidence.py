"""The counted evidence of an injection."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["NOTHING", "Confirmation", "Evidence"]


class Confirmation(StrEnum):
    """What the farm itself has seen of an injection."""

    CONFIRMED = "confirmed"
    CONTRADICTED = "contradicted"
    INCONCLUSIVE = "inconclusive"


@dataclass(frozen=True, slots=True)
class Evidence:
    """Occurrences that were possible, those that happened, when (ns, None: never).

    ``confirmed``: it was seen on the wire.  ``contradicted`` says what was seen there instead, empty: nothing.
    """

    checks: int = 0
    activations: int = 0
    first_ns: int | None = None
    last_ns: int | None = None
    confirmed: bool = False
    contradicted: str = ""

    @property
    def confirmation(self) -> Confirmation:
        """Confirmed, contradicted, or neither."""
        if self.contradicted:
            return Confirmation.CONTRADICTED
        return Confirmation.CONFIRMED if self.confirmed else Confirmation.INCONCLUSIVE

    @property
    def reason(self) -> str:
        """Why it is not confirmed; empty when it is."""
        if self.contradicted or self.confirmed:
            return self.contradicted
        if self.activations:
            return "it happened, and nothing that left the drive since could show it"
        if self.checks:
            return f"it could have happened {self.checks} times, and did not"
        return "there was nothing yet that it could act on"

    def __add__(self, other: Evidence) -> Evidence:
        firsts = [ns for ns in (self.first_ns, other.first_ns) if ns is not None]
        lasts = [ns for ns in (self.last_ns, other.last_ns) if ns is not None]
        return Evidence(
            self.checks + other.checks,
            self.activations + other.activations,
            min(firsts, default=None),
            max(lasts, default=None),
            self.confirmed or other.confirmed,
            self.contradicted or other.contradicted,
        )

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "checks": self.checks,
            "activations": self.activations,
            "first_seconds": None if self.first_ns is None else self.first_ns / 1e9,
            "last_seconds": None if self.last_ns is None else self.last_ns / 1e9,
            "confirmed": self.confirmed,
            "confirmation": self.confirmation.value,
            "reason": self.reason,
        }

    @classmethod
    def from_dict(cls, seen: Mapping[str, Any]) -> Evidence:
        """What :meth:`as_dict` made."""
        first, last = (None if s is None else round(s * 1e9) for s in (seen["first_seconds"], seen["last_seconds"]))
        contradicted = seen["reason"] if seen["confirmation"] == Confirmation.CONTRADICTED else ""
        return cls(seen["checks"], seen["activations"], first, last, seen["confirmed"], contradicted)


NOTHING = Evidence()
