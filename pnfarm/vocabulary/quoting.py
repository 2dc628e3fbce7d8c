"""How messages quote a user's input, and the known word that is closest to a misspelt one."""

from __future__ import annotations

import difflib
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

__all__ = ["did_you_mean", "few_hints", "printable", "shortened", "shown"]

#: A value longer than this is cut when a message quotes it.
_SHOWN = 60
#: Longer words are not compared: a comparison costs the word's length times that of every known word.
_WORD = 80
#: How many more words are compared with the known ones; None: no bound.
_hints: ContextVar[list[int] | None] = ContextVar("hints", default=None)


@contextmanager
def few_hints(most: int = 100) -> Iterator[None]:
    """Bounds how many words are compared with the known ones: 10,000 unknown words are reported in a second."""
    token = _hints.set([most])
    try:
        yield
    finally:
        _hints.reset(token)


def shortened(names: Sequence[str], most: int = 8, joint: str = " ") -> str:
    """Names for one line: the first ones, and how many more there are."""
    more = len(names) - most
    return joint.join(names[:most]) + (f" and {more} more" if more > 0 else "")


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """``"; did you mean X?"`` without the semicolon's sentence end, or ``""`` when nothing is near."""
    left = _hints.get()
    if len(word) > _WORD or (left is not None and left[0] <= 0):
        return ""
    if left is not None:
        left[0] -= 1
    candidates = list(known)
    folded = {candidate.lower(): candidate for candidate in candidates}
    near = difflib.get_close_matches(word.lower(), folded, n=1, cutoff=0.6)
    return f", did you mean {folded[near[0]]}?" if near else ""


def shown(value: object) -> str:
    """A value as a message quotes it: bounded, on one line, in the file's words."""
    match value:
        case None:
            return "nothing"
        case bool():
            return "true" if value else "false"
        case str():
            text = repr(value)
        case dict():
            return "a mapping" if value else "an empty mapping"
        case list():
            return "a list" if value else "an empty list"
        case _:
            text = str(value)
    return text if len(text) <= _SHOWN else text[: _SHOWN - 3] + "..."


def printable(text: str) -> str:
    """What a station says of itself, without what would control a terminal or end a line."""
    return text if text.isprintable() else "".join(letter if letter.isprintable() else "?" for letter in text)
