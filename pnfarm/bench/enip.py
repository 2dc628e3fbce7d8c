"""``pnfarm bench enip-64``: 64 drives on EtherNet/IP with cyclic data at 10 ms, beside the same packets alone."""

from __future__ import annotations

import statistics
import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.bench.line import (
    FARM_CPU,
    PARENT,
    PEER,
    PEER_CPU,
    Child,
    both_ends,
    cores,
    expirations,
    measure,
    memory_per_station,
    settled_floor,
)
from pnfarm.bench.result import Result, Windows

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from pnfarm.bench.load import Load

__all__ = ["cyclic_packet", "enip_64"]

DRIVES, RPI_NS = 64, 10_000_000
#: The engine's ticks: it spreads the drives' packets over them.
TICK_NS = 1_000_000
#: Drives whose memory is compared.
FEW, MANY = 16, 144

FILE = """
farm: bench
link: {{kind: macvlan, parent: {parent}}}
api: off
realtime: {{cpu: {cpu}}}
drives:
  - name: axis-{{n:04}}
    count: {drives}
    model: akd-ethernetip
    ip: 10.64.0.11/16
controller:
  name: plc
  ip: 10.64.255.250/16
  mac: 02:00:00:00:fa:01
  link: {{kind: macvlan, parent: {peer}}}
  rpi: 10ms
  timeout_multiplier: 64
  program: {{kind: sine, speed_rpm: 600, period: 4s, acknowledge_after: 100ms}}
"""


def _file(drives: int, cpu: int) -> str:
    return FILE.format(parent=PARENT, peer=PEER, drives=drives, cpu=cpu)


def _ends(drives: int) -> AbstractContextManager[tuple[Child, Child]]:
    return both_ends(drives, _file(drives, FARM_CPU), _file(drives, PEER_CPU))


def cyclic_packet() -> bytes:
    """A class 1 packet of a drive's connection, from the EtherType on; its addresses are no station's."""
    octets = 66
    data = struct.pack("<HHHIIHH", 2, 0x8002, 8, 1, 1, 0xB1, octets) + bytes(octets)
    udp = struct.pack("!HHHH", 2222, 2222, 8 + len(data), 0) + data
    addresses = bytes((10, 65, 0, 1, 10, 65, 0, 2))
    return struct.pack("!HBBHHHBBH", 0x0800, 0x45, 0, 20 + len(udp), 0, 0, 64, 17, 0) + addresses + udp


@dataclass(frozen=True, slots=True)
class _Production:
    """How punctual the drives' packets were, by their arrival.

    ``mean_ns``: the mean interval without skipped cycles.
    ``drift_ns``: how far the packets of a drive moved against the grid of their
    interval, the median of all drives.  ``skipped``: cycles for which the farm was too late: the machine stalled.
    """

    mean_ns: float
    drift_ns: float
    skipped: int


def _exchanged(farm: Child, plc: Child, seconds: float, load: Load) -> tuple[Windows, _Production]:
    """The farm's cores meanwhile, and how punctual it was."""
    skipped, before = farm.told("punctuality")["skipped"], plc.told("punctuality")
    ours, _ = measure(farm, plc, seconds, load)
    after, skipped = plc.told("punctuality"), farm.told("punctuality")["skipped"] - skipped
    took = [b - a for a, b in zip(before["interval_ns"], after["interval_ns"], strict=True)]
    intervals = sum(after["intervals"]) - sum(before["intervals"])
    moved = [(one + RPI_NS // 2) % RPI_NS - RPI_NS // 2 for one in took if one]
    production = _Production(sum(took) / (intervals + skipped), statistics.median(map(abs, moved)), skipped)
    return cores(ours), production


def enip_64(seconds: float, load: Load) -> list[Result]:
    """64 drives on EtherNet/IP at 10 ms on one core, beside the same packets in a minimal loop."""
    packet, groups = cyclic_packet(), RPI_NS // TICK_NS

    def floor() -> list[dict[str, Any]]:
        return settled_floor(DRIVES, groups, TICK_NS, min(5.0, seconds), load, packet=packet)

    first = floor()
    with _ends(DRIVES) as (farm, plc):
        before = expirations(farm, plc)
        used, production = _exchanged(farm, plc, seconds, load)
        lost = expirations(farm, plc) - before
    low = cores(first + floor())
    core, ratio = used.median, used.over(low)
    off, memory = (production.mean_ns / RPI_NS - 1) * 100, memory_per_station(FEW, MANY, load, _ends)
    drift = production.drift_ns / 1e6
    return [
        used.row("enip-64-cpu", "cores", ratio, "< 0.15", core < 0.15),
        low.row("enip-64-floor", "cores", 1.0),
        Result("enip-64-ratio", ratio, "cores of farm over floor", None, "<= 1.3", ratio <= 1.3),
        Result("enip-64-interval", off, "% off the RPI, mean", None, "within 0.1", abs(off) <= 0.1),
        Result("enip-64-drift", drift, f"ms in {seconds:g} s", None, "< 1", drift < 1),
        Result("enip-64-skipped", production.skipped, f"cycles in {seconds:g} s", None, "none", True),
        Result("enip-64-expirations", lost, f"in {seconds:g} s", None, "0", lost == 0),
        Result("enip-64-memory", memory, "kB per drive", None, "<= 200", 0 < memory <= 200),
    ]
