"""The capture of a long run: a bounded ring, of which the frames around failures are kept."""

from __future__ import annotations

import asyncio
import resource
import struct
from pathlib import Path

import pytest

from pnfarm.errors import EnvironmentError_
from pnfarm.links.base import PortSpec
from pnfarm.links.capture.pcap import PcapLink, interface_description, packet_block, section_header
from pnfarm.links.memory import MemoryLink, MemorySwitch
from pnfarm.scenario.report.capture_slices import Window, slice_capture
from pnfarm.scenario.report.frame_ring import MAX_WINDOWS, FrameRing

S, MS = 1_000_000_000, 1_000_000
HEAD = section_header("test") + interface_description("axis-01")
FRAME = bytes(1000)


def feed(ring: FrameRing, begin_ns: int, end_ns: int, every_ns: int = 10 * MS) -> None:
    for stamp in range(begin_ns, end_ns, every_ns):
        ring.write(packet_block(0, FRAME, stamp, "in"))


def stamps(path: Path) -> list[int]:
    """Stamps of the packets of a file, which has whole blocks only."""
    data, at, found = path.read_bytes(), 0, []
    while at < len(data):
        kind, length = struct.unpack_from("<II", data, at)
        if kind == 6:
            high, low = struct.unpack_from("<II", data, at + 12)
            found.append(high << 32 | low)
        at += length
    assert at == len(data)
    return found


def made(tmp_path: Path, **more: int) -> FrameRing:
    ring = FrameRing(tmp_path / "failures.pcapng", **more)
    ring.extend_head(HEAD)
    return ring


def test_a_day_without_a_failure_holds_little_memory_and_no_file(tmp_path) -> None:
    ring = made(tmp_path, octets=500_000, ns=60 * S)
    most = 0
    for hour in range(24):
        feed(ring, hour * 3600 * S, (hour + 1) * 3600 * S, every_ns=4 * S)
        feed(ring, (hour + 1) * 3600 * S - S, (hour + 1) * 3600 * S, every_ns=MS)
        most = max(most, ring.held)
    assert 0 < most <= 500_000 + len(FRAME) + 64
    ring.close()
    assert not ring.current.exists()


def test_the_ring_is_bounded_by_time(tmp_path) -> None:
    ring = made(tmp_path, ns=2 * S)
    feed(ring, 0, 100 * S)
    assert 0 < ring.held <= 2.3 * S / (10 * MS) * 1100


def test_frames_before_and_behind_a_failure_are_filed_as_it_happens(tmp_path) -> None:
    ring = made(tmp_path, octets=5_000_000)
    feed(ring, 0, 100 * S)
    ring.want(99 * S, 101 * S)
    feed(ring, 100 * S, 200 * S)
    # long before the end
    assert ring.current.exists()
    ring.close()
    found = slice_capture(ring.current, tmp_path / "out", [Window(99 * S, 101 * S, None, "failed")])
    assert stamps(tmp_path / "out") == list(range(99 * S, 101 * S + 1, 10 * MS))
    assert found == 201
    assert ring.current.stat().st_size < 300 * 1100
    assert ring.not_whole == 0


def test_windows_that_overlap_or_reach_back_file_each_frame_once(tmp_path) -> None:
    ring = made(tmp_path)
    feed(ring, 0, 10 * S)
    ring.want(9 * S, 11 * S)
    feed(ring, 10 * S, 12 * S)
    ring.want(5 * S, 13 * S)
    feed(ring, 12 * S, 20 * S)
    ring.close()
    windows = [Window(9 * S, 11 * S, None, "a"), Window(5 * S, 13 * S, None, "b")]
    count = slice_capture(ring.current, tmp_path / "out", windows)
    assert sorted(stamps(tmp_path / "out")) == list(range(5 * S, 13 * S + 1, 10 * MS))
    assert count == 801
    only = slice_capture(ring.current, tmp_path / "one", windows[:1])
    assert only == 201


def test_a_failure_at_the_end_has_the_last_frames(tmp_path) -> None:
    ring = made(tmp_path)
    feed(ring, 0, S)
    ring.want(900 * MS, 5 * S)
    ring.close()
    assert stamps(ring.current)[-1] == 990 * MS


def test_what_the_ring_had_dropped_and_what_the_file_has_no_room_for_is_told(tmp_path) -> None:
    ring = made(tmp_path, ns=2 * S)
    feed(ring, 0, 10 * S)
    ring.want(S, 11 * S)
    feed(ring, 10 * S, 20 * S)
    assert ring.not_whole == 1
    ring.close()
    full = FrameRing(tmp_path / "full.pcapng", file_octets=200_000)
    full.extend_head(HEAD)
    for second in range(0, 50, 5):
        feed(full, second * S, (second + 4) * S)
        full.want((second + 2) * S, (second + 3) * S)
    full.close()
    assert (tmp_path / "full.pcapng").stat().st_size <= 200_000
    assert full.not_whole >= 7


def test_a_full_disk_is_told_once_and_what_is_missing_is_counted() -> None:
    ring = FrameRing(Path("/dev/full"))
    ring.want(0, 2 * S)
    with pytest.raises(EnvironmentError_, match="cannot be written: No space left"):
        feed(ring, 0, S)
    ring.abandon()
    ring.abandon()
    assert ring.not_whole == 1


def test_a_run_in_virtual_time_goes_on_although_the_disk_has_no_room_for_its_frames(tmp_path) -> None:
    ring = FrameRing(tmp_path / "failures.pcapng")
    clock = [0]
    link = PcapLink(MemoryLink(MemorySwitch(), lambda: clock[0]), None, clock=lambda: clock[0], epoch_ns=0, sink=ring)
    (port,) = asyncio.run(link.open([PortSpec("axis-01", bytes([2, 0, 0, 0, 0, 1]))]))
    ring.want(0, 100 * S)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, limits[1]))
    try:
        for clock[0] in range(0, 10 * S, 10 * MS):
            link.send(port.index, FRAME)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert "cannot be written" in str(link.failed)
    assert ring.not_whole == 1
    assert slice_capture(ring.current, tmp_path / "out", [Window(0, 100 * S, None, "failed")]) > 100


def test_the_number_of_windows_is_bounded(tmp_path) -> None:
    ring = made(tmp_path)
    feed(ring, 0, S)
    for _ in range(MAX_WINDOWS + 5):
        ring.want(0, 2 * S)
    feed(ring, S, 3 * S)
    ring.close()
    assert ring.not_whole == 5


def test_the_record_of_a_day_is_bounded_and_says_what_it_left_out() -> None:
    from pnfarm.scenario.definition.file import parse_scenario
    from pnfarm.scenario.report.record import MAX_REACTIONS, MAX_TIMELINE, MAX_VALUES, Case, Record, Verdict
    from pnfarm.station.event_log import EventLog
    from pnfarm.station.events import FaultReacted

    scenario = parse_scenario("scenario: day\nsteps: [{wait: 24h}]")
    (step,) = scenario.steps
    record = Record(scenario, "line", ["axis-01"], 0)
    for number in range(MAX_TIMELINE + 7):
        record.step(step, number * S)
    for number in range(MAX_VALUES // 64 + 10):
        verdict = Verdict.PASSED if number else Verdict.FAILED
        record.add(Case(number, step, verdict, 0, 0, values={f"axis-{n}": {"state": "S4"} for n in range(64)}))
    record.add(Case(9999, step, Verdict.FAILED, 0, 0, values={"axis-01": {"state": "S4"}}))
    log = EventLog(quiet=True)
    log.subscribe(record.note)
    for _ in range(MAX_REACTIONS + 3):
        log.record(0, "axis-01", FaultReacted(after_ns=MS))
    found = record.as_dict()
    assert len(found["timeline"]) == MAX_TIMELINE
    assert found["timeline_left_out"] == 7
    assert found["timeline"][0]["seconds"] == 0
    assert found["timeline"][-1]["seconds"] == MAX_TIMELINE + 6
    assert sum(len(case["values"]) for case in found["cases"]) <= MAX_VALUES + 1
    assert found["values_left_out"] == 10
    assert found["cases"][-1]["values"]
    assert len(found["plc"]["axis-01"]["reacted_seconds"]) == MAX_REACTIONS
    assert found["plc_left_out"] == 3
