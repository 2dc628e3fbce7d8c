"""Double words that are numbers of single precision: a position in degrees, a velocity in degrees a second.

The positioner's telegram 112 has them, for a rotary axis without another unit (SINAMICS S200, parameters p2496 and
p2497).  What is no number (NaN, infinity) counts as 0 (assumed).
"""

from __future__ import annotations

import numpy as np

from pnfarm.table.compiling.compiled import inlined

__all__ = ["DEGREES", "DEGREES_A_SECOND", "FARTHEST", "PERCENT", "bits_of", "is_real", "real_of"]

#: Of one revolution, of 1 rpm, and of the whole ramp.
DEGREES = 360.0
DEGREES_A_SECOND = 6.0
PERCENT = 100.0
#: The farthest position, degrees (SINAMICS S200, p2580).
FARTHEST = 2_147_482_752.0
#: Exponent of an infinity, and of what is no number.
_NO_NUMBER = 0x7F80_0000


@inlined
def is_real(bits: int) -> bool:
    """Whether they are a finite number."""
    return bits & _NO_NUMBER != _NO_NUMBER


@inlined
def bits_of(value: float) -> int:
    """The 32 bits of a number, signed."""
    return int(np.int64(np.float32(value).view(np.int32)))


@inlined
def real_of(bits: int) -> float:
    """The number of these bits, as the process image has them."""
    return float(np.int32(bits).view(np.float32)) if is_real(bits) else 0.0
