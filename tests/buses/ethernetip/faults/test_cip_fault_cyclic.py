"""Faults in the cyclic packets of a drive on EtherNet/IP, as its originator sees them."""

from __future__ import annotations

import pytest
from cip_line import CipLine

from pnfarm.table.channel import DISCARD_CHECKSUM, DISCARD_COUNTER, DISCARD_LENGTH


@pytest.fixture
def line() -> CipLine:
    found = CipLine()
    found.connect()
    found.enable()
    found.run(0.1)
    return found


def discarded(line: CipLine, reason: int) -> int:
    return int(line.scanners[0].consumer.discarded[reason])


def received(line: CipLine) -> int:
    return line.scanners[0].received_frames


def back(line: CipLine) -> None:
    line.clear()
    line.run(0.002)
    assert line.until(lambda: line.all_running, 30.0), line.reasons()
    assert not line.faults.drive("axis-01").in_force()


def test_lost_packets_leave_gaps_in_the_sequence_and_the_connection_stands(line):
    consumer = line.scanners[0].consumer
    before, sequence = received(line), int(consumer.sequence)
    fault = line.add("drop-cycles", count=3)
    line.run(0.2)
    assert fault.state == "ended"
    assert fault.evidence().activations == 3
    assert int(consumer.sequence) - sequence == received(line) - before + 3
    assert line.scanners[0].losses == 0


@pytest.mark.parametrize(
    "params", [{"model": "burst", "burst": 2}, {"model": "gilbert-elliott", "burst": 2}, {"model": "independent"}]
)
def test_every_model_of_loss_loses_its_share(line, params):
    fault = line.add("loss", direction="in", probability=0.2, seed=4, params={"frames": "cyclic", **params})
    line.run(2.0)
    seen = fault.evidence()
    assert 0.1 < seen.activations / seen.checks < 0.3
    back(line)


def test_loss_beyond_the_timeout_in_the_drives_own_direction_raises_f702(line):
    line.add("loss", direction="in", params={"frames": "cyclic"})
    line.run(0.06)
    assert line.rig.station("axis-01").fault_counts == {702: 1}
    back(line)


def test_a_constant_delay_costs_one_gap_and_nothing_else(line):
    line.add("delay", direction="out", params={"delay": "15ms", "frames": "cyclic"})
    line.run(0.1)
    before = received(line)
    line.run(1.0)
    assert received(line) - before == 100
    assert line.scanners[0].losses == 0
    back(line)


def test_copies_and_packets_that_were_overtaken_are_dropped_by_their_number(line):
    fault = line.add("duplicate", direction="out", count=5, params={"frames": "cyclic"})
    line.run(0.2)
    assert fault.evidence().activations == 5
    assert discarded(line, DISCARD_COUNTER) == 5
    line.add("reorder", direction="out", count=1, params={"frames": "cyclic"})
    line.run(0.2)
    assert discarded(line, DISCARD_COUNTER) == 6
    assert line.scanners[0].losses == 0


def test_a_corrupt_packet_is_dropped_for_its_checksum(line):
    before = received(line)
    line.add("corrupt", direction="out", probability=0.3, seed=9, params={"frames": "cyclic"}, count=10)
    line.run(0.6)
    # a bit in the headers makes a packet that is nobody's
    assert 5 <= discarded(line, DISCARD_CHECKSUM) <= 10
    assert received(line) - before == 50


def test_a_corrupt_packet_with_mended_checksums_is_taken_with_wrong_data(line):
    before, right = received(line), line.scanners[0].response[:1]
    seen = set()
    line.add("corrupt", direction="out", count=8, seed=3, params={"frames": "cyclic", "mend": True, "bits": 2})
    for _ in range(8):
        line.run(0.01)
        seen.add(line.scanners[0].response)
    assert discarded(line, DISCARD_CHECKSUM) == 0
    assert received(line) > before
    assert len(seen) > 2
    line.run(0.05)
    assert line.scanners[0].response[:1] == right


def test_what_the_drive_gets_corrupt_and_mended_reaches_its_front(line):
    station = line.rig.station("axis-01")
    words = station.handle.image.received
    seen = set()
    for seed in range(30):
        line.add("corrupt", direction="in", count=1, seed=seed, params={"frames": "cyclic", "mend": True, "bits": 4})
        line.run(0.02)
        seen.add(words.tobytes())
        line.run(0.02)
    assert len(seen) > 3
    back(line)


def test_a_slow_line_lets_through_what_it_can(line):
    line.add("throttle", direction="out", params={"frames": "cyclic", "rate": 70, "queue": "20ms"})
    line.run(0.3)
    before = received(line)
    line.run(1.0)
    assert 45 <= received(line) - before <= 65
    back(line)


def test_late_frames_lengthen_the_interval_and_leave_out_what_is_due_meanwhile(line):
    before = received(line)
    fault = line.add("late-frames", count=1, params={"by": "25ms"})
    line.run(0.2)
    assert fault.evidence().activations == 1
    assert received(line) - before in {17, 18}
    assert line.scanners[0].losses == 0


def test_a_frozen_number_makes_packets_old_and_the_connection_times_out(line):
    fault = line.add("sequence-freeze")
    line.run(0.03)
    assert discarded(line, DISCARD_COUNTER) >= 1
    line.run(0.1)
    assert line.scanners[0].losses == 1
    assert fault.evidence().confirmed
    back(line)


def test_a_frozen_count_keeps_the_connection_and_lets_the_data_stand(line):
    line.add("sequence-freeze", params={"which": "count"})
    line.run(0.05)
    stood, before = line.scanners[0].response, received(line)
    line.rig.station("axis-01").raise_fault("F702", hold=False)
    line.run(0.5)
    assert line.scanners[0].response == stood
    assert received(line) - before == 50
    assert line.scanners[0].losses == 0
    line.clear()
    assert line.until(lambda: line.scanners[0].response[0] & 0x08, 0.05), "the fault shows now"
    back(line)


def test_a_number_that_jumps_back_is_dropped_until_it_has_caught_up(line):
    before = received(line)
    fault = line.add("sequence-jump", count=1, params={"by": -10})
    line.run(0.2)
    assert fault.evidence().activations == 1
    assert discarded(line, DISCARD_COUNTER) == 1
    assert received(line) - before == 19


def test_a_single_packet_whose_number_jumps_forward_hides_those_behind_it(line):
    line.add("sequence-jump", count=1, params={"by": 3})
    line.run(0.2)
    assert discarded(line, DISCARD_COUNTER) == 3
    assert line.scanners[0].losses == 0


def test_a_count_that_jumps_is_new_data(line):
    before = received(line)
    line.add("sequence-jump", params={"by": 7, "which": "count"})
    line.run(0.2)
    assert received(line) - before == 20
    assert not line.scanners[0].consumer.discarded.any()
    back(line)


@pytest.mark.parametrize("params", [{}, {"connection_id": 0xFFFF0001}])
def test_packets_with_another_connection_id_are_nobodys(line, params):
    before = received(line)
    fault = line.add("wrong-connection-id", params=params, count=2)
    line.run(0.1)
    assert fault.evidence().activations == 2
    assert received(line) - before == 8
    assert not line.scanners[0].consumer.discarded.any()


@pytest.mark.parametrize("by", [-64, -1, 1, 100])
def test_packets_of_another_length_are_dropped(line, by):
    before = received(line)
    line.add("wrong-length", params={"by": by}, count=2)
    line.run(0.1)
    assert discarded(line, DISCARD_LENGTH) == 2
    assert received(line) - before == 8


def test_timeout_is_silence_until_the_originator_gave_up_and_then_the_drive_is_back(line):
    fault = line.add("timeout")
    line.run(3.0)
    assert fault.state == "ended"
    assert fault.evidence().confirmed
    assert line.scanners[0].losses == 1
    back(line)


@pytest.mark.parametrize(("kind", "reason"), [("ar-abort", "ended"), ("watchdog-expire", "timed-out")])
def test_the_drive_ends_a_connection(line, kind, reason):
    fault = line.add(kind)
    line.run(0.1)
    assert fault.evidence().confirmed
    assert dict(line.rig.station("axis-01").device.losses()) == {reason: 1}
    assert line.scanners[0].losses == 1
    back(line)
    assert line.scanners[0].made == 2


def test_the_watchdog_that_a_fault_names_is_the_originators(line):
    part = line.faults.drive("axis-01")
    connection = next(p for p in part._parts.values() if hasattr(p, "sent_data")).now()
    assert connection.watchdog_ns == 40_000_000
    assert connection.cycle_ns == 10_000_000
