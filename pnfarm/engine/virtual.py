"""Engines in virtual time: the same ticks, frames handed over in memory, time moved by the caller.

``run_virtual`` drives two tables (a farm and its controller) that are connected by an ideal wire: it
jumps from due time to due time, which makes an hour of quiet farm time cheap, and returns as soon as
something needs the event loop.
"""

from __future__ import annotations

from typing import Any

from pnfarm.engine.channels.delay_queue import sent_length
from pnfarm.engine.columns import RX_BATCH, Columns
from pnfarm.engine.mac import mac_at
from pnfarm.engine.search import first_not_below
from pnfarm.engine.tick import next_due, receive_at, tick
from pnfarm.table.channel import FRAME_SLOT
from pnfarm.table.compiling.compiled import compiled, inlined

__all__ = ["deliver", "run_alone", "run_virtual", "take"]


@inlined
def _announce(
    sender: Columns, first: int, count: int, receiver: Columns, addresses: Any, ports: Any, now: int
) -> tuple[int, int]:
    """Tell ``receiver`` of a batch of the frames sent, from ``first`` on; the next frame, and the size of the batch."""
    sent, frames = sender.tx_row, sender.frames
    places, lengths, ports_in, times = receiver.rx_place, receiver.rx_length, receiver.rx_port, receiver.rx_ns
    waiting = 0
    while first < count and waiting < RX_BATCH:
        row = sent[first]
        first += 1
        destination = mac_at(frames[row], 0)
        station = first_not_below(addresses, destination)
        if station >= addresses.shape[0] or addresses[station] != destination:
            continue
        places[waiting] = row * FRAME_SLOT
        lengths[waiting] = sent_length(sender.ppm, sender.held, row)
        ports_in[waiting] = ports[station]
        times[waiting] = now
        waiting += 1
    return first, waiting


@compiled
def deliver(sender: Columns, count: int, receiver: Columns, addresses: Any, ports: Any, now: int) -> int:
    """Pass ``count`` sent frames to ``receiver`` by destination address, as a switch does.

    ``addresses`` int64[n] sorted MAC numbers, ``ports`` int32[n] the receiver's ports.  Returns how many wait, where
    they were sent from, for :func:`take`: before the sender's next tick.  More than one batch is taken at once.
    """
    first = 0
    while True:
        first, waiting = _announce(sender, first, count, receiver, addresses, ports, now)
        if first >= count:
            return int(waiting)
        take(receiver, sender, waiting)


@compiled
def take(receiver: Columns, sender: Columns, count: int) -> None:
    """Take ``count`` frames that wait where ``sender`` sent them from."""
    if count > 0:
        receive_at(receiver, sender.frame_octets, receiver.rx_place, count)


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
        take(controller, farm, waiting)
        sent = tick(controller, 0, now)
        take(farm, controller, deliver(controller, sent, farm, farm_addresses, farm_ports, now))
        sent = tick(farm, 0, now)
        waiting = deliver(farm, sent, controller, controller_addresses, controller_ports, now)
    take(controller, farm, waiting)
    return now
