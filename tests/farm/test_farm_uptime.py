"""Farms that have run for weeks: clocks pass the ends of counters of 32 bits, on all buses, without a sign of it."""

from __future__ import annotations

from functools import partial

import pytest

from pnfarm.controller import line as controller_line
from pnfarm.farm.virtual import VirtualWorld
from pnfarm.testing import Line

FILE = """
farm: uptime
link: {kind: memory}
drives:
  - {name: akd, model: akd-profinet, ip: 10.77.0.11/23, cycle: 16ms}
  - {name: e1, model: hiwin-e1, ip: 10.77.0.31/23, cycle: 4ms}
  - {name: msd, model: moog-msd, ip: 10.77.0.51/23, cycle: 4ms}
  - {name: eip, model: akd-ethernetip, ip: 10.77.0.71/23}
  - {name: dp, model: moog-msd-dp, address: 11}
plant:
  models: [{name: valve, kind: cylinder, time: 100ms}]
controller:
  name: plc
  ip: 10.77.1.250/23
  cycle: 16ms
  watchdog_factor: 3
  program: {kind: constant, speed_rpm: 600, acknowledge_after: 100ms}
  ethernetip: {ip: 10.77.1.251/23, rpi: 10ms}
  profibus: {address: 1, cycle: 20ms, watchdog: 60ms}
"""
MS = 1_000_000
#: What counts how long a station is on: milliseconds and hundredths of a second, with a sign and without, microseconds.
ENDS = {
    "24.9 days": 2**31 * MS, "49.7 days": 2**32 * MS, "497 days": 2**32 * 10 * MS, "71.6 minutes": 2**32 * 1000,
}  # fmt: skip
STATIONS = ("akd", "e1", "msd", "eip", "dp")


@pytest.mark.parametrize("end", ENDS.values(), ids=ENDS)
def test_no_connection_notices_that_a_counter_of_the_time_ends(monkeypatch, end):
    # both sides are on for a while, and the end comes in the midst of operation and of a fault
    monkeypatch.setattr(controller_line, "VirtualWorld", partial(VirtualWorld, end - 6000 * MS))
    with Line.from_text(FILE) as line:
        assert line.wait_running(5.5) < 5.5
        line.run((end - 1000 * MS - line.now_ns) / 1e9)
        count = len(line.events("ar aborted"))
        fault = line.inject("delay", "akd", delay="2ms", **{"for": "2s"})
        for _ in range(20):
            line.run(0.1)
            assert {drive.name: drive.state for drive in line.drives} == dict.fromkeys(STATIONS, "S4")
        assert line.now_ns > end + 900 * MS
        line.wait_until(lambda: fault.state == "ended", within=1)
        assert len(line.events("ar aborted")) == count == 0
        # and connections are set up again behind it
        line.inject("silence", "all", **{"for": "500ms"})
        line.wait_until(lambda: not any(drive.connected for drive in line.drives), within=2)
        line.wait_running(20)
