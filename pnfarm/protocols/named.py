"""Base of the states and events that tables of transitions have as keys."""

from __future__ import annotations

from enum import Enum

__all__ = ["Named"]


class Named(Enum):
    """Members are found in a table by identity: :class:`enum.Enum` hashes their names, in Python, at each look-up."""

    __hash__ = object.__hash__
