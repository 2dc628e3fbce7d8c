"""Whose fault a lost connection was: a farm that was late itself says so, and blames no controller."""

from __future__ import annotations

import asyncio
import socket
import threading
import time
from bisect import bisect_left
from types import SimpleNamespace

import pytest
from virtual_line import VirtualLine

from pnfarm.buses.profinet.device.events import ArAborted
from pnfarm.engine.columns import allocate
from pnfarm.engine.lateness import LATE_NS, LOOP_LATE_NS, note_late
from pnfarm.engine.tick import tick
from pnfarm.farm import realtime
from pnfarm.farm.lateness import farm_budget_ns, farm_lateness
from pnfarm.farm.views.snapshot import drive_snapshot
from pnfarm.links.tap import TapLink
from pnfarm.metrics import FarmCollector
from pnfarm.station.events import WatchdogExpired
from pnfarm.station.lateness import budget_ns
from pnfarm.table.engine_row import LATENESS_EDGES_NS
from pnfarm.table.late import LATE_ROWS

MS = 1_000_000


def connected() -> VirtualLine:
    line = VirtualLine(1)
    line.connect()
    line.run(0.1)
    return line


def silence(line: VirtualLine) -> None:
    """The controller's frames no longer arrive."""
    (station,) = line.farm.axes
    line.farm.columns.cpm[station.device.channel_rows[1][0]].source = 1


def late_tick(line: VirtualLine, late_ns: int) -> None:
    """The machine stalls: nobody runs, and then the next tick is late, first the farm's."""
    line.world.clock.now += late_ns
    columns, now = line.farm.columns, line.world.now
    note_late(columns.engine[0], columns.late, now - late_ns, now, 0)
    tick(columns, 0, now)
    tick(line.plc.columns, 0, now)


def happened(line: VirtualLine, kind: type) -> list:
    return [entry.what for entry in line.log.entries("axis-01") if isinstance(entry.what, kind)]


def samples(collector: FarmCollector, name: str) -> dict[str, float]:
    lines = [line for line in collector.gather().text().decode().splitlines() if line.startswith(name + "{")]
    return {line.rpartition(" ")[0].removeprefix(name): float(line.rpartition(" ")[2]) for line in lines}


def test_silent_controller_is_the_cause_of_an_expired_watchdog():
    line = connected()
    collector = FarmCollector(line.farm)
    silence(line)
    line.run(0.2)
    (expired,) = happened(line, WatchdogExpired)
    (aborted,) = happened(line, ArAborted)
    assert expired.details()["cause"] == aborted.details()["cause"] == "controller"
    assert expired.lateness.worst_ns == 0
    found = samples(collector, "pnfarm_watchdog_expirations_total")
    assert found == {'{drive="axis-01",cause="controller"}': 1, '{drive="axis-01",cause="farm"}': 0}


def test_farm_that_was_late_is_the_cause_of_an_expired_watchdog():
    line = connected()
    collector = FarmCollector(line.farm)
    late_tick(line, 100 * MS)
    line.run(0.05)
    (expired,) = happened(line, WatchdogExpired)
    (aborted,) = happened(line, ArAborted)
    assert expired.details()["cause"] == aborted.details()["cause"] == "farm"
    assert expired.details()["farm_late_seconds"] == pytest.approx(0.1, abs=0.001)
    assert expired.details()["farm_budget_seconds"] == 0.016
    found = samples(collector, "pnfarm_watchdog_expirations_total")
    assert found == {'{drive="axis-01",cause="controller"}': 0, '{drive="axis-01",cause="farm"}': 1}
    found = samples(collector, "pnfarm_ar_aborts_total")
    assert found['{drive="axis-01",reason="consumer-dht-expired",cause="farm"}'] == 1
    assert found['{drive="axis-01",reason="consumer-dht-expired",cause="controller"}'] == 0
    shown = drive_snapshot(line.farm, line.farm.axis("axis-01"), line.world.now)
    assert (shown["watchdog_expirations"], shown["watchdog_expirations_by_farm"], shown["aborts_by_farm"]) == (1, 1, 1)


def test_short_lateness_does_not_excuse_a_silent_controller():
    line = connected()
    silence(line)
    line.run(0.01)
    late_tick(line, 5 * MS)
    line.run(0.2)
    (expired,) = happened(line, WatchdogExpired)
    assert expired.details()["cause"] == "controller"
    assert expired.lateness.engine_ns == 5 * MS


@pytest.mark.parametrize(("stood", "cause"), [(30, "controller"), (39, "farm"), (60, "farm")])
def test_farm_that_stood_longer_than_the_controllers_watchdog_is_the_cause_of_the_silence_behind(stood, cause):
    """The controller has given up while the farm stood, and sends nothing any more when it goes on."""
    line = connected()
    columns = line.farm.columns
    note_late(columns.engine[0], columns.late, line.world.now - stood * MS, line.world.now, 0)
    silence(line)
    line.run(0.2)
    (expired,) = happened(line, WatchdogExpired)
    assert expired.details()["cause"] == cause


def test_lateness_long_before_the_silence_does_not_excuse_a_controller():
    line = connected()
    columns = line.farm.columns
    note_late(columns.engine[0], columns.late, line.world.now - 40 * MS, line.world.now, 0)
    line.run(0.1)
    silence(line)
    line.run(0.2)
    (expired,) = happened(line, WatchdogExpired)
    assert expired.details()["cause"] == "controller"
    assert expired.lateness.worst_ns == 0


def test_abort_by_the_controller_while_the_farm_did_not_run_is_the_farm_s():
    line = connected()
    late_tick(line, 20 * MS)
    (station,) = line.farm.axes
    # the controller's own watchdog: its abort arrives behind the stall
    (session,) = line.plc.sessions
    line.plc.columns.cpm[session.consumer].source = 1
    assert line.world.run(0.2, until=lambda: bool(happened(line, ArAborted)))
    (aborted,) = happened(line, ArAborted)
    assert aborted.by_controller
    assert aborted.details()["cause"] == "farm"
    assert station.device.losses_by_farm() == station.device.losses()


def test_event_loop_s_delay_counts_for_an_abort_but_not_for_a_watchdog():
    line = connected()
    line.farm.lateness.loop.note(line.world.now + 10 * MS, 30 * MS)
    own = line.farm.lateness.between(line.world.now - 50 * MS, line.world.now + 20 * MS, 16 * MS)
    assert (own.loop_ns, own.late) == (30 * MS, False)
    assert farm_lateness(line.farm, line.world.now - 50 * MS, line.world.now + 20 * MS).late


def test_tick_that_has_not_come_yet_counts_as_late():
    line = connected()
    line.farm.columns.engine[0].due_ns = line.world.now - 30 * MS
    own = farm_lateness(line.farm, line.world.now - 100 * MS, line.world.now)
    assert own.engine_ns == 30 * MS
    line.farm.columns.engine[0].due_ns = line.world.now - LATE_NS // 2
    assert farm_lateness(line.farm, line.world.now - 100 * MS, line.world.now).engine_ns == 0


def test_what_the_event_loop_has_not_done_yet_counts_as_late():
    line = connected()
    line.farm.lateness.loop.due_ns = line.world.now - 30 * MS
    assert farm_lateness(line.farm, line.world.now - 20 * MS, line.world.now).loop_ns == 30 * MS
    line.farm.lateness.loop.due_ns = line.world.now - LOOP_LATE_NS // 2
    assert farm_lateness(line.farm, line.world.now - 20 * MS, line.world.now).loop_ns == 0


async def cause_behind_a_stall(record):
    """As it is judged when what waited for the event loop is handled, which had stood for 60 ms."""
    loop = asyncio.get_running_loop()
    heartbeat = realtime._Heartbeat(record, threading.get_native_id(), lambda action: action(), ttys=False)
    heartbeat.start()
    near, far = socket.socketpair()
    near.setblocking(False)
    cause = loop.create_future()

    def handle():
        near.recv(1)
        now = time.monotonic_ns()
        cause.set_result(record.between(now - 80 * MS, now, 16 * MS, by_loop=True).cause)

    loop.add_reader(near, handle)
    try:
        far.send(b"-")
        time.sleep(0.06)  # noqa: ASYNC251 - the event loop stands
        return await cause
    finally:
        loop.remove_reader(near)
        heartbeat.stop()
        near.close()
        far.close()


def test_a_stall_of_the_event_loop_is_known_before_what_waited_for_it_is_handled():
    record = connected().farm.lateness
    assert asyncio.run(cause_behind_a_stall(record)) == "farm"
    assert record.loop.due_ns == 0


def test_lateness_counts_only_within_the_time_asked_for():
    line = connected()
    columns, now = line.farm.columns, line.world.now
    note_late(columns.engine[0], columns.late, now, now + 50 * MS, 0)
    for begin, end, late in ((0, 50, 50), (-10, 60, 50), (10, 30, 20), (40, 90, 10), (50, 60, 0), (-20, 0, 0)):
        assert farm_lateness(line.farm, now + begin * MS, now + end * MS).engine_ns == late * MS


def test_ticks_late_one_after_the_other_share_rows_and_keep_their_sum():
    line = connected()
    columns, now = line.farm.columns, line.world.now
    for step in range(LATE_ROWS * 2):
        note_late(columns.engine[0], columns.late, now + step * MS, now + step * MS + MS // 2, 0)
    assert 0 < columns.engine[0].late_head <= LATE_ROWS
    assert line.farm.lateness.between(now, now + LATE_ROWS * 2 * MS, 16 * MS).engine_ns == LATE_ROWS * MS


def test_frame_that_waited_longer_than_a_tick_is_the_farm_s_lateness():
    line = connected()
    columns, now = line.farm.columns, line.world.now
    note_late(columns.engine[0], columns.late, now, now, 26 * MS)
    assert farm_lateness(line.farm, now - MS, now + MS).receive_ns == 25 * MS


def test_stolen_time_is_what_was_stolen_around_the_time_asked_for():
    line = connected()
    for when, total in ((0, 0), (100, 5), (200, 45), (300, 46)):
        line.farm.lateness.stolen(line.world.now + when * MS, total * MS)
    own = farm_lateness(line.farm, line.world.now + 110 * MS, line.world.now + 150 * MS)
    assert (own.stolen_ns, own.late) == (40 * MS, False)


@pytest.mark.parametrize(
    ("cycle", "factor", "budget"), [(16, 3, 16), (16, 1, 8), (16, 2, 8), (1, 3, 1), (4, 16, 30), (2, 255, 254)]
)
def test_budget_is_half_of_what_the_watchdog_leaves(cycle, factor, budget):
    assert budget_ns(cycle * MS, cycle * factor * MS) == budget * MS


def test_farm_s_budget_is_that_of_its_tightest_connection():
    line = connected()
    assert farm_budget_ns(line.farm) == farm_budget_ns(line.farm, "axis-01") == 16 * MS
    assert farm_budget_ns(VirtualLine(1, controller=False).farm) == 50 * MS


def test_farm_is_never_late_in_virtual_time():
    line = connected()
    line.run(30.0)
    own = farm_lateness(line.farm, 0, line.world.now)
    assert (own.worst_ns, own.stolen_ns, own.cause) == (0, 0, "controller")


@pytest.mark.asyncio
async def test_ticks_in_the_event_loop_are_counted_by_how_late_they_began():
    columns = allocate(images=1, axes=1)
    columns.engine[0].tick_ns = MS
    node = SimpleNamespace(columns=columns, service=lambda now: None)
    engine = realtime._LoopEngine(node, TapLink("line-1"), lambda action: action())
    engine._due = time.monotonic_ns() - 5 * MS
    engine._tick()
    engine.stop()
    row = columns.engine[0]
    assert int(row.lateness[: bisect_left(LATENESS_EDGES_NS, 5 * MS)].sum()) == 0
    assert int(row.lateness.sum()) == 1
    assert int(row.lateness_sum_ns) == int(row.lateness_max_ns) >= 5 * MS
