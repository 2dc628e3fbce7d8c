"""The cyclic parameter channel (PKW): eight octets in front of a telegram, with the same layout in both directions.

Moog MSD manual 8.2.4, tables 8.11 to 8.13; PROFIdrive profile 2, "PKW mechanism".  Every number is big-endian.

======  ======  ===========================================================
octets  name    what
======  ======  ===========================================================
1, 2    PKE     identifier of task or answer (bits 12 to 15), PNU (0 to 11)
3       SUB     subindex
4       LEN     length, of strings only
5 to 8  PWE     value; one of 16 bits stands in the last two
======  ======  ===========================================================

Any eight octets are a task.
"""

from __future__ import annotations

from dataclasses import dataclass

from pnfarm.errors import DecodeError

__all__ = ["NO_TASK", "PARAMETER_TASKS", "PKW_OCTETS", "ParameterWords", "Pkw", "emit_pkw", "parse_pkw"]

PKW_OCTETS = 8
#: Highest number of a parameter that the channel reaches.
HIGHEST_PNU = 0xFFF


#: What a task may ask for, as ``tasks`` of :class:`ParameterWords` names it.
PARAMETER_TASKS = frozenset({
    "none", "read", "write-word", "write-double-word", "describe", "read-array", "write-array-word",
    "write-array-double-word", "cache-write", "cache-store", "cache-load", "cache-read", "-",
})  # fmt: skip


@dataclass(frozen=True, slots=True)
class ParameterWords:
    """The identifiers of one model's channel.

    ``tasks``: what each task identifier from 0 on asks for (:data:`PARAMETER_TASKS`), ``-`` for one without a meaning.
    The others are response identifiers; tasks on the cache are answered by their own.
    """

    tasks: tuple[str, ...]
    word: int
    double_word: int
    description: int
    array_word: int
    array_double_word: int
    error: int


@dataclass(frozen=True, slots=True)
class Pkw:
    """A task (``identifier`` 0..15 of table 8.14) or an answer (table 8.18); ``value`` is 32 bits without a sign."""

    identifier: int
    pnu: int = 0
    subindex: int = 0
    length: int = 0
    value: int = 0


#: Contents of the channel without a task, and of its answer.
NO_TASK = Pkw(0)


def parse_pkw(octets: bytes) -> Pkw:
    """What eight octets say; raises :class:`DecodeError` for another number of them."""
    if len(octets) != PKW_OCTETS:
        raise DecodeError("bad-length", f"{len(octets)} octets; a parameter channel has {PKW_OCTETS}")
    head = int.from_bytes(octets[:2], "big")
    return Pkw(head >> 12, head & HIGHEST_PNU, octets[2], octets[3], int.from_bytes(octets[4:], "big"))


def emit_pkw(pkw: Pkw) -> bytes:
    """The eight octets; raises :class:`ValueError` or :class:`OverflowError` for what does not fit in them."""
    if not 0 <= pkw.identifier <= 0xF or not 0 <= pkw.pnu <= HIGHEST_PNU:
        raise ValueError(f"identifier {pkw.identifier}, PNU {pkw.pnu}: at most 15 and {HIGHEST_PNU}")
    head = (pkw.identifier << 12 | pkw.pnu).to_bytes(2, "big")
    return head + bytes([pkw.subindex, pkw.length]) + pkw.value.to_bytes(4, "big")
