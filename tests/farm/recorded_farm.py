"""A capture of two drives and their controller under faults, and any frames put into words."""

from __future__ import annotations

from pnfarm.buses.registry import decoder as make_decoder
from pnfarm.controller.line import VirtualLine

FARM = """
farm: line-1
link: {kind: memory}
drives:
  - {name: 'axis-{n:02}', count: 2, model: akd-profinet, ip: 10.77.0.11/24}
controller:
  name: plc
  ip: 10.77.0.1/24
  cycle: 16ms
  watchdog_factor: 3
  program: {kind: sine, speed_rpm: 60, period: 2s, acknowledge_after: 200ms}
  reconnect: {after: 300ms}
  records:
    - {api: 14848, slot: 1, subslot: 1, index: 0xB02E, data: "01020001 1001 03A2 0000 4201 0002"}
"""


def under_faults(line: VirtualLine) -> None:
    faults = line.farm.injections
    faults.inject({"kind": "f702", "on": "axis-01"}, line.world.now)
    line.world.run(1.0)
    lost = {"kind": "loss", "on": "axis-02", "direction": "out", "probability": 1, "count": 2}
    faults.inject(lost, line.world.now)
    line.world.run(0.5)
    faults.inject({"kind": "provider-stop", "on": "axis-02", "for": "100ms"}, line.world.now)
    line.world.run(0.5)
    faults.inject({"kind": "timeout", "on": "axis-02"}, line.world.now)
    line.world.run(2.0)
    line.plc.release(line.world.now)
    line.world.run(1.0, until=lambda: line.plc.all_stopped)


def described(frames) -> list[str]:
    decoder = make_decoder()
    return [f"{x.description.what} {x.description.text}" for frame in frames for x in decoder.feed(frame)]
