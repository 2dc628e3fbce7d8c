"""Farms that have run for weeks: clocks pass the ends of counters of 32 bits, on all buses, without a sign of it."""

from functools import partial

import pytest

from pnfarm.controller import line as controller_line
from pnfarm.farm.virtual import VirtualWorld
from pnfarm.protocols.profinet.rpc.calls import ActivityPool
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
END_16, END_32 = 0xFFFF, 0xFFFFFFFF


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


def close_to_their_ends(line):
    """Set what counts frames, messages, calls, sessions and connections to a few before its end, on both sides."""
    farm, controllers = line._line.farm, line._line.controllers
    eip, scanner = farm.axis("eip").device, controllers.of("eip")
    for sender, receiver in ((farm.columns.ppm, scanner.columns.cpm), (scanner.columns.ppm, farm.columns.cpm)):
        (out,) = [row for row in sender if row.active and row.sequence]
        (into,) = [row for row in receiver if row.active and row.sequence]
        for row in (out, into):
            row.sequence, row.counter = END_32 - 8, END_16 - 8
    eip.adapter.encapsulation._last_session = END_32 - 1
    eip.adapter.manager._next_id |= END_16
    scanner.life._connection_serial = END_16 - 1
    scanner.life._next_id |= END_16


@pytest.fixture
def calls(monkeypatch):
    """The activities of RPC calls: each begins its numbers two calls before their end."""
    take, taken = ActivityPool.take, {}

    def near_the_end(pool, peer):
        activity = take(pool, peer)
        if activity.uuid not in taken:
            taken[activity.uuid] = activity
            activity.sequence = END_32 - 2
        return activity

    monkeypatch.setattr(ActivityPool, "take", near_the_end)
    return taken


def test_no_connection_notices_that_what_counts_frames_calls_and_sessions_ends(calls):
    """The cycle counter of PROFINET has 16 bits and ends every 2 s: each run passes it."""
    with Line.from_text(FILE) as line:
        line.wait_running(5.5)
        close_to_their_ends(line)
        farm, scanner = line._line.farm, line._line.controllers.of("eip")
        for _ in range(10):
            line.run(0.1)
            assert {drive.name: drive.state for drive in line.drives} == dict.fromkeys(STATIONS, "S4")
        assert not line.events("connection lost")
        assert 0 < max(int(row.sequence) for row in farm.columns.ppm if row.active) < 1000
        for _ in range(4):
            line.inject("silence", "all", **{"for": "900ms"})
            line.wait_until(lambda: not any(drive.connected for drive in line.drives), within=2)
            line.wait_running(20)
        assert 0 < farm.axis("eip").device.adapter.encapsulation._last_session < 8
        assert 0 < scanner.life._connection_serial < 8
        assert 0 < scanner.life._next_id & END_16 < 16
        assert {activity.sequence for activity in calls.values()} & set(range(100))
