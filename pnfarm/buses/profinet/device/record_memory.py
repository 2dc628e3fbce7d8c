"""Records in non-volatile memory: its keys are words."""

from __future__ import annotations

__all__ = ["record_word", "records_of"]


def record_word(key: tuple[int, int, int]) -> str:
    """(slot, subslot, index) as the memory has it."""
    return ".".join(map(str, key))


def records_of(kept: dict[str, bytes] | None) -> dict[tuple[int, int, int], bytes]:
    """Records by (slot, subslot, index), out of the memory; None is none."""
    found = {}
    for word, data in (kept or {}).items():
        slot, subslot, index = map(int, word.split("."))
        found[slot, subslot, index] = data
    return found
