"""The model in Python of ``pnfarm bench plant``: twenty ports, and as many sums."""

from __future__ import annotations

from typing import Any, ClassVar

__all__ = ["Twenty"]


class Twenty:
    """Ten inputs, and ten outputs that follow them."""

    inputs: ClassVar[dict[str, Any]] = {f"in_{i}": "revolutions" for i in range(10)}
    outputs: ClassVar[dict[str, Any]] = {f"out_{i}": float for i in range(10)}

    def step(self, dt: float) -> None:
        """One step of so many seconds."""
        for i in range(10):
            value = getattr(self, f"out_{i}")
            setattr(self, f"out_{i}", value + dt * (getattr(self, f"in_{i}") - value))
