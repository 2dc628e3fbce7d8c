"""Errors about injections."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = ["InjectionError"]


class InjectionError(ConfigError):
    """An injection that cannot be put in force; one line for each wrong field."""

    def __init__(self, issues: Iterable[tuple[str, str, str]]) -> None:
        self.issues = tuple(issues)
        super().__init__(
            "\n".join(
                f"fault.{field}: {what}" + (f"; allowed: {allowed}" if allowed else "")
                for field, what, allowed in self.issues
            )
        )
