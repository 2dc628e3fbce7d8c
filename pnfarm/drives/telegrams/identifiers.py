"""Identifiers of Chk_Cfg by which a PROFIBUS master names a telegram."""

from __future__ import annotations

__all__ = ["profile_identifiers"]

#: Special format, outputs, inputs (EN 50170 part 2, 8.3.5).
_OUTPUTS, _INPUTS = 0x80, 0x40
#: In an octet of length: consistent as a whole, in words; the lowest six bits are their number less one.
_WHOLE_WORDS = 0xC0
#: The first of three octets after the lengths.
_STANDARD = 0xFD


def profile_identifiers(number: int, outputs: int, inputs: int) -> bytes:
    """The profile's for telegram ``number`` with so many words each way, at most 64.

    ``C3 C1 C1 FD 00 01`` is telegram 1 (PROFIdrive profile; Moog MSD manual, table 8.10).
    """
    lengths = [_WHOLE_WORDS | words - 1 for words in (outputs, inputs) if words]
    ways = (_OUTPUTS if outputs else 0) | (_INPUTS if inputs else 0)
    return bytes((ways | 3, *lengths, _STANDARD, number >> 8, number & 0xFF))
