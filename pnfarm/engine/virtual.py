"""Engines in virtual time: the same ticks, frames handed over in memory, time moved by the caller.

``run_virtual`` drives two tables (a farm and its controller) that are connected by an ideal wire: it
jumps from due time to due time, which makes an hour of quiet farm time cheap, and returns as soon as
something needs the event loop.
"""

from __future__ import annotations

from typing import Any

from pnfarm.engine.columns import RX_BATCH, Columns
from pnfarm.engine.held import sent_length
from pnfarm.engine.tick import next_due, receive, tick
from pnfarm.table.compiled import compiled

__all__ = ["deliver", "run_alone", "run_virtual"]


@compiled
def _place(
    sent: Any, frames: Any, ppm: Any, held: Any, slots: Any, lengths: Any, places: Any, times: Any,
    addresses: Any, ports: Any, first: int, count: int, now: int,
) -> tuple[int, int]:  # fmt: skip
    """Put frames of ``sent`` from ``first`` on into the receive slots until these are full; next frame, slots used."""
    waiting = 0
    while first < count and waiting < RX_BATCH:
        row = sent[first]
        first += 1
        frame = frames[row]
        length = sent_length(ppm, held, row)
        destination = 0
        for k in range(6):
            destination = (destination << 8) | int(frame[k])
        low = 0
        high = addresses.shape[0]
        while low < high:
            middle = (low + high) // 2
            if addresses[middle] < destination:
                low = middle + 1
            else:
                high = middle
        if low >= addresses.shape[0] or addresses[low] != destination:
            continue
        for k in range(length):
            slots[waiting, k] = frame[k]
        lengths[waiting] = length
        places[waiting] = ports[low]
        times[waiting] = now
        waiting += 1
    return first, waiting


@compiled
def deliver(sender: Columns, count: int, receiver: Columns, addresses: Any, ports: Any, now: int) -> int:
    """Pass ``count`` sent frames to ``receiver`` by destination address, as a switch does.

    ``addresses`` int64[n] sorted MAC numbers, ``ports`` int32[n] the receiver's ports.  When the receive
    slots are full they are processed at once.  Returns how many frames wait in the slots.
    """
    first = 0
    while True:
        first, waiting = _place(
            sender.tx_row, sender.frames, sender.ppm, sender.held, receiver.rx_frames, receiver.rx_length,
            receiver.rx_port, receiver.rx_ns, addresses, ports, first, count, now,
        )  # fmt: skip
        if first >= count:
            return int(waiting)
        receive(receiver, waiting)


@compiled
def run_alone(columns: Columns, now: int, until: int) -> int:
    """Tick one table without a peer up to ``until``; its frames are dropped.  Returns early at an event."""
    engine = columns.engine[0]
    head = engine.event_head
    while now < until and engine.event_head == head:
        now = min(next_due(columns, now), until)
        tick(columns, 0, now)
    return now


@compiled
def run_virtual(
    farm: Columns,
    controller: Columns,
    farm_addresses: Any,
    farm_ports: Any,
    controller_addresses: Any,
    controller_ports: Any,
    now: int,
    until: int,
) -> int:
    """Tick both tables from ``now`` up to ``until`` and return the time reached.

    Returns early when one of them wrote an event.  A frame sent in a tick arrives at the same virtual time:
    the controller's frames before the drives' tick, the drives' before the controller's next one.
    """
    farm_row = farm.engine[0]
    controller_row = controller.engine[0]
    farm_head = farm_row.event_head
    controller_head = controller_row.event_head
    waiting = 0
    while now < until and farm_row.event_head == farm_head and controller_row.event_head == controller_head:
        due = next_due(farm, now)
        other = next_due(controller, now)
        now = min(due, other, until)
        sent = tick(controller, waiting, now)
        arrived = deliver(controller, sent, farm, farm_addresses, farm_ports, now)
        sent = tick(farm, arrived, now)
        waiting = deliver(farm, sent, controller, controller_addresses, controller_ports, now)
    if waiting:
        receive(controller, waiting)
    return now
