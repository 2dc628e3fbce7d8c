"""Records in non-volatile memory, with text keys."""

from __future__ import annotations

__all__ = ["record_word", "records_of"]


def record_word(key: tuple[int, int, int]) -> str:
    """(slot, subslot, index) as a key of the memory."""
    return ".".join(map(str, key))


def records_of(kept: dict[str, bytes] | None) -> dict[tuple[int, int, int], bytes]:
    """Records by (slot, subslot, index) from the memory; None means no records."""
    found = {}
    for word, data in (kept or {}).items():
        slot, subslot, index = map(int, word.split("."))
        found[slot, subslot, index] = data
    return found
