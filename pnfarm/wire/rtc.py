"""Time base and frame ids of cyclic frames (IEC 61158-6-10, coding of FrameID)."""

from __future__ import annotations

__all__ = [
    "ALARM_FRAME_IDS",
    "ALARM_HIGH",
    "ALARM_LOW",
    "FIRST_ACYCLIC_FRAME_ID",
    "FIRST_CYCLIC_FRAME_ID",
    "REDUCTION_RATIOS",
    "SEND_CLOCK_FACTORS",
    "SEND_CLOCK_NS",
]

#: The unit of send clocks and of the cycle counter: 31.25 us.
SEND_CLOCK_NS = 31_250
#: SendClockFactors of the RT classes, and the ReductionRatios of engineering.
SEND_CLOCK_FACTORS = tuple(1 << exponent for exponent in range(8))
REDUCTION_RATIOS = tuple(1 << exponent for exponent in range(10))

#: Lower ids are PTCP sync frames (0x0020 ... 0x0081) or reserved.
FIRST_CYCLIC_FRAME_ID = 0x0100
#: Lower ids are cyclic RT frames; alarms and DCP (0xFEFC ...) are above.
FIRST_ACYCLIC_FRAME_ID = 0xFC00
ALARM_HIGH = 0xFC01
ALARM_LOW = 0xFE01
ALARM_FRAME_IDS = (ALARM_HIGH, ALARM_LOW)
