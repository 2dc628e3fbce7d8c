"""Whether an audit log is whole: lines follow from each other, numbers have no gap, each run found it as it was."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, BinaryIO

from pnfarm.api.access.audit import FIRST, MOST_LINE, digest_of_line
from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

__all__ = ["Findings", "check_audit"]

#: Findings that are kept; the others are counted.
MOST_FINDINGS = 20


@dataclass(slots=True)
class Findings:
    """``wrong`` lists what is not as it was written, ``notes`` what an interrupted run leaves.

    ``is_noted``: a line has the digest that was noted.
    """

    records: int = 0
    requests: int = 0
    first_time: str = ""
    last_time: str = ""
    sequence: int = 0
    digest: str = FIRST
    is_noted: bool = False
    wrong: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    more: int = 0

    def add(self, to: list[str], place: str, what: str) -> None:
        if len(to) < MOST_FINDINGS:
            to.append(f"{place}: {what}")
        else:
            self.more += 1


class _Reading:
    """What is known after each line."""

    def __init__(self) -> None:
        self.found = Findings()
        #: Requests without an answer so far, and their places.
        self.open: dict[int, str] = {}
        #: Place of the line before, if it is no record.
        self.torn = ""
        #: The last record of which a run notes number and digest.
        self.noted: dict[str, Any] = {}

    def line(self, place: str, line: bytes, *, begins: bool) -> None:
        """``begins``: it is the first one of a file after another one."""
        record = _record(line)
        how = None if record is None else record.get("found")
        is_moved = begins and how == "missing" and record is not None and record.get("noted") == self.noted
        if self.torn:
            # a run that begins after half a line says so
            self.found.add(
                self.found.notes if is_moved or how == "torn" else self.found.wrong, self.torn, "it is not a record"
            )
        self.torn = "" if record is not None else place
        if is_moved:
            self.found.sequence, self.found.digest = self.noted["sequence"], FIRST
        if record is not None:
            self._follow(place, record, is_moved=is_moved)
        self.found.digest = digest_of_line(line)
        if record is not None and record["record"] != "answer":
            self.noted = {"sequence": record["sequence"], "digest": self.found.digest}

    def _follow(self, place: str, record: dict[str, Any], *, is_moved: bool) -> None:
        """A record against those before it."""
        found = self.found
        if record["previous"] != found.digest:
            what = "it does not follow from the line before: one was changed, added or removed"
            found.add(found.wrong, place, what)
        if record["sequence"] != found.sequence + 1:
            found.add(found.wrong, place, f"it has number {record['sequence']} after {found.sequence}")
        if record["time"] < found.last_time:
            found.add(found.notes, place, f"its time is before that of the line before, {found.last_time}")
        match record["record"]:
            case "begin":
                self._begin(place, record, is_moved=is_moved)
            case "request":
                found.requests += 1
                self.open[record["sequence"]] = place
            case "answer":
                self.open.pop(record.get("of", 0), None)
        found.records += 1
        found.first_time = found.first_time or record["time"]
        found.sequence, found.last_time = record["sequence"], record["time"]

    def _begin(self, place: str, record: dict[str, Any], *, is_moved: bool) -> None:
        found, how = self.found, record.get("found")
        if how in {"shortened", "changed", "missing"} and not is_moved:
            noted = record.get("noted") or {}
            what = f"the run that begins here found the file {how}"
            what += f": it had ended with {noted.get('sequence')} {noted.get('digest')}"
            if how == "missing":
                what += "; if it was moved away, name it before this one"
            found.add(found.wrong, place, what)
        if how == "unnoted":
            found.add(
                found.notes, place, "the run that begins here found no note of the file's end in the state folder"
            )
        for asked in self.open.values():
            found.add(found.notes, asked, "the run ended before it answered this request")
        self.open.clear()


def check_audit(*paths: Path, noted: str | None = None) -> Findings:
    """Read one file from its start, or those that were moved away and then the last one.

    Raises :class:`ConfigError` for one that cannot be read.
    """
    reading = _Reading()
    found = reading.found
    for path in paths:
        try:
            with path.open("rb") as file:
                for number, line in _lines(file):
                    reading.line(f"{path}: line {number}", line, begins=number == 1 and path is not paths[0])
                    found.is_noted |= noted is not None and found.digest == noted.lower()
        except OSError as exc:
            raise ConfigError(f"the audit log {path} cannot be read: {(exc.strerror or str(exc)).lower()}") from exc
    if reading.torn:
        found.add(found.wrong, reading.torn, "it is not a record")
    return found


def _lines(file: BinaryIO) -> Iterator[tuple[int, bytes]]:
    number = 0
    while line := file.readline(MOST_LINE + 1):
        number += 1
        yield number, line.removesuffix(b"\n")


def _record(line: bytes) -> dict[str, Any] | None:
    try:
        found = json.loads(line)
    except (ValueError, RecursionError):
        return None
    is_record = (
        isinstance(found, dict)
        and isinstance(found.get("sequence"), int)
        and all(isinstance(found.get(key), str) for key in ("time", "record", "previous"))
        and isinstance(found.get("found", ""), str)
        and isinstance(found.get("of", 0), int)
        and isinstance(found.get("noted") or {}, dict)
    )
    return found if is_record else None
