"""Reads probes: values of fields of the table, of plain data, and of the plant, for traces and for the plant.

A value costs a few nanoseconds: a 64-bit word of a table is read, and the field cut out of it.  Fields of at most 8
octets lie within a word, because rows are aligned (:class:`pnfarm.table.layout.Layout`); the machine is little-endian.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pnfarm.engine.channels.plain_data import plain_number
from pnfarm.table.compiling.by_pointer import array_at
from pnfarm.table.compiling.compiled import compiled
from pnfarm.table.plant import PLANT
from pnfarm.table.trace import (
    NO_AGE,
    SOURCE_AXIS_INTEGER,
    SOURCE_AXIS_REAL,
    SOURCE_IMAGE_AGE,
    SOURCE_PLAIN_FLAG,
    SOURCE_PLAIN_REAL,
    SOURCE_PLAIN_SIGNED,
    SOURCE_PLAIN_UNSIGNED,
    SOURCE_PLANT,
)

__all__ = ["read_plain", "read_plant", "read_words"]

#: Octets of a number of double precision.
DOUBLE = 8
_PLANT, _REAL = PLANT.dtype, np.dtype(np.float64)


@compiled
def read_words(
    probes: Any, first: int, count: int, axis_reals: Any, axis_words: Any, image_words: Any, now: int
) -> None:
    """The present values of ``count`` probes but those of plain data and the plant; 0 of a place outside.

    One loop for all of them: a call for each value, with three arrays, would cost more than the value.
    """
    for number in range(first, first + count):
        probe = probes[number]
        word = int(probe.word)
        source = probe.source
        value = 0.0
        if source == SOURCE_AXIS_REAL:
            less = int(probe.less)
            if 0 <= word < axis_reals.shape[0] and less < axis_reals.shape[0]:
                value = float(axis_reals[word])
                if less >= 0:
                    value -= float(axis_reals[less])
        elif source >= SOURCE_PLANT:
            continue
        else:
            bits = 0
            if source == SOURCE_AXIS_INTEGER:
                if 0 <= word < axis_words.shape[0]:
                    bits = int(axis_words[word])
            elif 0 <= word < image_words.shape[0]:
                bits = int(image_words[word])
            if source == SOURCE_IMAGE_AGE:
                value = float(now - bits) if bits != 0 else NO_AGE
            else:
                sign = int(probe.sign)
                bits = (bits >> int(probe.shift)) & int(probe.mask)
                value = float((bits ^ sign) - sign)
        probe.value = value * float(probe.scale)


@compiled
def read_plain(probes: Any, first: int, count: int, provided: Any, consumed: Any) -> None:
    """The present values of those of ``count`` probes that are of plain data."""
    for number in range(first, first + count):
        probe = probes[number]
        source, row, octets = probe.source, int(probe.row), int(probe.octets)
        if source < SOURCE_PLAIN_UNSIGNED or not 0 <= row < provided.rows.shape[0]:
            continue
        stored = consumed if probe.received else provided
        bits = plain_number(stored, row, int(probe.word), octets, int(probe.big))
        if source == SOURCE_PLAIN_REAL:
            is_double = octets == DOUBLE
            value = float(np.uint64(bits).view(np.float64)) if is_double else float(np.uint32(bits).view(np.float32))
        elif source == SOURCE_PLAIN_SIGNED:
            spare = 64 - 8 * octets
            value = float(np.uint64(bits << np.uint64(spare)).view(np.int64) >> spare)
        elif source == SOURCE_PLAIN_FLAG:
            value = 1.0 if bits != 0 else 0.0
        else:
            value = float((bits >> np.uint64(probe.shift)) & np.int64(probe.mask).view(np.uint64))
        probe.value = value * float(probe.scale)


@compiled
def read_plant(probes: Any, first: int, count: int, row: int) -> None:
    """The present values of those of ``count`` probes that are of the plant, whose row has this address."""
    if row == 0:
        return
    plant = array_at(row, 1, _PLANT)[0]
    values = array_at(plant.value, plant.value_count, _REAL)
    for number in range(first, first + count):
        probe = probes[number]
        if probe.source == SOURCE_PLANT and 0 <= probe.word < values.shape[0]:
            probe.value = values[probe.word]
