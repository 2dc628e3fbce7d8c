"""The small grammars inside GSDML attributes: value lists, token lists, octet lists.

A value list names numbers and ranges, ``0..4 7 9``; a token list separates words by semicolons, ``Legacy;Advanced``;
octets stand as ``0x01,0xFF``.  Parsers raise :class:`ValueError` with what would be right.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

__all__ = ["Numbers", "emit_octets", "emit_tokens", "parse_number", "parse_octets", "parse_tokens"]

#: Ranges of one value list; real files stay below a hundred.
MAX_RANGES = 4096
_NUMBER = re.compile(r"0[xX][0-9a-fA-F]{1,16}|[0-9]{1,20}")


def parse_number(text: str, maximum: int) -> int:
    """An unsigned number, decimal or with 0x, up to ``maximum``."""
    word = text.strip()
    if _NUMBER.fullmatch(word):
        value = int(word, 16) if word[:2] in {"0x", "0X"} else int(word)
        if value <= maximum:
            return value
    raise ValueError(f"a number from 0 to {maximum}, decimal or with 0x")


@dataclass(frozen=True, slots=True)
class Numbers:
    """A set of unsigned numbers as ascending ranges (first, last) that do not touch: a range costs nothing, however
    long it is."""

    ranges: tuple[tuple[int, int], ...] = ()

    @classmethod
    def of(cls, values: Iterable[int]) -> Numbers:
        """The set of these numbers."""
        return cls.join((value, value) for value in values)

    @classmethod
    def join(cls, ranges: Iterable[tuple[int, int]]) -> Numbers:
        """The union of ranges in any order."""
        joined: list[tuple[int, int]] = []
        for first, last in sorted(ranges):
            if joined and first <= joined[-1][1] + 1:
                joined[-1] = (joined[-1][0], max(last, joined[-1][1]))
            else:
                joined.append((first, last))
        return cls(tuple(joined))

    @classmethod
    def parse(cls, text: str, maximum: int) -> Numbers:
        """A value list such as ``0..4 7 9``."""
        words = text.split()
        ranges = []
        for word in words[: MAX_RANGES + 1]:
            low, dots, high = word.partition("..")
            try:
                first = parse_number(low, maximum)
                last = parse_number(high, maximum) if dots else first
            except ValueError:
                first, last = 1, 0
            if first > last:
                raise ValueError(f"numbers up to {maximum} and rising ranges, such as 0..4 7 9")
            ranges.append((first, last))
        if len(ranges) > MAX_RANGES:
            raise ValueError(f"at most {MAX_RANGES} numbers and ranges")
        return cls.join(ranges)

    def emit(self) -> str:
        return " ".join(f"{first}..{last}" if last > first else str(first) for first, last in self.ranges)

    def __contains__(self, value: int) -> bool:
        return any(first <= value <= last for first, last in self.ranges)

    def __iter__(self) -> Iterator[int]:
        for first, last in self.ranges:
            yield from range(first, last + 1)

    def __len__(self) -> int:
        return sum(last - first + 1 for first, last in self.ranges)


def parse_tokens(text: str) -> tuple[str, ...]:
    """The words of a token list, in its order."""
    return tuple(word.strip() for word in text.split(";") if word.strip())


def emit_tokens(tokens: Iterable[str]) -> str:
    return ";".join(tokens)


def parse_octets(text: str) -> bytes:
    """Octets such as ``0x01,0xFF``."""
    words = [word.strip() for word in text.split(",")]
    if words == [""]:
        return b""
    try:
        return bytes(parse_number(word, 0xFF) for word in words)
    except ValueError:
        raise ValueError("octets such as 0x01,0xFF") from None


def emit_octets(data: bytes) -> str:
    return ",".join(f"0x{octet:02X}" for octet in data)
