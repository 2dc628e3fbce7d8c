"""The model of a station of a capture by the numbers with which it identifies itself."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, TypeVar

from pnfarm.drives.catalogue import models_on

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.drives.description.model import Model

__all__ = ["models_by"]

_Numbers = TypeVar("_Numbers")


@cache
def models_by(bus: str, numbers_of: Callable[[Model], _Numbers]) -> dict[_Numbers, Model]:
    """The first model of a bus with each identity."""
    return {numbers_of(one): one for one in reversed(models_on(bus))}
