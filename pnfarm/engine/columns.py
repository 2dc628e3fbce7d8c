"""All columns together: allocated once, passed to compiled code as one named tuple."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pnfarm.firmware.axis import AXIS
from pnfarm.table.channel import CPM, FRAME_SLOT, OPEN, PPM
from pnfarm.table.compiling.by_address import link
from pnfarm.table.compiling.compiled import compiled, inlined
from pnfarm.table.condition import CONDITION, CONDITION_OP, MAX_CONDITIONS, MAX_OPERATIONS
from pnfarm.table.delay_queue import HELD
from pnfarm.table.engine_row import ENGINE, EVENT, EVENTS
from pnfarm.table.image import IMAGE
from pnfarm.table.impairment import IMPAIRMENT
from pnfarm.table.late import LATE, LATE_ROWS
from pnfarm.table.observed import OBSERVED
from pnfarm.table.plain_data import CONSUMED, PIECE, PROVIDED, PlainRows, allocate_plain
from pnfarm.table.program import PROGRAM
from pnfarm.table.trace import MAX_PROBES, MAX_TRACES, PROBE, RING_VALUES, TRACE

__all__ = ["CHANGED_AT", "RX_BATCH", "Columns", "allocate", "lookup_find", "lookup_rebuild"]

#: Frames received per batch.
RX_BATCH = 256
#: Where the copy of a received frame begins that an impairment changes.
CHANGED_AT = RX_BATCH * FRAME_SLOT
#: Look-up tables in rotation: a rebuild never touches the one in force, nor its two predecessors.
_LOOKUPS = 4
#: Slots for held frames, for each direction and channel, and the fewest of all; memory that is not used costs nothing.
HELD_PER_CHANNEL = 64
FEWEST_HELD = 256


class Columns(NamedTuple):
    """The table: record arrays, then the frame store, then the inputs and outputs of one tick.

    ================  ==========================  ======================================================
    field             shape                       meaning
    ================  ==========================  ======================================================
    ``frames``        (providers + held,          octets of each provider's frame, row for row, then of each
                      FRAME_SLOT)                 held frame
    ``frame_octets``  (octets of all frames,)     the same memory
    ``held_order``    (2, held / 2)               slots of held frames by direction
    (:mod:`pnfarm.engine.channels.delay_queue`)
    ``lookup``        (4, size, 2)                hash tables ``port << 32 | frame id`` -> consumer row + 1
    ``rx_frames``     (RX_BATCH, FRAME_SLOT)      frames received
    ``rx_octets``     (CHANGED_AT + FRAME_SLOT,)  the same memory, then the copy of one that an
                                                  impairment changes
    ``rx_slot``       (RX_BATCH,)                 where each begins in it
    ``rx_place``      (RX_BATCH,)                 where each frame of a batch begins in a socket's ring, or among
                                                  the frames of another table
    ``rx_length``     (RX_BATCH,)                 their lengths, octets
    ``rx_port``       (RX_BATCH,)                 their ports
    ``rx_ns``         (RX_BATCH,)                 their arrival, ns
    ``tx_row``        (providers * 2 + held / 2,) rows of ``frames`` to send, in order
    ``trace_ring``    (RING_VALUES,)              samples of the traces, float64
    ``axis_reals``    (axes * words of a row,)    the memory of ``axis`` as float64, for traces and
                                                  conditions
    ``axis_words``    (axes * words of a row,)    the same as int64
    ``image_words``   (images * words,)           the memory of ``image`` as int64
    ================  ==========================  ======================================================
    """

    engine: Any
    axis: Any
    image: Any
    program: Any
    ppm: Any
    cpm: Any
    impairment: Any
    held: Any
    held_order: Any
    events: Any
    frames: Any
    frame_octets: Any
    lookup: Any
    rx_frames: Any
    rx_octets: Any
    rx_slot: Any
    rx_place: Any
    rx_length: Any
    rx_port: Any
    rx_ns: Any
    tx_row: Any
    late: Any
    observed: Any
    trace: Any
    probe: Any
    trace_ring: Any
    axis_reals: Any
    axis_words: Any
    image_words: Any
    condition: Any
    condition_op: Any
    provided: PlainRows
    consumed: PlainRows
    piece: Any


def allocate(
    *,
    images: int,
    axes: int = 0,
    programs: int = 0,
    channels: int = 0,
    impairments: int = 0,
    plain: int = 0,
    pieces: int = 0,
    traces: bool = False,
) -> Columns:
    """A zeroed table.

    ``images``: process images, one for each axis and one for each station without, after them; ``axes`` and
    ``programs`` (both index images), ``channels`` providers and as many consumers, ``impairments`` rows for faults,
    ``plain`` stations with plain data, which have so many ``pieces`` in frames, with ``traces`` the room for these and
    for conditions of injections.
    Compiles what takes a table, if it is not cached.
    """
    link()
    channels = max(1, channels)
    size = 64
    while size < channels * 4:
        size *= 2
    waiting = max(FEWEST_HELD, channels * HELD_PER_CHANNEL) if impairments else 1
    axis, image = AXIS.allocate(max(1, axes)), IMAGE.allocate(max(1, images))
    frame_octets = np.zeros((channels + 2 * waiting) * FRAME_SLOT, np.uint8)
    rx_octets = np.zeros(CHANGED_AT + FRAME_SLOT, np.uint8)
    columns = Columns(
        engine=ENGINE.allocate(1),
        axis=axis,
        image=image,
        program=PROGRAM.allocate(max(1, programs)),
        ppm=PPM.allocate(channels),
        cpm=CPM.allocate(channels),
        impairment=IMPAIRMENT.allocate(max(1, impairments)),
        held=HELD.allocate(2 * waiting),
        held_order=np.arange(2 * waiting, dtype=np.int32).reshape(2, waiting),
        events=EVENT.allocate(EVENTS),
        frames=frame_octets.reshape(-1, FRAME_SLOT),
        frame_octets=frame_octets,
        lookup=np.zeros((_LOOKUPS, size, 2), np.int64),
        rx_frames=rx_octets[:CHANGED_AT].reshape(RX_BATCH, FRAME_SLOT),
        rx_octets=rx_octets,
        rx_slot=np.arange(RX_BATCH, dtype=np.int64) * FRAME_SLOT,
        rx_place=np.zeros(RX_BATCH, np.int64),
        rx_length=np.zeros(RX_BATCH, np.int32),
        rx_port=np.zeros(RX_BATCH, np.int32),
        rx_ns=np.zeros(RX_BATCH, np.int64),
        tx_row=np.zeros(channels * 2 + waiting, np.int32),
        late=LATE.allocate(LATE_ROWS),
        observed=OBSERVED.allocate(max(1, axes)),
        trace=TRACE.allocate(MAX_TRACES if traces else 1),
        probe=PROBE.allocate(MAX_PROBES if traces else 1),
        trace_ring=np.zeros(RING_VALUES if traces else 1),
        axis_reals=axis.view(np.ndarray).view(np.float64),
        axis_words=axis.view(np.ndarray).view(np.int64),
        image_words=image.view(np.ndarray).view(np.int64),
        condition=CONDITION.allocate(MAX_CONDITIONS if traces else 1),
        condition_op=CONDITION_OP.allocate(MAX_OPERATIONS if traces else 1),
        provided=allocate_plain(PROVIDED, max(1, plain)),
        consumed=allocate_plain(CONSUMED, max(1, plain)),
        piece=PIECE.allocate(max(1, pieces)),
    )
    engine = columns.engine[0]
    engine.axis_rows = axes
    engine.program_rows = programs
    engine.tick_ns = 1_000_000
    columns.image.good[:] = 1
    return columns


@compiled
def _slot(key: int, mask: int) -> int:
    # Fibonacci hashing; bits 40 and up depend on the port and on the frame id, and not on the sign
    return ((key * 0x1E3779B97F4A7C15) >> 40) & mask


@compiled
def lookup_rebuild(columns: Columns) -> None:
    """Hash all active consumers into the next table in rotation and put it in force.

    Called by the event loop while the engine reads the table in force; the engine checks every hit
    against the row itself, so that a reader of an old table sees at worst an unknown frame.
    """
    engine = columns.engine[0]
    which = (engine.lookup + 1) % columns.lookup.shape[0]
    table = columns.lookup[which]
    mask = table.shape[0] - 1
    table[:, :] = 0
    for row in range(engine.cpm_rows):
        consumer = columns.cpm[row]
        if consumer.active != OPEN:
            continue
        key = (int(consumer.port) << 32) | int(consumer.frame_id)
        slot = _slot(key, mask)
        while table[slot, 1] != 0:
            slot = (slot + 1) & mask
        table[slot, 0] = key
        table[slot, 1] = row + 1
    engine.lookup = which


@inlined
def lookup_find(table: Any, consumers: Any, port: int, frame_id: int, destination: int) -> int:
    """The active consumer of a frame id or connection id at ``port`` by one look-up ``table``, or -1.

    ``destination`` is the frame's address as a number: producers of multicasts choose their connection ids themselves,
    so that two of them may have the same one, each in its own group.
    """
    mask = table.shape[0] - 1
    key = (int(port) << 32) | int(frame_id)
    slot = _slot(key, mask)
    for _ in range(mask + 1):
        row = table[slot, 1]
        if row == 0:
            return -1
        if table[slot, 0] == key:
            row -= 1
            if row < consumers.shape[0]:
                consumer = consumers[row]
                known = consumer.active == OPEN and consumer.port == port and consumer.frame_id == frame_id
                if known and consumer.destination == destination:
                    return row
        slot = (slot + 1) & mask
    return -1
