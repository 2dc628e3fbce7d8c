"""Records in non-volatile memory, with text keys."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["record_words", "records_of"]


def record_words(records: Mapping[tuple[int, int, int], bytes]) -> dict[str, bytes]:
    """Records by (slot, subslot, index) as the memory has them."""
    return {".".join(map(str, key)): data for key, data in records.items()}


def records_of(kept: dict[str, bytes] | None) -> dict[tuple[int, int, int], bytes]:
    """Records by (slot, subslot, index) from the memory; None means no records."""
    found = {}
    for word, data in (kept or {}).items():
        slot, subslot, index = map(int, word.split("."))
        found[slot, subslot, index] = data
    return found
