"""What farm and FMU share: numbers in memory, owned by the one whose turn it is, and the words that pass the turn.

The memory: seconds of the FMU's time, seconds of the step, when the last step ended (`time.perf_counter`), then inputs
and outputs.
The farm asks by an octet and what belongs to it; the answer is ``DONE``, ``REFUSED`` and a text, or ``FAILED`` and a
text, which is the last.
"""

from __future__ import annotations

__all__ = [
    "DONE",
    "END",
    "ENDED",
    "FAILED",
    "MAX_STATE",
    "REFUSED",
    "RESTORE",
    "SAVE",
    "STEP",
    "STEP_SECONDS",
    "TIME",
    "VALUES",
]

TIME, STEP_SECONDS, ENDED = range(3)
#: Where inputs begin.
VALUES = 3
STEP, SAVE, RESTORE, END = b"s", b"g", b"r", b"e"
DONE, REFUSED, FAILED = b"+", b"?", b"-"
#: Largest state of an FMU, octets.
MAX_STATE = 256 << 20
