"""``pnfarm bench devices``: devices by a maker's file, with 32 octets of data each way, beside as many drives."""

from __future__ import annotations

from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pnfarm.bench.latency import API, Change, call, change_times, latency_rows
from pnfarm.bench.line import farm_and_plc, measure, memory_per_station, per_frame, settled_floor
from pnfarm.bench.result import WINDOWS, Result

if TYPE_CHECKING:
    from collections.abc import Callable
    from contextlib import AbstractContextManager
    from http.client import HTTPConnection

    from pnfarm.bench.line import Child
    from pnfarm.bench.load import Load

__all__ = ["devices"]

#: Devices, and drives beside them; their cycle.
COUNT, CYCLE, CYCLE_NS = 256, "4ms", 4_000_000
#: How often floor, drives and devices take turns: the goal compares them.
TURNS = 2
SIGNALS, DEVICE = "devices/island-0001/signals", "devices/island-0001"

DEVICES = f"""
devices:
  - name: island-{{{{n:04}}}}
    count: {{count}}
    gsdml: {Path(__file__).with_suffix(".gsdml.xml")}
    ip: 10.64.0.11/16
    signals:
      mark: {{{{at: 1.1.0, type: 'octets[4]', direction: input}}}}
"""


def _devices(number: int, api: str = "off") -> AbstractContextManager[tuple[Child, Child]]:
    return farm_and_plc(number, CYCLE, 64, api=api, stations=DEVICES)


def devices(seconds: float, load: Load) -> list[Result]:
    """CPU of a frame of 256 devices at 4 ms beside that of drives, their memory, and a signal's way to the wire."""
    turn = seconds / TURNS

    def floor() -> list[dict[str, float]]:
        return settled_floor(COUNT, CYCLE_NS // 1_000_000, 1_000_000, turn, load)

    def turned(ends: AbstractContextManager[tuple[Child, Child]]) -> list[dict[str, float]]:
        with ends as (farm, plc):
            return measure(farm, plc, turn, load, WINDOWS // TURNS)[0]

    low, ours, theirs = floor(), [], []
    for _ in range(TURNS):
        ours += turned(_devices(COUNT))
        theirs += turned(farm_and_plc(COUNT, CYCLE, 64))
        low += floor()
    device, drive, least = per_frame(ours), per_frame(theirs), per_frame(low)
    memory, beside, unit = memory_per_station(16, 16 + COUNT, load, _devices), device.over(drive), "us of CPU per frame"
    way = change_times(_devices(16, f"{API[0]}:{API[1]}"), DEVICE, _signal(), seconds, load)
    return [
        device.row("devices-256", unit, device.over(least)),
        drive.row("devices-256-drives", unit, drive.over(least)),
        least.row("devices-256-floor", unit, 1.0),
        Result("devices-256-ratio", beside, "device over drive", None, "<= 0.9", beside <= 0.9),
        Result("devices-memory", memory, "kB per device", None, "<= 60", 0 < memory <= 60),
        *latency_rows("devices-signal", way, CYCLE_NS),
    ]


def _signal() -> Change:
    """Each time other octets of the device's inputs; ``nothing`` are those that it has."""
    marks = (number.to_bytes(4, "big") for number in count(0xA5000000))
    now = next(marks)

    def write(api: HTTPConnection) -> Callable[[bytes], bool]:
        nonlocal now
        now = next(marks)
        again(api)
        return lambda frame: now in frame

    def again(api: HTTPConnection) -> Any:
        return call(api, "PATCH", SIGNALS, {"mark": now.hex()})

    return Change(write, write, again)
