"""Unsigned fields in arithmetic with signed numbers: compiled, a mixture of the two is a float."""

from __future__ import annotations

from typing import Any

import numpy as np

__all__ = ["signed"]

#: Makes a field a signed integer of 64 bits.
signed: Any = np.int64
