"""Frames that wait in the store (:mod:`pnfarm.table.delay_queue`): a heap by due time, without an allocation.

A row of ``held_order`` is a permutation of the slots of one direction: first the ``count`` waiting ones as a heap, then
``busy`` ones that were taken out in this tick and whose octets are still to be sent, then the free ones.
"""

from __future__ import annotations

from typing import Any

from pnfarm.engine.signed import signed
from pnfarm.table.compiling.compiled import compiled, inlined

__all__ = ["copy_octets", "forget", "free_slot", "put", "release_all", "sent_length", "sent_port", "take_first"]


@compiled
def sent_length(ppm: Any, held: Any, row: int) -> int:
    """Octets of the frame in a row of the frame store."""
    return signed(ppm[row].length) if row < ppm.shape[0] else signed(held[row - ppm.shape[0]].length)


@compiled
def sent_port(ppm: Any, held: Any, row: int) -> int:
    """Where the frame in a row of the frame store goes out; a held one always at its port."""
    if row >= ppm.shape[0]:
        return signed(held[row - ppm.shape[0]].port)
    return signed(ppm[row].exit) if ppm[row].exit != 0 else signed(ppm[row].port)


@inlined
def copy_octets(place: Any, frame: Any, length: int) -> None:
    """Copy the first ``length`` octets of a frame into another row of the store.

    A slice would do the same, but with it comes the text of an error about shapes: a second of the compiler's time.
    """
    for i in range(min(length, place.shape[0], frame.shape[0])):
        place[i] = frame[i]


@inlined
def _before(held: Any, one: int, other: int) -> bool:
    if held[one].due_ns != held[other].due_ns:
        return bool(held[one].due_ns < held[other].due_ns)
    return bool(held[one].number < held[other].number)


@inlined
def _sink(held: Any, order: Any, place: int, count: int) -> None:
    while True:
        child = 2 * place + 1
        if child >= count:
            return
        if child + 1 < count and _before(held, order[child + 1], order[child]):
            child += 1
        if not _before(held, order[child], order[place]):
            return
        slot = order[place]
        order[place] = order[child]
        order[child] = slot
        place = child


@inlined
def free_slot(order: Any, count: int, busy: int) -> int:
    """A free slot, which stays free until :func:`put`; -1 when all are in use."""
    return int(order[count + busy]) if count + busy < order.shape[0] else -1


@compiled
def put(held: Any, order: Any, count: int, busy: int) -> None:
    """Let the slot that :func:`free_slot` returned wait; the caller counts it."""
    slot = order[count + busy]
    order[count + busy] = order[count]
    order[count] = slot
    place = count
    while place > 0:
        parent = (place - 1) // 2
        if not _before(held, order[place], order[parent]):
            return
        slot = order[place]
        order[place] = order[parent]
        order[parent] = slot
        place = parent


@inlined
def take_first(held: Any, order: Any, count: int, impairments: Any) -> int:
    """Take the first of ``count`` waiting slots out; it is then the first busy one."""
    slot = int(order[0])
    order[0] = order[count - 1]
    order[count - 1] = slot
    _sink(held, order, 0, count - 1)
    if held[slot].impairment > 0:
        row = impairments[held[slot].impairment - 1]
        if row.uses == held[slot].uses:
            row.waiting -= 1
    return slot


@inlined
def release_all(held: Any, order: Any, count: int, impairments: Any, before: int) -> None:
    """Frames whose impairment has ended were due at a time ``before`` all new ones, in their order."""
    for i in range(count):
        item = held[order[i]]
        if item.impairment > 0 and impairments[item.impairment - 1].uses != item.uses:
            item.due_ns = min(item.due_ns, before)
    for i in range(count // 2 - 1, -1, -1):
        _sink(held, order, i, count)


@inlined
def forget(held: Any, order: Any, count: int, row: int) -> None:
    """The channel ``row`` was closed: drop what waits for it."""
    for i in range(count):
        if held[order[i]].row == row:
            held[order[i]].row = -1
