"""Values over time: ``0:false 0.5:true 2s:false``, or the columns of a CSV file by its name, ``@pressure.csv``.

A file has a line for each sample: a time in seconds, then values; ``,``, ``;`` or a tab between them, with a line of
titles or without.  ``@trace.csv#2`` takes the second column of values, ``#TITLE`` the one with this title.  The times
of a saved trace, which begin before its trigger, count from its first sample.
"""

from __future__ import annotations

import csv
import math
from typing import TYPE_CHECKING, Any

from pnfarm.vocabulary.durations import read_duration
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import did_you_mean, shown
from pnfarm.vocabulary.regular_file import beside, read_regular

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["MAX_SAMPLES", "MAX_TEXT", "SAMPLES", "read_samples", "with_files"]

#: What is allowed, for messages.
SAMPLES = "times and values such as '0:false 0.5:true 2s:false'"
#: Most samples, characters of them, and octets of a file.
MAX_SAMPLES = 10_000
MAX_TEXT = 48_000
MAX_FILE = 16_000_000
MAX_SECONDS = 366 * 24 * 3600
#: The parameter of a fault that has them.
_PARAMETER = "values"


def read_samples(text: object) -> list[tuple[int, str]]:
    """(time in ns, value) of each sample, in their order.  Raises :class:`Problem`."""
    if not isinstance(text, str) or not text.strip():
        raise Problem(f"is {shown(text)}", SAMPLES)
    if text.startswith("@"):
        what = "names a file, which is read where the fault is written: on a command line, in a file, in Python"
        raise Problem(what, SAMPLES)
    if len(text) > MAX_TEXT:
        raise Problem(f"has {len(text)} characters", f"at most {MAX_TEXT}")
    found: list[tuple[int, str]] = []
    for number, word in enumerate(text.split(), start=1):
        time, colon, value = word.partition(":")
        if not colon or not value:
            raise Problem(f"sample {number}, {shown(word)}, is not TIME:VALUE", SAMPLES)
        try:
            found.append((_nanoseconds(time), value))
        except Problem as problem:
            raise Problem(f"sample {number}: {problem.what}", problem.allowed) from problem
        if len(found) > 1 and found[-1][0] <= found[-2][0]:
            raise Problem(f"sample {number}, {shown(word)}, is not later than the one before", "rising times")
        if number > MAX_SAMPLES:
            raise Problem("has too many samples", f"at most {MAX_SAMPLES}")
    return found


def with_files(params: Any, folder: Path | None) -> Any:
    """Parameters of a fault with the samples of the file that one names, relative to ``folder``; None: no file may be.

    Raises :class:`Problem` with the file and the line.
    """
    text = params.get(_PARAMETER) if isinstance(params, dict) else None
    if folder is None or not isinstance(text, str) or not text.startswith("@"):
        return params
    name, _, column = text[1:].partition("#")
    return {**params, _PARAMETER: _file_samples(beside(folder, name), column)}


def _file_samples(path: Path, column: str) -> str:
    try:
        data = read_regular(path, MAX_FILE + 1)
    except OSError as error:
        raise Problem(f"{path} cannot be read: {(error.strerror or str(error)).lower()}", "a CSV file") from error
    if len(data) > MAX_FILE:
        raise Problem(f"{path} is too long", f"at most {MAX_FILE} octets")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise Problem(f"{path} is no text in UTF-8", "a CSV file") from error
    lines = text.splitlines()
    delimiter = next((sign for sign in ("\t", ";") if lines and sign in lines[0]), ",")
    place: int | None = None
    first = 0.0
    samples: list[str] = []
    rows = csv.reader(lines, delimiter=delimiter)
    before = -math.inf
    try:
        for row in rows:
            where = f"{path}, line {rows.line_num}: "
            if not row:
                continue
            if place is None:
                place = _place(row, column, where)
                if _number(row[0]) is None:
                    continue
            time = _number(row[0])
            if time is None:
                raise Problem(f"{where}{shown(row[0])} is not a time", "seconds")
            if len(row) <= place or not (value := row[place].strip()) or any(map(str.isspace, value)):
                raise Problem(f"{where}has no value in column {place + 1}", "a value without blanks")
            if time <= before:
                raise Problem(f"{where}{shown(row[0])} is not later than the line before", "rising times")
            first = min(first, time)
            before = time
            # what stays needs no sample
            if not samples or samples[-1].partition(":")[2] != value:
                samples.append(f"{time - first:.9f}".rstrip("0").rstrip(".") + f":{value}")
    except csv.Error as error:
        raise Problem(f"{path}, line {rows.line_num}: {error}", "a CSV file") from error
    if not samples:
        raise Problem(f"{path} has no samples", "lines such as 0.5,true")
    whole = " ".join(samples)
    if len(samples) > MAX_SAMPLES or len(whole) > MAX_TEXT:
        raise Problem(f"{path} has {len(samples)} changes", f"at most {MAX_SAMPLES}, and {MAX_TEXT} characters of them")
    return whole


def _place(row: list[str], column: str, where: str) -> int:
    """The column's place in a row, of which the first one may have the titles."""
    titles = {title.strip(): place for place, title in enumerate(row) if place}
    if not column:
        return 1
    if _number(row[0]) is None and column in titles:
        return titles[column]
    if column.isdecimal() and 0 < int(column[:6]) < len(row):
        return int(column)
    hint = did_you_mean(column, titles)
    raise Problem(
        f"{where}there is no column {shown(column)}{hint}", f"1 to {len(row) - 1}, or a title of the first line"
    )


def _number(text: str) -> float | None:
    try:
        found = float(text)
    except ValueError:
        return None
    return found if abs(found) <= MAX_SECONDS else None


def _nanoseconds(text: str) -> int:
    """``0.5`` in seconds, or ``500ms``."""
    number = _number(text)
    if number is None:
        return read_duration(text)
    if number < 0:
        raise Problem(f"{shown(text)} is negative", "seconds from 0 on")
    return round(number * 1e9)
