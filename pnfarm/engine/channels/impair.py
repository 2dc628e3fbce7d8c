"""The only place where impairments change cyclic frames.

A frame that is delayed, copied, or changed where the engine does not fill it anew each cycle goes through the store of
held frames (:mod:`pnfarm.engine.channels.delay_queue`); when that is full, the frame is lost.  Unsigned fields are made
``signed`` where they meet signed numbers: compiled, a mixture is a float.
"""

from __future__ import annotations

from typing import Any

from pnfarm.engine.channels import framing
from pnfarm.engine.channels.delay_queue import copy_octets, free_slot, put
from pnfarm.engine.signed import signed
from pnfarm.table.channel import IOXS_BAD, STATUS_RUN, STATUS_VALID
from pnfarm.table.compiling.compiled import compiled, inlined
from pnfarm.table.delay_queue import INWARD, OUTWARD
from pnfarm.table.impairment import (
    ALWAYS,
    BURST,
    CORRUPT,
    COUNT_FREEZE,
    COUNT_SKIP,
    COUNTER_FREEZE,
    COUNTER_JUMP,
    DATA_INVALID,
    DELAY,
    DUPLICATE,
    FRAME_ID,
    INDEPENDENT,
    IOCS_BAD,
    IOPS_BAD,
    LATE,
    LENGTH,
    LOSS,
    PROVIDER_STOP,
    REORDER,
    THROTTLE,
)
from pnfarm.table.signals import PART_HIGH, WORD_NONE
from pnfarm.wire.ethernet import ETHERTYPE_VLAN

__all__ = ["GOES_ON", "HELD", "IS_LOST", "WAS_CHANGED", "chosen", "impair_received", "impair_sent"]

# What becomes of a frame.
GOES_ON = 0
WAS_CHANGED = 1
HELD = 2
IS_LOST = 3

#: Octets that a frame takes on the line beside its own: preamble, FCS, gap.
LINE_OCTETS = 24
#: Largest count of a sign of life, which is followed by 1 (PROFIdrive 4.2).
LARGEST_COUNT = 15


@inlined
def _random32(row: Any) -> int:
    """xorshift64*: the next 32 random bits of this row's own sequence."""
    x = int(row.random) & 0x7FFFFFFFFFFFFFFF
    x ^= x >> 12
    x ^= (x << 25) & 0x7FFFFFFFFFFFFFFF
    x ^= x >> 27
    row.random = x
    return (x >> 16) & 0xFFFFFFFF


@inlined
def _meets(row: Any, threshold: int) -> bool:
    return threshold == ALWAYS or _random32(row) < threshold


@compiled
def chosen(row: Any) -> bool:
    """Whether the present frame is hit, by the row's model."""
    if row.model == INDEPENDENT:
        return _meets(row, int(row.threshold))
    if row.model == BURST:
        if row.left > 0:
            row.left -= 1
            return True
        if not _meets(row, int(row.threshold)):
            return False
        row.left = max(1, signed(row.burst)) - 1
        return True
    if row.left > 0:
        if _meets(row, int(row.leave)):
            row.left = 0
    elif _meets(row, int(row.enter)):
        row.left = 1
    return _meets(row, int(row.hit_bad) if row.left > 0 else int(row.hit_good))


@inlined
def _in_force(impairments: Any, row: Any, now: int) -> bool:
    """Whether this impairment may act on the present frame; counts that it was checked."""
    if now < row.start_ns or (row.stop_ns != 0 and now >= row.stop_ns):
        return False
    if row.limit != 0:
        used = row.activations
        if row.shares > 0:
            used += impairments[row.shares - 1].activations
        if used >= row.limit:
            return False
    row.checks += 1
    return bool(row.checks > row.after)


@compiled
def _count(row: Any, now: int) -> None:
    """The present frame is hit."""
    if row.activations == 0:
        row.first_ns = now
    row.activations += 1
    row.last_ns = now


@inlined
def _activates(impairments: Any, row: Any, now: int) -> bool:
    """Whether this impairment acts on the present frame; counts the evidence."""
    if not _in_force(impairments, row, now) or not chosen(row):
        return False
    _count(row, now)
    return True


@inlined
def _corrupt(row: Any, frame: Any, length: int) -> None:
    """Invert ``amount`` different bits, one in each of as many equal parts of the frame."""
    first = 0
    if row.whole == 0:
        first = 14
        if ((int(frame[12]) << 8) | int(frame[13])) == ETHERTYPE_VLAN:
            first = 18
    part = (length - first) * 8 // max(1, int(row.amount))
    for i in range(row.amount):
        if part > 0:
            bit = i * part + signed(_random32(row)) % part
            frame[first + (bit >> 3)] ^= 0x80 >> (bit & 7)
    if row.mends:
        framing.mend(frame, length)


@inlined
def _word_place(channel: Any, slot: int) -> int:
    """Offset of the word of a signal, as in the row; -1 when the telegram has none."""
    for i in range(channel.words):
        code = int(channel.word_code[i])
        if code != WORD_NONE and code >> 2 == slot and code & 3 != PART_HIGH:
            return signed(channel.word_offset[i])
    return -1


@inlined
def _change_life(impairments: Any, row: Any, frame: Any, place: int, now: int) -> bool:
    """Let the count in bits 12..15 of the word at ``place`` stand or skip; a frame without a count is left alone."""
    count = signed(frame[place]) >> 4
    if count == 0:
        return False
    hit = _activates(impairments, row, now)
    if row.kind == COUNT_SKIP:
        if hit:
            row.kept = (max(0, int(row.kept)) + int(row.amount)) % LARGEST_COUNT
        if row.kept <= 0:
            return hit
        count = 1 + (count - 1 + int(row.kept)) % LARGEST_COUNT
    elif hit:
        if row.kept < 0:
            row.kept = count
        count = int(row.kept)
    frame[place] = (count << 4) | (signed(frame[place]) & 0x0F)
    return hit


@compiled
def _wait(impairments: Any, row: Any, due: int, length: int, cycle_ns: int, now: int) -> int:
    """When a frame that would go on at ``due`` does after this row; -1 when it is lost."""
    if row.kind == THROTTLE:
        starts = max(due, int(row.free_ns))
        if not _in_force(impairments, row, now):
            # behind those that wait
            return starts
        if starts > due:
            _count(row, now)
        if starts - due > row.delay_ns:
            return -1
        row.free_ns = starts + int((length + LINE_OCTETS) * row.octet_ns)
        return starts
    if not _activates(impairments, row, now):
        if row.kind == DELAY and row.overtakes == 0:
            return max(due, int(row.free_ns))
        return due
    if row.kind == REORDER:
        return due + int(row.amount) * cycle_ns + cycle_ns // 2
    due += int(row.delay_ns)
    if row.jitter_ns > 0:
        due += int(row.jitter_ns * (_random32(row) / 4294967296.0))
    if row.overtakes == 0:
        due = max(due, int(row.free_ns))
    row.free_ns = due
    return due


@compiled
def _hold(
    engine: Any,
    impairments: Any,
    held: Any,
    order: Any,
    waiting: int,
    busy: int,
    slot: int,
    owner: int,
    due: int,
    row: int,
    generation: int,
    length: int,
    place: int,
    port: int,
) -> None:
    """Let the frame in this slot wait; the caller counts it."""
    item = held[slot]
    item.due_ns = due
    item.number = engine.held
    engine.held += 1
    item.row = row
    item.generation = generation
    item.length = length
    item.place = place
    item.port = port
    item.impairment = owner
    if owner > 0:
        item.uses = impairments[owner - 1].uses
        impairments[owner - 1].waiting += 1
    put(held, order, waiting, busy)


@inlined
def impair_received(
    engine: Any,
    impairments: Any,
    consumer: Any,
    held: Any,
    orders: Any,
    frames: Any,
    store: int,
    number: int,
    frame: Any,
    length: int,
    place: int,
    data: int,
    now: int,
) -> int:
    """What becomes of a frame on its way in; ``store`` is the first row of held frames in ``frames``."""
    outcome = GOES_ON
    due = now
    copies = 0
    owner = 0
    link = consumer.impairment
    while link > 0:
        row = impairments[link - 1]
        if row.kind == LOSS:
            if _activates(impairments, row, now):
                outcome = IS_LOST
        elif row.kind in (COUNT_FREEZE, COUNT_SKIP):
            word = _word_place(consumer, int(row.slot))
            if word >= 0:
                _change_life(impairments, row, frame, data + word, now)
        elif row.kind == CORRUPT:
            if _activates(impairments, row, now):
                _corrupt(row, frame, length)
                outcome = max(outcome, WAS_CHANGED)
        elif row.kind == DUPLICATE:
            if _activates(impairments, row, now):
                copies += int(row.amount)
                owner = link
        elif row.kind in (DELAY, REORDER, THROTTLE):
            later = _wait(impairments, row, due, length, int(consumer.cycle_ns), now)
            if later < 0:
                outcome = IS_LOST
            elif later > due:
                due = later
                owner = link
        link = row.next
    if outcome == IS_LOST or (due == now and copies == 0):
        return outcome
    order = orders[INWARD]
    for copy in range(copies + 1 if due > now else copies):
        slot = free_slot(order, int(engine.held_in), 0)
        if slot < 0:
            impairments[owner - 1].overflows += 1
            if due > now and copy == 0:
                return IS_LOST
            break
        copy_octets(frames[store + slot], frame, length)
        _hold(
            engine, impairments, held, order, int(engine.held_in), 0, slot, owner, due, number,
            int(consumer.generation), length, place, 0,
        )  # fmt: skip
        engine.held_in += 1
    return HELD if due > now else outcome


@compiled
def impair_sent(
    engine: Any,
    impairments: Any,
    provider: Any,
    held: Any,
    orders: Any,
    frames: Any,
    store: int,
    number: int,
    now: int,
) -> int:
    """Change the provider's frame, or a copy of it that leaves instead; what becomes of the one in its row."""
    lost = False
    due = now
    copies = 0
    owner = 0
    slot = -1
    frame = frames[number]
    length = signed(provider.length)
    order = orders[OUTWARD]
    link = provider.impairment
    while link > 0:
        row = impairments[link - 1]
        kind = row.kind
        if kind in (COUNT_FREEZE, COUNT_SKIP):
            word = _word_place(provider, int(row.slot))
            if word >= 0:
                _change_life(impairments, row, frame, word, now)
        elif kind in (DELAY, REORDER, THROTTLE):
            later = _wait(impairments, row, due, length, int(provider.cycle_ns), now)
            if later < 0:
                lost = True
            elif later > due:
                due = later
                owner = link
        elif kind == LATE and now < row.free_ns:
            lost = True
        elif _activates(impairments, row, now):
            if kind in (IOCS_BAD, FRAME_ID, LENGTH, CORRUPT) and slot < 0:
                # what the engine does not fill anew must not be changed in the provider's own frame
                slot = free_slot(order, int(engine.held_out), int(engine.busy_out))
                if slot < 0:
                    row.overflows += 1
                    return IS_LOST
                copy_octets(frames[store + slot], frame, length)
                frame = frames[store + slot]
            if kind == LOSS:
                lost = True
            elif kind == IOPS_BAD:
                for i in range(provider.statuses):
                    frame[provider.status_offset[i]] = IOXS_BAD
            elif kind == PROVIDER_STOP:
                framing.change_status(provider, frame, length, STATUS_RUN)
            elif kind == DATA_INVALID:
                framing.change_status(provider, frame, length, STATUS_VALID)
            elif kind == IOCS_BAD:
                for i in range(provider.iocs_count):
                    frame[provider.iocs_offset[i]] = IOXS_BAD
            elif kind == COUNTER_FREEZE:
                if row.kept < 0:
                    row.kept = framing.count_of(provider, frame, length, signed(row.whole))
                framing.change_count(provider, frame, length, int(row.kept), signed(row.whole))
            elif kind == COUNTER_JUMP:
                count = framing.count_of(provider, frame, length, signed(row.whole)) + int(row.amount)
                framing.change_count(provider, frame, length, count, signed(row.whole))
            elif kind == FRAME_ID:
                framing.change_id(provider, frame, length, int(row.amount), row.whole != 0)
            elif kind == LENGTH:
                length = framing.resize(provider, frame, length, int(row.amount))
            elif kind == CORRUPT:
                _corrupt(row, frame, length)
            elif kind == DUPLICATE:
                copies += int(row.amount)
                owner = link
            elif kind == LATE:
                due += int(row.delay_ns)
                row.free_ns = due
                owner = link
        link = row.next
    if lost:
        return IS_LOST
    whole = slot >= 0 or due > now
    if not whole and copies == 0:
        return GOES_ON
    for copy in range(copies + 1 if whole else copies):
        slot = free_slot(order, int(engine.held_out), int(engine.busy_out))
        if slot < 0:
            if owner > 0:
                impairments[owner - 1].overflows += 1
            if whole and copy == 0:
                return IS_LOST
            break
        # the first one may be the copy that was changed, in its own slot
        copy_octets(frames[store + slot], frame, length)
        _hold(
            engine, impairments, held, order, int(engine.held_out), int(engine.busy_out), slot, owner, due, number, 0,
            length, 0, int(provider.port),
        )  # fmt: skip
        engine.held_out += 1
    return HELD if whole else GOES_ON
