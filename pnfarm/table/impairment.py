"""Impairments of cyclic channels: one row per fault and channel, applied by the engine at one place.

Rows of one channel form a chain through ``next``; an impairment row is written by the event loop
while it is unlinked and only its counters change while it is linked.
"""

from __future__ import annotations

from pnfarm.table.layout import Field, Layout

__all__ = ["IMPAIRMENT", "threshold"]

# Kinds.
LOSS = 1  # drop
IOPS_BAD = 2  # own provider status BAD
PROVIDER_STOP = 3  # data status STOP
DATA_INVALID = 4  # data status not valid
IOCS_BAD = 5  # own consumer status BAD
COUNTER_FREEZE = 6  # the cycle counter of the first frame that was hit; ``whole`` as below
COUNTER_JUMP = 7  # the cycle counter plus ``amount``
FRAME_ID = 8  # ``amount`` more than the frame id, or with ``whole`` set ``amount`` itself
LENGTH = 9  # IO data longer by ``amount`` octets
COUNT_FREEZE = 10  # a count from 1 to 15 in bits 12..15 of the word ``slot`` stands
COUNT_SKIP = 11  # such a count skips ``amount`` counts
DELAY = 12  # later by ``delay_ns`` and up to ``jitter_ns`` more
DUPLICATE = 13  # ``amount`` copies after it
REORDER = 14  # after the ``amount`` frames that follow
CORRUPT = 15  # ``amount`` bits inverted, with ``whole`` also in the addresses, with ``mends`` after the checksums
THROTTLE = 16  # ``octet_ns`` for each octet; more than ``delay_ns`` of waiting: dropped
LATE = 17  # later by ``delay_ns``; what is due in the meantime is not sent

# Which count of a class 1 packet stands or jumps (``whole``); a real-time frame has only one.
BOTH_COUNTS = 0
SEQUENCE_NUMBER = 1
SEQUENCE_COUNT = 2

# How frames are chosen (``model``).
INDEPENDENT = 0  # each with ``threshold``
BURST = 1  # ``burst`` in a row, which begin with ``threshold``
GILBERT_ELLIOTT = 2  # a good and a bad state; ``enter`` and ``leave`` the bad one, ``hit_good`` and ``hit_bad`` in them

#: A threshold that is always met.
ALWAYS = 0xFFFFFFFF


def threshold(probability: float) -> int:
    """A probability in the table's unit."""
    return ALWAYS if probability >= 1.0 else max(0, int(probability * 2**32))


IMPAIRMENT = Layout(
    "impairment",
    "One active impairment of one channel, with its evidence.",
    [
        Field("kind", "u1", "", "fault", "what it does, 0 = row unused"),
        Field("next", "i4", "", "fault", "next row of the chain + 1, 0 = end"),
        Field("uses", "u4", "", "fault", "counts the row's uses, so that frames held by an old one are told apart"),
        Field("threshold", "u4", "1/2^32", "fault", "probability of each activation, 2^32 - 1 = always"),
        Field("model", "u1", "", "fault", "how frames are chosen: independent, in bursts, Gilbert-Elliott"),
        Field("burst", "u4", "frames", "fault", "length of a burst"),
        Field("enter", "u4", "1/2^32", "fault", "probability of a change to the bad state, for each frame"),
        Field("leave", "u4", "1/2^32", "fault", "probability of a change to the good state"),
        Field("hit_good", "u4", "1/2^32", "fault", "probability of an activation in the good state"),
        Field("hit_bad", "u4", "1/2^32", "fault", "probability of an activation in the bad state"),
        Field("amount", "i4", "", "fault", "how much: copies, frames, bits, octets, counts; by the kind"),
        Field("whole", "u1", "", "fault", "by the kind"),
        Field("mends", "u1", "", "fault", "1 = the checksums of IPv4 and UDP are right again after the change"),
        Field("slot", "u1", "", "fault", "signal whose word is changed"),
        Field("delay_ns", "i8", "ns", "fault", "delay, or longest wait"),
        Field("jitter_ns", "i8", "ns", "fault", "random delay on top, below this"),
        Field("octet_ns", "f8", "ns", "fault", "time that an octet takes"),
        Field("overtakes", "u1", "", "fault", "1 = a frame may overtake a delayed one"),
        Field(
            "limit", "i8", "", "fault", "activations after which it is inactive, 0 = no limit, below 0: from the start"
        ),
        Field("shares", "i4", "", "fault", "row + 1 whose activations count against the same limit, 0 = none"),
        Field("start_ns", "i8", "ns", "fault", "not before"),
        Field("stop_ns", "i8", "ns", "fault", "not at or after, 0 = no end"),
        Field("after", "i8", "frames", "fault", "healthy frames to let pass first"),
        Field("random", "u8", "", "engine", "state of the generator; the station seeds it before linking"),
        Field("left", "u4", "frames", "engine", "frames left of the present burst; 1 = bad state of Gilbert-Elliott"),
        Field("kept", "i8", "", "engine", "a frozen count, -1 = none yet; counts that were skipped"),
        Field("free_ns", "i8", "ns", "engine", "until then frames wait after an earlier one"),
        Field("waiting", "i4", "frames", "engine", "frames that it holds"),
        Field("overflows", "i8", "frames", "engine", "frames lost because the store was full"),
        Field("checks", "i8", "frames", "engine", "frames checked"),
        Field("activations", "i8", "frames", "engine", "frames changed or dropped"),
        Field("first_ns", "i8", "ns", "engine", "first activation, 0 = none"),
        Field("last_ns", "i8", "ns", "engine", "last activation"),
    ],
)
