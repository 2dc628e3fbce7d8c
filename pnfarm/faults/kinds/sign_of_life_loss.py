"""sign-of-life-loss: shorthand for sign-of-life-freeze."""

from __future__ import annotations

from dataclasses import replace

from pnfarm.faults.kinds import sign_of_life_freeze

__all__ = ["KIND"]

KIND = replace(
    sign_of_life_freeze.KIND,
    name="sign-of-life-loss",
    doc="The sign of life freezes: sign-of-life-freeze.",
    place=30,
)
