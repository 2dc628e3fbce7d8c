"""What is wrong with a user's file: every place of it, with its line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

__all__ = ["FarmFileError", "FileIssue", "Location", "Report", "field_path", "parse_path"]

#: Path of a value in a file: keys and list indexes from the root.
Location = tuple[str | int, ...]
#: Says that something is wrong: where, what, and what is allowed.
Report = Callable[[Location, str, str], None]


@dataclass(frozen=True, slots=True)
class FileIssue:
    """One error: ``line`` and ``column`` count from 1; 0 means the whole file, or a setting from outside it."""

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
    """All errors of a farm file and of the files that it names, file by file, one line each."""

    def __init__(self, issues: Iterable[FileIssue]) -> None:
        found = list(issues)
        files = {path: place for place, path in enumerate(dict.fromkeys(issue.path for issue in found))}
        self.issues: Sequence[FileIssue] = tuple(
            sorted(found, key=lambda issue: (files[issue.path], issue.line, issue.column))
        )
        super().__init__("\n".join(map(str, self.issues)))


def field_path(location: Location) -> str:
    """``("drives", 0, "load")`` as people write it: ``drives[0].load``."""
    text = ""
    for step in location:
        if isinstance(step, int):
            text += f"[{step}]"
        else:
            text += f".{step}" if text else step
    return text


def parse_path(key: str) -> Location:
    """``drives[0].load`` as a location: the inverse of :func:`field_path`."""
    steps: list[str | int] = []
    for part in key.split("."):
        name, *indexes = part.replace("]", "").split("[")
        steps.append(name)
        steps += [int(index) if index.isdecimal() else index for index in indexes]
    return tuple(steps)
