"""Metrics of the serial lines that drives share; a farm without lines has none of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pnfarm.links.serial.line import REPLY_EDGES_NS
from pnfarm.metrics.families import Family, Histogram, Values

if TYPE_CHECKING:
    from pnfarm.farm.core import FarmCore

__all__ = ["LineFamilies"]

_WAYS = ("in", "out")


class LineFamilies:
    """The families of one farm's lines, with a label ``line``: the name of their bus."""

    def __init__(self, core: FarmCore) -> None:
        self._core = core
        self._lines = core.lines

        def counter(name: str, documentation: str, label: str) -> Family:
            return Family(f"pnfarm_line_{name}_total", "counter", documentation, ("line", label))

        self._up = Family("pnfarm_line_up", "gauge", "Whether the line is connected.", ("line",))
        self._telegrams = counter("telegrams", "Whole telegrams that the farm received and sent.", "direction")
        self._octets = counter("octets", "Octets that the farm received and sent.", "direction")
        self._dropped = counter("dropped", "Received data that are not telegrams; garbage counts octets.", "reason")
        self._lost = counter("octets_lost", "Octets that the farm could not send.", "reason")
        self._interruptions = counter("interruptions", "How often the connection of the line broke.", "reason")
        self._requests = counter("requests", "Requests of the master, of some kinds.", "kind")
        self._withheld = Family(
            "pnfarm_line_answers_withheld_total",
            "counter",
            "Answers that would have begun later than the line's limit, and were withheld.",
            ("line",),
        )
        self._reply = Histogram(
            "pnfarm_line_reply_seconds",
            "From the last octet of a request to its answer, in this process (part of T_SDR).",
            REPLY_EDGES_NS,
            ("line",),
        )
        for name in self._lines:
            self._up.add(name)
            self._withheld.add(name)
            self._reply.add(name)
            for way in _WAYS:
                self._telegrams.add(name, way)
                self._octets.add(name, way)
            for kind in core.line_counts(name):
                self._requests.add(name, kind)

    def gather(self) -> list[tuple[Family, Values]]:
        """Read the counters; in the thread of the stations."""
        if not self._lines:
            return []
        lines = self._lines.items()
        counted = {name: one.octets for name, one in lines}
        octets = [count for one in counted.values() for count in (one.received, one.sent)]
        telegrams = [count for _, one in lines for count in one.telegrams]
        dropped = {(name, reason): n for name, one in lines for reason, n in one.dropped.items()}
        lost = {(name, reason): n for name, one in counted.items() for reason, n in one.lost.items()}
        broken = {(name, reason): n for name, one in counted.items() for reason, n in one.interruptions.items()}
        kinds = {(name, kind): n for name in self._lines for kind, n in self._core.line_counts(name).items()}
        buckets = np.array([one.replies.buckets for _, one in lines])
        sums = np.array([one.replies.sum_ns for _, one in lines])
        return [
            (self._up, [int(one.is_up) for one in self._lines.values()]),
            (self._telegrams, telegrams),
            (self._octets, octets),
            self._dropped.counted(dropped),
            self._lost.counted(lost),
            self._interruptions.counted(broken),
            self._requests.counted(kinds),
            (self._withheld, [one.withheld for one in self._lines.values()]),
            (self._reply, self._reply.values(buckets, sums)),
        ]
