"""Signals that cannot be read or written, with the reason of each."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from pnfarm.errors import FieldsError
from pnfarm.vocabulary.problem import Problem

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.wire.value_types import Value

__all__ = ["SignalError", "all_or_none"]

_T = TypeVar("_T")


class SignalError(FieldsError):
    """The fields are signals."""


def all_or_none(values: Mapping[str, Value], check: Callable[[str, Value], _T]) -> dict[str, _T]:
    """What ``check`` makes of each; raises :class:`SignalError` with all that is wrong."""
    found: dict[str, _T] = {}
    refused = []
    for name, value in values.items():
        try:
            found[name] = check(name, value)
        except Problem as problem:
            refused.append((name, problem.what, problem.allowed))
        except SignalError as error:
            refused += error.issues
    if refused:
        raise SignalError(refused)
    return found
