"""Impairments of cyclic channels: one row per fault and channel, applied by the engine at one place.

Rows of one channel form a chain through ``next``; an impairment row is written by the event loop
while it is unlinked and only its counters change while it is linked.
"""

from __future__ import annotations

from pnfarm.table.layout import Field, Layout

__all__ = ["IMPAIRMENT"]

# Kinds.
LOSS = 1  # drop with probability
IOPS_BAD = 2  # own provider status BAD
PROVIDER_STOP = 3  # data status STOP
DATA_INVALID = 4  # data status not valid

IMPAIRMENT = Layout(
    "impairment",
    "One active impairment of one channel, with its evidence.",
    [
        Field("kind", "u1", "", "fault", "what it does, 0 = row unused"),
        Field("next", "i4", "", "fault", "next row of the chain + 1, 0 = end"),
        Field("threshold", "u4", "1/2^32", "fault", "probability of each activation, 2^32 - 1 = always"),
        Field(
            "limit", "i8", "", "fault", "activations after which it is inactive, 0 = no limit, below 0: from the start"
        ),
        Field("shares", "i4", "", "fault", "row + 1 whose activations count against the same limit, 0 = none"),
        Field("start_ns", "i8", "ns", "fault", "not before"),
        Field("stop_ns", "i8", "ns", "fault", "not at or after, 0 = no end"),
        Field("after", "i8", "frames", "fault", "healthy frames to let pass first"),
        Field("random", "u8", "", "engine", "state of the generator; the station seeds it before linking"),
        Field("checks", "i8", "frames", "engine", "frames checked"),
        Field("activations", "i8", "frames", "engine", "frames changed or dropped"),
        Field("first_ns", "i8", "ns", "engine", "first activation, 0 = none"),
        Field("last_ns", "i8", "ns", "engine", "last activation"),
    ],
)
