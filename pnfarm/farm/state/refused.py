"""What is raised for a state that this farm cannot have, and checks of its form."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.errors import ConfigError
from pnfarm.vocabulary.quoting import shown

if TYPE_CHECKING:
    from collections.abc import Collection

__all__ = ["RefusedStateError", "listed", "mapped"]

#: Characters of a sentence.
_LONGEST = 600


class RefusedStateError(ConfigError):
    """A state is damaged, of another farm file, or of another version; nothing was changed."""

    def __init__(self, why: str) -> None:
        text = " ".join(why.split())
        super().__init__(text if len(text) <= _LONGEST else f"{text[:_LONGEST]}...")


def mapped(value: Any, what: str, keys: Collection[str] | None = None) -> dict[str, Any]:
    """A mapping, with exactly these keys if any are given; raises :class:`RefusedStateError`."""
    if not isinstance(value, dict):
        raise RefusedStateError(f"{what} is {shown(value)}, not a mapping")
    if keys is not None and (odd := sorted({*value} ^ {*keys})):
        where = "missing" if odd[0] in keys else "unknown"
        raise RefusedStateError(f"{what}: {shown(odd[0])} is {where}")
    return value


def listed(value: Any, what: str, count: int) -> list[Any]:
    """A list of this length; raises :class:`RefusedStateError`."""
    if not isinstance(value, list) or len(value) != count:
        raise RefusedStateError(f"{what} is {shown(value)}, not a list of {count}")
    return value
