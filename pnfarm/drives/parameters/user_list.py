"""A user's list of parameters that a model's manual does not describe: a CSV file named in the farm file.

A manual may describe a drive's parameters in another document, as HIWIN's does for most Pt parameters.  A user who has
that document lists them: a header with the names of the columns, in any order, and a row for each parameter, or for a
run of parameters that differ only in their numbers.  Listed parameters are stored within their limits and read back,
without effect.
"""

from __future__ import annotations

import csv
import io
import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from pnfarm.drives.description.numbering import HIGHEST_PNU, read_number
from pnfarm.drives.parameters.factor_group import float_bits
from pnfarm.drives.parameters.parameter import FLOAT_HIGHEST, Backing, Form, Parameter, ParameterType

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.drives.description.model import Model

__all__ = ["COLUMNS", "MAX_PARAMETERS", "MAX_PROBLEMS", "ListProblem", "read_parameter_list"]

#: Parameters that a list may add: every Pt parameter from Pt000 to PtFFF.
MAX_PARAMETERS = 4096
#: After this many problems the rest of a list is not read.
MAX_PROBLEMS = 100
#: The columns and what a cell holds; the farm file's page of the documentation shows them.
COLUMNS = {
    "number": "As the maker writes it (`Pt100`, `P-0325`), or the PNU (`8448`, `0x2100`, `2100h`). `Pt200..Pt20F` is a "
    "run: every number from the first to the last, except those that the model has or that have a row of their own.",
    "name": "Its name, by which it is found, too; left out, the number. Not for a run.",
    "type": "`uint8`, `uint16`, `uint32`, `int8`, `int16`, `int32` or `float`; left out, `uint16`.",
    "access": "`r` or `rw`; left out, `rw`.",
    "min": "Lowest value; left out, that of the type. Not for `float`.",
    "max": "Highest value; left out, that of the type. Not for `float`.",
    "default": "Value until another one is written; left out, 0 or the limit next to it.",
    "unit": "Unit, for display only.",
    "nonvolatile": "`yes` or `no`: whether a saved value outlives a power cycle; left out, `yes`.",
    "note": "Remark, for display only.",
}
_TYPES = {
    "uint8": (1, False), "uint16": (2, False), "uint32": (4, False), "int8": (1, True), "int16": (2, True),
    "int32": (4, True),
}  # fmt: skip
_FLOAT = "float"
_ACCESS = {"rw": True, "r": False}
_NONVOLATILE = {"yes": True, "no": False}
#: Between the first and the last number of a run.
_RUN = ".."
_DECIMAL_FRACTION = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]{1,3})?")
#: Longest part of a cell that a message quotes.
_SHOWN = 40


@dataclass(frozen=True, slots=True)
class ListProblem:
    """What is wrong in a list: ``line`` counts from 1, ``column`` is the column's name or empty for the whole line."""

    line: int
    column: str
    what: str
    allowed: str


def read_parameter_list(text: str, model: Model, file: str) -> tuple[Model, list[ListProblem]]:
    """The model with the parameters of a list added, and what is wrong in the list; wrong rows are left out.

    ``file`` and the line are each parameter's source.
    """
    reader = _Reader(model, file)
    reader.read(text)
    described = replace(
        model,
        parameters=dict(sorted({**model.parameters, **reader.parameters}.items())),
        parameter_names={**reader.names, **model.parameter_names},
    )
    return described, reader.problems


class _CellError(Exception):
    """One cell is wrong; the row that it stands in becomes a problem."""

    def __init__(self, column: str, what: str, allowed: str) -> None:
        super().__init__(what)
        self.column, self.what, self.allowed = column, what, allowed


class _Reader:
    def __init__(self, model: Model, file: str) -> None:
        self.model = model
        self.file = file
        self.parameters: dict[int, Parameter] = {}
        self.names: dict[str, int] = {}
        self.problems: list[ListProblem] = []
        self._own = model.parameters.keys() | model.absent.keys()
        self._lines: dict[int, int] = {}
        self._singles: frozenset[int] = frozenset()

    def read(self, text: str) -> None:
        rows = self._rows(text)
        line, header = next(rows, (1, []))
        columns = self._columns(line, header)
        if columns is None:
            return
        # rows with one number come first, because runs leave out their numbers
        runs: list[tuple[int, dict[str, str]]] = []
        for line, cells in rows:
            if any(cells[len(columns) :]):
                self._problem(line, "", f"has {len(cells)} cells", f"{len(columns)}, as in the header")
                continue
            row = {column: cell for column, cell in zip(columns, cells, strict=False) if column}
            if _RUN in row.get("number", ""):
                runs.append((line, row))
            else:
                self._add(line, row)
        self._singles = frozenset(self._lines)
        for line, row in runs:
            if len(self.problems) < MAX_PROBLEMS:
                self._add(line, row)
        self.problems.sort(key=lambda problem: problem.line)

    def _problem(self, line: int, column: str, what: str, allowed: str) -> None:
        if len(self.problems) < MAX_PROBLEMS:
            self.problems.append(ListProblem(line, column, what, allowed))

    def _rows(self, text: str) -> Iterator[tuple[int, list[str]]]:
        """The line and the cells of each row; empty rows and those that begin with # are skipped."""
        first = next((line for line in text.splitlines() if line.strip() and not line.startswith("#")), "")
        # spreadsheets write semicolons where the comma is the decimal sign
        delimiter = ";" if first.count(";") > first.count(",") else ","
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, strict=True)
        while len(self.problems) < MAX_PROBLEMS:
            line = reader.line_num + 1
            try:
                cells = [" ".join(cell.split()) for cell in next(reader)]
            except StopIteration:
                return
            except csv.Error as error:
                self._problem(line, "", f"cannot be read: {error}", "cells with commas or semicolons between them")
                return
            if any(cells) and not cells[0].startswith("#"):
                yield line, cells

    def _columns(self, line: int, header: list[str]) -> list[str] | None:
        """The name of each column, empty for one without a header; None where the header is wrong."""
        columns = [cell.lower() for cell in header]
        allowed = ", ".join(COLUMNS)
        for place, column in enumerate(columns):
            if column and column not in COLUMNS:
                self._problem(line, "", f"{header[place][:_SHOWN]!r} is not a column", allowed)
            elif column and column in columns[:place]:
                self._problem(line, column, "is given twice", "each column once")
        if "number" not in columns:
            self._problem(line, "", "has no column number", f"a header with number and any of {allowed}")
        return None if self.problems else columns

    # a row

    def _add(self, line: int, row: dict[str, str]) -> None:
        try:
            for column, cell in row.items():
                if not cell.isprintable():
                    raise _CellError(column, "has control characters", "text that can be printed")
            numbers = self._numbers(row)
            for number in numbers:
                if number in self._lines:
                    what = f"{self._written(number)} is already given in line {self._lines[number]}"
                    raise _CellError("number", what, "each number once")
            if len(self.parameters) + len(numbers) > MAX_PARAMETERS:
                raise _CellError("number", "makes the list too long", f"at most {MAX_PARAMETERS} parameters")
            self._lines.update(dict.fromkeys(numbers, line))
            alike = self._parameter(line, row)
            name = self._name(row, numbers)
        except _CellError as wrong:
            self._problem(line, wrong.column, wrong.what, wrong.allowed)
            return
        for number in numbers:
            parameter = replace(alike, pnu=number, name=name or self._written(number))
            self.parameters[number] = parameter
            for each in (parameter.name, *self.model.numbering.names(number)):
                self.names.setdefault(each.upper(), number)

    def _written(self, number: int) -> str:
        return self.model.numbering.name(number) or f"PNU {number}"

    def _numbers(self, row: dict[str, str]) -> list[int]:
        text = row.get("number", "")
        if _RUN not in text:
            number = self._number(text)
            if number in self._own:
                what = f"{self.model.name} has {text} itself"
                raise _CellError("number", what, "parameters that the model does not have; `params` gives values")
            return [number]
        begin, _, end = text.partition(_RUN)
        first, last = self._number(begin.strip()), self._number(end.strip())
        if last < first or last - first >= MAX_PARAMETERS:
            what = f"{text[:_SHOWN]!r} is not a run of parameters"
            raise _CellError("number", what, f"the lower number first, at most {MAX_PARAMETERS} numbers")
        left_out = self._own | self._singles
        numbers = [number for number in range(first, last + 1) if number not in left_out]
        if not numbers:
            what = f"{text[:_SHOWN]!r} adds no parameter"
            raise _CellError("number", what, "a run with a number that neither the model nor another row has")
        return numbers

    def _number(self, text: str) -> int:
        numbering = self.model.numbering
        found = numbering.number(text)
        if found is None:
            found = read_number(text)
        if found is None or not 1 <= found <= HIGHEST_PNU:
            example = numbering.name(numbering.base + 0x100)
            what = f"{text[:_SHOWN]!r} is not the number of a parameter" if text else "is empty"
            raise _CellError("number", what, f"a PNU such as 8448, 0x2100 or 2100h{example and f', or {example}'}")
        return found

    def _name(self, row: dict[str, str], numbers: list[int]) -> str:
        name = row.get("name", "")
        if name and _RUN in row["number"]:
            raise _CellError("name", "names more than one parameter", "an empty cell in the row of a run")
        other = self.model.numbering.number(name)
        if read_number(name.partition(".")[0]) is not None or (other is not None and other not in numbers):
            raise _CellError("name", f"{name[:_SHOWN]!r} is a number of a parameter", "a name")
        return name

    def _parameter(self, line: int, row: dict[str, str]) -> Parameter:
        """What the row says of its parameters, without number and name."""
        kind = row.get("type", "").lower() or "uint16"
        if kind not in _TYPES and kind != _FLOAT:
            raise _CellError("type", f"{row['type'][:_SHOWN]!r} is not a type", ", ".join((*_TYPES, _FLOAT)))
        octets, signed = _TYPES.get(kind, (4, False))
        source = f"{self.file}:{line}"
        parameter = Parameter(
            pnu=0, name="", type=ParameterType(octets), signed=signed, elements=0,
            readable=True, writable=_word(row, "access", _ACCESS), minimum=0, maximum=FLOAT_HIGHEST, default=0,
            unit=row.get("unit", ""), scale="", factor=1.0, backing=Backing.STORED, argument="", index=0,
            nonvolatile=_word(row, "nonvolatile", _NONVOLATILE), source=source, values_source=source,
            note=row.get("note", ""), form=Form.FLOAT if kind == _FLOAT else Form.INTEGER,
        )  # fmt: skip
        if kind == _FLOAT:
            for column in ("min", "max"):
                if row.get(column):
                    raise _CellError(column, "is given for a float", "an empty cell")
        else:
            parameter = replace(parameter, minimum=parameter.lowest, maximum=parameter.highest)
            low = _raw(parameter, row, "min", parameter.minimum)
            high = _raw(parameter, row, "max", parameter.maximum)
            if low > high:
                raise _CellError("max", f"{high} is below min, {low}", "a value that is not below min")
            parameter = replace(parameter, minimum=low, maximum=high)
        default = min(max(0, parameter.minimum), parameter.maximum)
        return replace(parameter, default=_raw(parameter, row, "default", default))


def _raw(parameter: Parameter, row: dict[str, str], column: str, usual: int) -> int:
    """The cell of a column as a raw number of the parameter, ``usual`` for an empty cell."""
    text = row.get(column, "")
    if not text:
        return usual
    if parameter.form is Form.FLOAT:
        wanted = "a finite number such as 50 or 0.5"
        raw = float_bits(float(text)) if _DECIMAL_FRACTION.fullmatch(text) else None
    else:
        wanted = f"a whole number from {parameter.minimum} to {parameter.maximum}"
        number = read_number(text.removeprefix("-"))
        raw = -number if number is not None and text.startswith("-") else number
    if raw is None or not parameter.allows(raw):
        raise _CellError(column, f"is {text[:_SHOWN]!r}", wanted)
    return raw


def _word(row: dict[str, str], column: str, words: dict[str, bool]) -> bool:
    """The meaning of the text in a cell; an empty cell means the first of ``words``."""
    text = row.get(column, "").lower() or next(iter(words))
    if text not in words:
        raise _CellError(column, f"is {row[column][:_SHOWN]!r}", " or ".join(words))
    return words[text]
