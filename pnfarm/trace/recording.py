"""The samples of a trace as they are read: one time and one value of each signal per sample.

A value is in the signal's unit; words, bits and codes are whole numbers.  Time is in seconds, 0 at the trigger.
"""

from __future__ import annotations

import csv
import io
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pnfarm.trace.signals import label_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import NDArray

__all__ = ["Column", "Recording"]

#: Fields of a recording, and of a column, that are plain JSON values.
_PLAIN = ("id", "state", "triggered", "triggered_by", "trigger", "interval_seconds")
_OF_COLUMN = ("drive", "signal", "unit", "form")
#: Lines of CSV in one piece.
_LINES = 512


@dataclass(frozen=True, slots=True)
class Column:
    """One signal of one drive or device; ``values`` has one for each sample.  ``form`` as of :class:`.TraceSignal`."""

    drive: str
    signal: str
    unit: str
    form: str
    values: NDArray[Any]

    @property
    def title(self) -> str:
        """``axis-01 velocity [rpm]``."""
        return f"{self.drive} {self.signal}" + (f" [{self.unit}]" if self.unit else "")

    @property
    def labels(self) -> dict[int, str]:
        """Names of the codes that occur, empty of a column that has none."""
        if label_of(self.form, 0) is None:
            return {}
        return {value: label_of(self.form, value) or "" for value in np.unique(self.values).tolist()}

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        labels = {str(value): label for value, label in self.labels.items()}
        return {
            **{key: getattr(self, key) for key in _OF_COLUMN},
            # JSON has no numbers that are not finite
            "values": [value if math.isfinite(value) else None for value in self.values.tolist()],
            **({"labels": labels} if labels else {}),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Column:
        """From :meth:`as_dict`."""
        real = data["form"] == "real"
        values = np.array(data["values"], np.float64 if real else np.int64)
        return cls(**{key: data[key] for key in _OF_COLUMN}, values=values)


@dataclass(frozen=True, slots=True)
class Recording:
    """``time`` in seconds from the trigger, or from the start while it has not fired (``triggered`` False).

    ``state``: ``waiting`` for the trigger, ``running`` or ``complete``.  ``missed``: samples that were due while the
    engine did not step.
    """

    id: str
    state: str
    triggered: bool
    triggered_by: str
    trigger: str
    interval_seconds: float
    missed: int
    time: NDArray[np.float64]
    columns: tuple[Column, ...]

    def column(self, signal: str, drive: str | None = None) -> Column:
        """The column of a signal; of several drives' the first, or that of ``drive``.  Raises :class:`KeyError`.

        ``signal`` may be ``STATION.SIGNAL`` as well.
        """
        for column in self.columns:
            if signal in {column.signal, f"{column.drive}.{column.signal}"} and drive in {None, column.drive}:
                return column
        raise KeyError(f"{drive or 'no drive'}: {signal} is not in this trace")

    def values(self, signal: str, drive: str | None = None) -> NDArray[Any]:
        """The values of :meth:`column`."""
        return self.column(signal, drive).values

    def at(self, seconds: float, signal: str, drive: str | None = None) -> float:
        """The last value at or before a time.  Raises :class:`KeyError` for a time before the first sample."""
        place = int(np.searchsorted(self.time, seconds + 1e-12, side="right")) - 1
        if place < 0:
            raise KeyError(f"the trace has no sample at {seconds:g} s")
        return float(self.values(signal, drive)[place])

    def first(self, signal: str, value: float, drive: str | None = None) -> float | None:
        """When the signal first had this value, in seconds from the trigger; None: never."""
        found = np.flatnonzero(self.values(signal, drive) == value)
        return float(self.time[found[0]]) if found.size else None

    def as_dict(self) -> dict[str, Any]:
        """For JSON; :meth:`from_dict` reads it."""
        return {
            **{key: getattr(self, key) for key in _PLAIN},
            "samples": len(self.time),
            "missed": self.missed,
            "time": self.time.tolist(),
            "columns": [column.as_dict() for column in self.columns],
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Recording:
        """From :meth:`as_dict`."""
        columns = tuple(Column.from_dict(column) for column in data["columns"])
        time = np.array(data["time"], np.float64)
        return cls(**{key: data[key] for key in _PLAIN}, missed=data["missed"], time=time, columns=columns)

    def csv_lines(self) -> Iterator[str]:
        """CSV in pieces of some lines: a head line, then one for each sample; codes by names (``S4``, ``702``)."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(["time [s]", *(column.title for column in self.columns)])
        texts = [_texts(column) for column in self.columns]
        for place in range(len(self.time)):
            writer.writerow([f"{self.time[place]:.9f}", *(text[place] for text in texts)])
            if place % _LINES == _LINES - 1:
                yield out.getvalue()
                out.seek(0)
                out.truncate()
        yield out.getvalue()

    def csv(self) -> str:
        """All of :meth:`csv_lines`."""
        return "".join(self.csv_lines())


def _texts(column: Column) -> list[Any]:
    labels = column.labels
    values: list[Any] = column.values.tolist()
    if labels:
        return [labels[value] for value in values]
    # ten digits: more than any sensor has, and no rounding errors of the scale
    return [f"{value:.10g}" for value in values] if column.form == "real" else values
