"""What is wrong with a user's file: every place of it, with its line."""

from __future__ import annotations

import difflib
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pydantic_core import PydanticCustomError

from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

__all__ = ["FarmFileError", "FileIssue", "Location", "did_you_mean", "few_hints", "field_path", "problem", "shown"]

#: Where a value stands in a file: keys and list indexes from the root.
Location = tuple[str | int, ...]

#: A value longer than this is cut when a message quotes it.
_SHOWN = 60
#: A longer word resembles nothing known: the comparison costs its length times that of every known word.
_WORD = 80
#: How many more words are compared with the known ones; None: no bound.
_hints: ContextVar[list[int] | None] = ContextVar("hints", default=None)


@dataclass(frozen=True, slots=True)
class FileIssue:
    """One thing wrong: ``line`` and ``column`` count from 1; 0 means the whole file, or a setting from outside it."""

    path: str
    line: int
    column: int
    field: str
    what: str
    allowed: str = ""

    def __str__(self) -> str:
        place = f"{self.path}:{self.line}" if self.line else self.path
        field = f" {self.field}:" if self.field else ""
        allowed = f"; allowed: {self.allowed}" if self.allowed else ""
        return f"{place}:{field} {self.what}{allowed}"


class FarmFileError(ConfigError):
    """A farm file, and the files that it names, with everything that is wrong, file by file, one line each."""

    def __init__(self, issues: Iterable[FileIssue]) -> None:
        found = list(issues)
        files = {path: place for place, path in enumerate(dict.fromkeys(issue.path for issue in found))}
        self.issues: Sequence[FileIssue] = tuple(
            sorted(found, key=lambda issue: (files[issue.path], issue.line, issue.column))
        )
        super().__init__("\n".join(map(str, self.issues)))


def problem(what: str, allowed: str = "") -> PydanticCustomError:
    """An error that a validator raises: said to the user as it stands here."""
    # the text goes in as a value, because pydantic reads braces in a template
    return PydanticCustomError("pnfarm", "{what}", {"what": what, "allowed": allowed})


def field_path(location: Location) -> str:
    """``("drives", 0, "load")`` as a person writes it: ``drives[0].load``."""
    text = ""
    for step in location:
        if isinstance(step, int):
            text += f"[{step}]"
        else:
            text += f".{step}" if text else step
    return text


@contextmanager
def few_hints(most: int = 100) -> Iterator[None]:
    """Inside, so many words are compared with the known ones: a file of 10,000 unknown words is told in a second."""
    token = _hints.set([most])
    try:
        yield
    finally:
        _hints.reset(token)


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
            return "a mapping"
        case list():
            return "a list"
        case _:
            text = str(value)
    return text if len(text) <= _SHOWN else text[: _SHOWN - 3] + "..."
