"""The counted evidence of an injection."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["NOTHING", "Evidence"]


@dataclass(frozen=True, slots=True)
class Evidence:
    """Occurrences that were possible, those that happened, when (ns, None: never).

    ``confirmed``: it was seen on the wire.
    """

    checks: int = 0
    activations: int = 0
    first_ns: int | None = None
    last_ns: int | None = None
    confirmed: bool = False

    def __add__(self, other: Evidence) -> Evidence:
        firsts = [ns for ns in (self.first_ns, other.first_ns) if ns is not None]
        lasts = [ns for ns in (self.last_ns, other.last_ns) if ns is not None]
        return Evidence(
            self.checks + other.checks,
            self.activations + other.activations,
            min(firsts, default=None),
            max(lasts, default=None),
            self.confirmed or other.confirmed,
        )


NOTHING = Evidence()
