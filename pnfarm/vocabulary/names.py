"""Names that users give: of faults, traces, saved states and scenarios."""

from __future__ import annotations

import re
from typing import TypeGuard

__all__ = ["PATTERN", "is_name"]

#: Of a whole name, for schemas.
PATTERN = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$"


def is_name(value: object) -> TypeGuard[str]:
    return isinstance(value, str) and re.fullmatch(PATTERN, value) is not None
