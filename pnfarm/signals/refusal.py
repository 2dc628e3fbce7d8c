"""Signals that cannot be read or written, with the reason of each."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["SignalError"]


class SignalError(ConfigError):
    """``issues`` are (signal, what is wrong, what is allowed)."""

    def __init__(self, issues: Sequence[tuple[str, str, str]]) -> None:
        self.issues = tuple(issues)
        super().__init__(
            "; ".join(
                f"{name}: {what}" + (f"; allowed: {allowed}" if allowed else "") for name, what, allowed in issues
            )
        )
