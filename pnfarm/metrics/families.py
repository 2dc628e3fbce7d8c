"""Fast rendering of metrics: the text around a family's values is built once, only the values change.

A farm of a thousand drives has some hundred thousand series, and each scrape wants all of them while the drives go
on; so a family keeps the text around its values and fills in the values only (Prometheus exposition format, text
0.0.4).  :meth:`Family.metric` gives the same as the objects of prometheus_client.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, Self

from prometheus_client.metrics_core import Metric
from prometheus_client.samples import Sample

__all__ = ["CONTENT_TYPE", "MOST_SERIES", "OTHER", "Family", "Histogram", "Room", "Values", "escape"]

#: Of the text format.
CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"

#: One number per sample of a family, in the order in which its series were added.
Values = Sequence[float]


def escape(value: str) -> str:
    """A label's value inside of its quotes."""
    return value.replace("\\", "\\\\").replace("\n", "\\n").replace('"', '\\"')


def _prefix(name: str, labels: dict[str, str]) -> str:
    """What stands before a sample's value."""
    inside = ",".join(f'{key}="{escape(value)}"' for key, value in labels.items())
    return f"\n{name}{{{inside}}} " if inside else f"\n{name} "


#: Series that one drive has at most, over all families.
MOST_SERIES = 199
#: Value of a bounded label when a drive has no room for another series.
OTHER = "other"


class Room:
    """How many series each drive has, so that what users and controllers do cannot make ever more of them."""

    def __init__(self, most: int = MOST_SERIES) -> None:
        self._most = most
        self._used: Counter[str] = Counter()

    def take(self, drive: str, series: int) -> None:
        """A drive got so many more."""
        self._used[drive] += series

    def left(self, drive: str) -> int:
        """Series that the drive may still get."""
        return self._most - self._used[drive]


class Family:
    """A gauge or a counter (by ``kind``) with ``labels``; series are added and never taken away.

    In a ``room`` the series of a drive count, and :meth:`place` makes no more than fit.  The values of the labels in
    ``bounded`` are then :data:`OTHER`; those series exist from the start.
    """

    #: Series that one set of labels makes.
    samples = 1

    def __init__(
        self,
        name: str,
        kind: str,
        documentation: str,
        labels: Sequence[str] = (),
        *,
        room: Room | None = None,
        bounded: Sequence[str] = (),
    ) -> None:
        self.name = name
        self._room = room if "drive" in labels else None
        self._drive = list(labels).index("drive") if "drive" in labels else 0
        self._bounded = [label in bounded for label in labels]
        self.kind = kind
        self.documentation = documentation
        self.labels = tuple(labels)
        self._index: dict[tuple[str, ...], int] = {}
        self._prefixes: list[str] = []
        self._head = f"# HELP {name} {documentation}\n# TYPE {name} {kind}"
        self._last: Values | None = None
        self._text = ""
        if not labels:
            self.add()

    def __len__(self) -> int:
        """Samples, not series: as many as values are wanted."""
        return len(self._prefixes)

    def add(self, *labels: str) -> int:
        """The index of the series with these label values; made when it is new."""
        index = self._index.get(labels)
        if index is None:
            index = self._index[labels] = len(self._index)
            self._prefixes += [_prefix(*sample) for sample in self._of_series(labels)]
            self._last = None
            if self._room is not None:
                self._room.take(labels[self._drive], self.samples)
        return index

    def place(self, *labels: str) -> int:
        """The index of the series that counts these label values: their own while the drive has room for it."""
        index = self._index.get(labels)
        if index is None and self._room is not None and self._room.left(labels[self._drive]) < self.samples:
            labels = tuple(OTHER if bounded else label for label, bounded in zip(labels, self._bounded, strict=True))
        return self.add(*labels) if index is None else index

    def counted(self, counts: Mapping[Any, int]) -> tuple[Self, Values]:
        """The family with counts by label values; a series that is new is made while there is room for it."""
        places = [(self.place(*labels), count) for labels, count in counts.items()]
        values: list[float] = [0] * len(self)
        for place, count in places:
            values[place] += count
        return self, values

    def _of_series(self, values: tuple[str, ...]) -> list[tuple[str, dict[str, str]]]:
        """Name and labels of each sample of a series, made when they are wanted: many drives have many of them."""
        return [(self.name, dict(zip(self.labels, values, strict=True)))]

    def text(self, values: Values) -> str:
        """The family in exposition format, without a line end; as long as values stay, so does the text."""
        if self._last is None or values != self._last:
            # series may have been added since the values were gathered; they come with the next scrape
            count = len(values)
            parts: list[str] = [""] * (2 * count)
            parts[0::2] = self._prefixes[:count]
            parts[1::2] = map(repr, values)
            self._text = self._head + "".join(parts)
            self._last = values
        return self._text

    def metric(self, values: Values) -> Metric:
        """The family as prometheus_client's own object."""
        name = self.name.removesuffix("_total") if self.kind == "counter" else self.name
        metric = Metric(name, self.documentation, self.kind)
        places = (place for series in list(self._index) for place in self._of_series(series))
        metric.samples = [
            Sample(sample, labels, float(value)) for (sample, labels), value in zip(places, values, strict=False)
        ]
        return metric


class Histogram(Family):
    """A histogram whose bucket bounds are ``edges_ns``; on the way out all is seconds."""

    def __init__(
        self,
        name: str,
        documentation: str,
        edges_ns: Sequence[int],
        labels: Sequence[str] = (),
        *,
        room: Room | None = None,
        bounded: Sequence[str] = (),
    ) -> None:
        self.edges_ns = tuple(edges_ns)
        # each bound, infinity, sum and count
        self.samples = len(self.edges_ns) + 3
        super().__init__(name, "histogram", documentation, labels, room=room, bounded=bounded)

    def _of_series(self, values: tuple[str, ...]) -> list[tuple[str, dict[str, str]]]:
        labels = dict(zip(self.labels, values, strict=True))
        bounds = [*(repr(edge / 1e9) for edge in self.edges_ns), "+Inf"]
        buckets = [(f"{self.name}_bucket", {**labels, "le": bound}) for bound in bounds]
        return [*buckets, (f"{self.name}_sum", labels), (f"{self.name}_count", labels)]

    def values(self, buckets: Any, sums_ns: Any) -> Values:
        """The samples of counts per bucket, ``(series, edges + 1)`` integers, and of sums, ``(series,)``."""
        cumulative = buckets.cumsum(axis=1).tolist()
        sums = (sums_ns / 1e9).tolist()
        found: list[float] = []
        for counts, total in zip(cumulative, sums, strict=True):
            found += counts
            found += (total, counts[-1])
        return found
