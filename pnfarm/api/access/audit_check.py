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

    def add(self, to: list[str], line: int, what: str) -> None:
        if len(to) < MOST_FINDINGS:
            to.append(f"line {line}: {what}")
        else:
            self.more += 1


def check_audit(path: Path, noted: str | None = None) -> Findings:
    """Read the file from its begin.  Raises :class:`ConfigError` for one that cannot be read."""
    found = Findings()
    torn = b""
    open_requests: dict[int, int] = {}
    try:
        with path.open("rb") as file:
            for number, line in _lines(file):
                record = _record(line)
                if torn:
                    # a run that begins behind half a line says so
                    is_known = record is not None and record.get("found") == "torn"
                    found.add(found.notes if is_known else found.wrong, number - 1, "it is not a record")
                torn = b""
                if record is None:
                    torn = line
                else:
                    _follow(found, number, record, open_requests)
                found.digest = digest_of_line(line)
                found.is_noted |= noted is not None and found.digest == noted.lower()
            if torn:
                found.add(found.wrong, number, "it is not a record")
    except OSError as exc:
        raise ConfigError(f"the audit log {path} cannot be read: {(exc.strerror or str(exc)).lower()}") from exc
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


def _follow(found: Findings, number: int, record: dict[str, Any], open_requests: dict[int, int]) -> None:
    """A record against those before it."""
    if record["previous"] != found.digest:
        found.add(found.wrong, number, "it does not follow from the line before: one was changed, added or taken out")
    if record["sequence"] != found.sequence + 1:
        found.add(found.wrong, number, f"it has number {record['sequence']} behind {found.sequence}")
    if record["time"] < found.last_time:
        found.add(found.notes, number, f"its time is before that of the line before, {found.last_time}")
    match record["record"]:
        case "begin":
            _begin(found, number, record, open_requests)
        case "request":
            found.requests += 1
            open_requests[record["sequence"]] = number
        case "answer":
            open_requests.pop(record.get("of", 0), None)
    found.records += 1
    found.first_time = found.first_time or record["time"]
    found.sequence, found.last_time = record["sequence"], record["time"]


def _begin(found: Findings, number: int, record: dict[str, Any], open_requests: dict[int, int]) -> None:
    if record.get("found") in {"shortened", "changed", "missing"}:
        noted = record.get("noted") or {}
        what = f"the run that begins here found the file {record['found']}"
        found.add(found.wrong, number, f"{what}: it had ended with {noted.get('sequence')} {noted.get('digest')}")
    if record.get("found") == "unnoted":
        found.add(found.notes, number, "the run that begins here found no note of the file's end in the state folder")
    for line in open_requests.values():
        found.add(found.notes, line, "the run ended before it answered this request")
    open_requests.clear()
