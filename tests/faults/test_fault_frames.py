"""Faults on frames and links, as the controller sees them."""

import asyncio
import errno

import pytest
from fault_line import FaultLine

from pnfarm.errors import ConfigError
from pnfarm.table.channel import IOXS_BAD

MS = 1_000_000
CYCLE = 0.016


def test_a_silent_drive_is_lost_by_its_controller_within_the_watchdog_and_found_again_afterwards(line):
    before = int(line.input_row().received)
    fault = line.add("silence", for_="2s")
    line.run(CYCLE)
    assert int(line.input_row().received) == before
    assert line.until(lambda: line.losses() == 1, 0.1)
    line.run(1.8)
    assert line.session().state != "DATA"
    line.connect()
    assert fault.state == "ended"
    assert fault.runs["axis-01"].reason == "time"
    assert fault.evidence().confirmed
    assert fault.evidence().activations > 1
    assert line.rows_free()


def test_the_end_of_one_silence_does_not_end_another(line):
    first, second = line.add("silence", as_="first"), line.add("silence", as_="second")
    line.run(0.2)
    line.clear("first")
    before = line.farm.columns.engine[0].sent
    line.run(2.0)
    assert line.farm.columns.engine[0].sent == before
    assert not line.plc.all_connected
    line.clear("second")
    line.connect()
    assert first.evidence().activations < second.evidence().activations


def test_a_drive_that_is_deaf_ends_the_connection_by_itself(line):
    line.add("silence", direction="in", for_="500ms")
    line.run(0.2)
    assert "watchdog expired" in line.events("axis-01")
    assert line.losses() == 1
    line.connect()


def test_timeout_lasts_until_the_watchdog_expired_and_the_connection_broke(line):
    fault = line.add("timeout")
    start = line.world.now
    assert line.until(lambda: line.losses() == 1, 1.0)
    # watchdog: three cycles of 16 ms since the last frame, which left up to a cycle before
    assert 32 * MS <= line.world.now - start <= 80 * MS
    line.run(0.1)
    (run,) = fault.runs.values()
    assert run.state == "ended"
    assert run.ended_ns - run.started_ns < 120 * MS
    assert fault.evidence().confirmed
    assert line.session().measures.expirations == 1
    line.connect()
    assert line.rows_free()


def test_timeout_waits_for_a_connection_and_comes_again_as_often_as_asked():
    line = FaultLine()
    fault = line.add("timeout", count=2)
    line.run(0.01)
    assert fault.evidence().activations == 0
    assert line.until(lambda: fault.state == "ended", 5.0)
    assert line.losses() == 2
    line.connect()
    line.run(1.0)
    assert line.losses() == 2


def test_a_share_of_all_cyclic_frames_is_lost_the_same_share_with_the_same_seed():
    received = []
    for _ in range(2):
        line = FaultLine(watchdog=100)
        line.connect()
        fault = line.add("loss", probability=0.2, seed=5, direction="out", params={"frames": "cyclic"})
        line.run(8.0)
        seen = fault.evidence()
        assert seen.checks == pytest.approx(500, abs=2)
        assert 60 < seen.activations < 140
        received.append((int(line.input_row().received), seen))
    assert received[0] == received[1]


def test_drives_lose_different_frames_although_their_fault_has_one_seed():
    line = FaultLine(2, watchdog=100)
    line.connect()
    fault = line.add("loss", probability=0.3, seed=1, direction="out", params={"frames": "cyclic"})
    line.run(4.0)
    first, second = (fault.evidence(name) for name in fault.drives)
    assert (first.activations, first.last_ns) != (second.activations, second.last_ns)


def test_loss_of_incoming_frames_is_what_the_drive_does_not_get(line):
    sent, got = int(line.output_row().sent), int(line.drive_row().received)
    line.add("loss", direction="in", count=2, params={"frames": "cyclic"})
    line.run(10 * CYCLE)
    lost = (int(line.output_row().sent) - sent) - (int(line.drive_row().received) - got)
    assert lost == 2
    assert line.losses() == 0


def test_count_is_exact_and_leaves_nothing_behind(line):
    before = int(line.input_row().received)
    fault = line.add("loss", direction="out", count=2, params={"frames": "cyclic"})
    line.run(20 * CYCLE)
    assert int(line.input_row().received) == before + 18
    assert fault.state == "ended"
    assert fault.runs["axis-01"].reason == "count"
    assert line.rows_free()


def test_count_holds_for_both_ways_and_all_kinds_of_frames_together(line):
    fault = line.add("loss", probability=0.5, seed=3, direction="both", count=5)
    line.run(60 * CYCLE)
    assert fault.state == "ended"
    assert fault.evidence("axis-01").activations == 5
    assert line.rows_free()


def test_healthy_cycles_pass_first_and_the_next_ones_are_hit(line):
    before = int(line.input_row().received)
    fault = line.add("loss", direction="out", after_cycles=10, cycles=2, params={"frames": "cyclic"})
    line.run(10 * CYCLE)
    assert int(line.input_row().received) == before + 10
    line.run(2 * CYCLE)
    assert int(line.input_row().received) == before + 10
    line.run(8 * CYCLE)
    assert int(line.input_row().received) == before + 18
    assert fault.evidence().activations == 2
    assert fault.state == "ended"


def test_a_fault_that_starts_later_leaves_the_drive_alone_until_then(line):
    fault = line.add("silence", after="1s", for_="300ms")
    line.run(0.9)
    assert fault.state == "waiting"
    assert line.losses() == 0
    line.run(0.2)
    assert fault.state == "active"
    assert line.losses() == 1


def test_a_fault_on_frames_outlives_the_connection():
    line = FaultLine()
    line.connect()
    fault = line.add("iops-bad")
    line.add("ar-abort")
    line.run(2.0)
    assert line.losses() == 1
    before = fault.evidence().activations
    assert line.until(lambda: line.session().state == "DATA")
    line.run(0.5)
    assert int(line.input_row().iops) == IOXS_BAD
    assert fault.evidence().activations > before


def test_a_pulled_cable_ends_the_connection_and_plugging_it_brings_the_drive_back(line):
    fault = line.add("link-down")
    line.run(0.3)
    assert line.losses() == 1
    assert "watchdog expired" in line.events("axis-01")
    assert fault.evidence().confirmed
    (port,) = (station.port.index for station in line.farm.axes)
    assert line.world.switch._sockets[port].carrier is False
    line.run(2.0)
    line.clear(fault.id)
    assert line.world.switch._sockets[port].carrier is True
    line.connect()
    assert line.rows_free()


def test_a_cable_pulled_by_two_injections_is_plugged_with_the_last(line):
    line.add("link-down", as_="one")
    line.add("link-down", as_="two")
    line.run(0.1)
    line.clear("one")
    (port,) = (station.port.index for station in line.farm.axes)
    assert line.world.switch._sockets[port].carrier is False
    line.clear("two")
    assert line.world.switch._sockets[port].carrier is True


def test_a_flapping_link_goes_down_as_often_as_asked(line):
    fault = line.add("link-flap", count=3, params={"period": "2s", "down": "200ms"})
    line.run(6.0)
    assert fault.state == "ended"
    assert fault.evidence().activations == 3
    assert line.losses() == 3
    line.connect()
    assert line.rows_free()


def test_a_fault_that_no_drive_can_take_changes_nothing(line):
    rows = line.farm.columns.impairment.shape[0]
    late = line.add("iops-bad", after="100ms")
    for _ in range(rows - 1):
        line.add("iops-bad")
    with pytest.raises(ConfigError, match="axis-01 cannot take one more injection"):
        line.add("loss")
    line.add("data-invalid")
    with pytest.raises(ConfigError, match="axis-01 cannot take one more injection"):
        line.add("iops-bad")
    line.run(0.2)
    assert late.state == "ended"
    assert "cannot take one more injection" in late.runs["axis-01"].reason
    assert len(line.faults.list()) == rows
    line.clear()
    assert line.rows_free()


def test_a_fault_that_one_of_its_drives_cannot_take_is_on_none_of_them():
    line = FaultLine(2)
    rows = line.farm.columns.impairment.shape[0]
    for _ in range(rows - 1):
        line.add("iops-bad", on="axis-01")
    with pytest.raises(ConfigError, match="axis-02 cannot take one more injection"):
        line.add("provider-stop")
    assert len(line.faults.list()) == rows - 1
    assert int((line.farm.columns.impairment["kind"] != 0).sum()) == rows - 1


def test_the_virtual_world_comes_to_rest_while_nothing_is_connected():
    line = FaultLine(controller=False)
    for kind in ("loss", "silence", "timeout", "ar-abort", "link-down", "connect-refuse", "parameter-busy"):
        line.add(kind)
    line.add("loss", count=3)
    line.run(10.0)
    line.clear()
    assert line.faults.next_deadline() is None


def test_carrier_changes_of_a_real_link_follow_each_other_and_a_refusal_is_reported():
    from pnfarm.errors import EnvironmentError_
    from pnfarm.faults.effects.carrier import Carriers

    class SlowLink:
        inner = None

        def __init__(self):
            self.changes = []

        async def set_carrier(self, port_index, up):
            await asyncio.sleep(0)
            if port_index == 2:
                raise EnvironmentError_("no such port")
            self.changes.append((port_index, up))

    async def scenario():
        told = []
        link = SlowLink()
        carriers = Carriers(link, lambda drive, reason: told.append((drive, reason)))
        carriers.pull(1, "axis-01")
        assert not carriers.is_off(1)
        await asyncio.sleep(0.01)
        assert carriers.is_off(1)
        carriers.plug(1, "axis-01")
        carriers.pull(1, "axis-01")
        carriers.plug(1, "axis-01")
        carriers.pull(2, "axis-02")
        await asyncio.sleep(0.01)
        assert not carriers.is_off(1)
        assert link.changes[-1] == (1, True)
        assert told == [("axis-02", "no such port")]

    asyncio.run(scenario())


def test_a_cable_that_the_machine_could_not_plug_is_plugged_as_soon_as_it_can():
    from pnfarm.faults.effects import carrier

    class ShortOfFiles:
        inner = None

        def __init__(self):
            self.files, self.up = True, True

        async def set_carrier(self, _port, up):
            await asyncio.sleep(0)
            if not self.files:
                raise OSError(errno.EMFILE, "Too many open files")
            self.up = up

    async def scenario():
        told = []
        link = ShortOfFiles()
        carriers = carrier.Carriers(link, lambda drive, reason: told.append((drive, reason)))
        carriers.pull(1, "axis-01")
        await asyncio.sleep(0.01)
        assert not link.up
        link.files = False
        carriers.plug(1, "axis-01")
        await asyncio.sleep(0.05)
        assert (link.up, len(told)) == (False, 1)
        link.files = True
        async with asyncio.timeout(5):
            while not link.up:  # noqa: ASYNC110  # the link has no event for it
                await asyncio.sleep(0.02)
        assert not carriers.is_off(1)
        assert told == [("axis-01", "[Errno 24] Too many open files")]

    before, carrier.AGAIN_SECONDS = carrier.AGAIN_SECONDS, 0.02
    try:
        asyncio.run(scenario())
    finally:
        carrier.AGAIN_SECONDS = before
