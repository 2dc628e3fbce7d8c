"""The model in Python of ``pnfarm bench plant``: twenty ports, written out as a user would."""

from __future__ import annotations

from typing import Any, ClassVar

__all__ = ["Twenty"]


class Twenty:
    """Ten inputs, and ten outputs that follow them."""

    inputs: ClassVar[dict[str, Any]] = {f"in_{i}": "revolutions" for i in range(10)}
    outputs: ClassVar[dict[str, Any]] = {f"out_{i}": float for i in range(10)}

    in_0: float
    in_1: float
    in_2: float
    in_3: float
    in_4: float
    in_5: float
    in_6: float
    in_7: float
    in_8: float
    in_9: float

    def __init__(self) -> None:
        self.out_0 = 0.0
        self.out_1 = 0.0
        self.out_2 = 0.0
        self.out_3 = 0.0
        self.out_4 = 0.0
        self.out_5 = 0.0
        self.out_6 = 0.0
        self.out_7 = 0.0
        self.out_8 = 0.0
        self.out_9 = 0.0

    def step(self, dt: float) -> None:
        """One step of so many seconds."""
        self.out_0 += dt * (self.in_0 - self.out_0)
        self.out_1 += dt * (self.in_1 - self.out_1)
        self.out_2 += dt * (self.in_2 - self.out_2)
        self.out_3 += dt * (self.in_3 - self.out_3)
        self.out_4 += dt * (self.in_4 - self.out_4)
        self.out_5 += dt * (self.in_5 - self.out_5)
        self.out_6 += dt * (self.in_6 - self.out_6)
        self.out_7 += dt * (self.in_7 - self.out_7)
        self.out_8 += dt * (self.in_8 - self.out_8)
        self.out_9 += dt * (self.in_9 - self.out_9)
