"""Cycle times of PROFINET IO.

A cyclic frame leaves every ``send clock factor x reduction ratio x 31.25 us`` (IEC 61158-6-10, IOCRBlockReq).
For the RT classes 1 to 3:

* SendClockFactor is a power of two from 1 to 128 (default 32: a send clock of 1 ms; engineering tools offer
  8 to 128 for RT class 1);
* ReductionRatio is a power of two from 1 to 512; 256 and more goes with a factor of at most 64, 512 with at
  most 32.  The slowest cycle is therefore 512 ms;
* the watchdog, ``cycle x DataHoldFactor``, lasts at most 1.92 s and the factor is 1 to 0x1E00.

So a cycle is 31.25 us times a power of two up to 2^14, and nothing else.
"""

from __future__ import annotations

from pnfarm.vocabulary.durations import format_duration
from pnfarm.wire.rtc import REDUCTION_RATIOS, SEND_CLOCK_FACTORS, SEND_CLOCK_NS

__all__ = [
    "CYCLE_UNIT_NS",
    "MAX_DATA_HOLD_FACTOR",
    "MAX_WATCHDOG_NS",
    "USUAL_FACTOR",
    "check_clock",
    "join_cycle",
    "nearest_cycles",
    "split_cycle",
]

#: The unit of all cycle arithmetic.
CYCLE_UNIT_NS = SEND_CLOCK_NS
#: 512 ms, the slowest cycle, in units.
MAX_CYCLE_UNITS = 1 << 14
#: IEC 61158-6-10, DataHoldFactor of the RT classes 1 to 3.
MAX_DATA_HOLD_FACTOR = 0x1E00
MAX_WATCHDOG_NS = 1_920_000_000

#: The send clock that every device supports, 1 ms.
USUAL_FACTOR = 32


def nearest_cycles(cycle_ns: int) -> tuple[int, ...]:
    """The allowed cycles next to ``cycle_ns``, nanoseconds: itself, or the one below and the one above."""
    if cycle_ns <= CYCLE_UNIT_NS:
        return (CYCLE_UNIT_NS,)
    if cycle_ns >= CYCLE_UNIT_NS * MAX_CYCLE_UNITS:
        return (CYCLE_UNIT_NS * MAX_CYCLE_UNITS,)
    below = CYCLE_UNIT_NS << (cycle_ns // CYCLE_UNIT_NS).bit_length() - 1
    return (below,) if below == cycle_ns else (below, 2 * below)


def split_cycle(cycle_ns: int) -> tuple[int, int]:
    """Send clock factor and reduction ratio that make ``cycle_ns``.

    From 1 ms on the send clock is 1 ms, which every device supports; below, it is the cycle itself.
    Raises ValueError, with the nearest cycles, when nothing makes it.
    """
    nearest = nearest_cycles(cycle_ns)
    if nearest != (cycle_ns,):
        raise ValueError(" or ".join(map(format_duration, nearest)))
    units = cycle_ns // CYCLE_UNIT_NS
    return (units, 1) if units < USUAL_FACTOR else (USUAL_FACTOR, units // USUAL_FACTOR)


def join_cycle(send_clock_factor: int, reduction_ratio: int) -> int:
    """The cycle, nanoseconds."""
    return CYCLE_UNIT_NS * send_clock_factor * reduction_ratio


def check_clock(send_clock_factor: int, reduction_ratio: int) -> str | None:
    """What is wrong with the pair for the RT classes 1 to 3, or None."""
    if send_clock_factor not in SEND_CLOCK_FACTORS:
        return f"a send clock factor is one of {', '.join(map(str, SEND_CLOCK_FACTORS))}"
    if reduction_ratio not in REDUCTION_RATIOS:
        return f"a reduction ratio is one of {', '.join(map(str, REDUCTION_RATIOS))}"
    if send_clock_factor * reduction_ratio > MAX_CYCLE_UNITS:
        return "the slowest cycle is 512ms: a ratio of 256 goes with a factor of at most 64, of 512 with at most 32"
    return None
