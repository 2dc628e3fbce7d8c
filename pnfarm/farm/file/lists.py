"""The farm file's ``parameter_lists``: each CSV file read, checked line by line, and added to its model."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from pnfarm.vocabulary.issues import FileIssue, Location
from pnfarm.vocabulary.quoting import did_you_mean, shown
from pnfarm.vocabulary.regular_file import beside, read_regular

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from pnfarm.config.known import Known, ModelFacts

__all__ = ["MAX_OCTETS", "with_lists"]

#: Longest list: as long as the longest farm file.
MAX_OCTETS = 1 << 20
KEY = "parameter_lists"
_ALLOWED = "a CSV file, its name relative to the folder of this file"


def with_lists(
    wanted: Mapping[str, str],
    folder: Path,
    known: Known,
    report: Callable[[Location, str, str], None],
) -> tuple[Known, list[FileIssue]]:
    """The known names with the models' lists added, and what is wrong in the lists, by file and line.

    The names of the files are relative to ``folder``.  Unknown models and files that cannot be read are
    reported at their key of the farm file.
    """
    listed: dict[str, ModelFacts] = {}
    issues: list[FileIssue] = []
    for name, file in wanted.items():
        model = known.find(name)
        if model is None:
            hint = did_you_mean(name, known.models)
            report((KEY, name), f"{shown(name)} is not a model of this version{hint}", ", ".join(known.models))
        elif model.name in listed:
            report((KEY, name), f"{model.name} has a list already", "one list for each model")
        else:
            path = beside(folder, file)
            text = _read(path, partial(report, (KEY, name)), shown(file))
            if text is not None:
                listed[model.name], problems = model.with_list(text, path.name)
                issues += [FileIssue(str(path), p.line, 0, p.column, p.what, p.allowed) for p in problems]
    return replace(known, listed=listed), issues


def _read(path: Path, report: Callable[[str, str], None], name: str) -> str | None:
    """A list's text; None for a file that cannot be read, which is reported under ``name``."""
    try:
        data = read_regular(path, MAX_OCTETS + 1)
    except OSError as error:
        report(f"{name} cannot be read: {(error.strerror or str(error)).lower()}", _ALLOWED)
        return None
    if len(data) > MAX_OCTETS:
        report(f"{name} is longer than {MAX_OCTETS} octets", "a shorter file")
        return None
    try:
        # spreadsheets begin a UTF-8 file with a byte order mark
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        report(f"{name} is not UTF-8 in line {line}", "a CSV file in UTF-8")
        return None
