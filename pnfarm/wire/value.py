"""Values that are made for each frame.

The constructor of a frozen dataclass sets each field through ``object.__setattr__``, which takes twice as long as an
assignment: an eighth of the CPU with which a connection is set up.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeVar, dataclass_transform

__all__ = ["value_class"]

_T = TypeVar("_T")


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def value_class(kind: type[_T]) -> type[_T]:
    """A frozen dataclass with slots to the type checker; when it runs, nothing stops an assignment."""
    return dataclass(slots=True, unsafe_hash=True)(kind)
