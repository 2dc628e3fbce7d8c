"""Faults of the cyclic frames: what the controller gets, and what becomes of the connection."""

import pytest
from fault_line import FaultLine

from pnfarm.errors import ConfigError
from pnfarm.table.channel import DISCARD_COUNTER, DISCARD_LENGTH

MS = 1_000_000
CYCLE = 0.016
MODELS = {
    "akd-profinet": {"cycle": "16ms"},
    "hiwin-e1": {"cycle": "4ms", "telegram": 3},
    "moog-msd": {"cycle": "4ms"},
}


def line_of(model: str, **options) -> FaultLine:
    line = FaultLine(model=model, **{**MODELS[model], **options})
    line.connect(20.0)
    line.frames = []
    line.world.watch(lambda _port, frame, now, way: line.frames.append((now, frame)) if way == "out" else None)
    line.run(0.1)
    line.frames.clear()
    return line


def counter(frame: bytes) -> int:
    return int.from_bytes(frame[-4:-2], "big")


def cycle_of(line: FaultLine) -> float:
    return int(line.input_row().cycle_ns) / 1e9


def lost_and_back(line: FaultLine, fault) -> None:
    """The controller loses the drive, and gets it back after the fault."""
    assert line.until(lambda: line.losses() == 1, 0.2)
    line.clear(fault.id)
    line.connect(20.0)
    line.run(0.2)
    assert line.losses() == 1
    assert line.rows_free()


@pytest.mark.parametrize("model", MODELS)
def test_a_cycle_counter_that_stands_makes_the_controller_discard_the_frames(model):
    line = line_of(model)
    fault = line.add("cycle-counter-freeze")
    line.run(2 * cycle_of(line))
    assert len({counter(frame) for _, frame in line.frames[-2:]}) == 1
    assert int(line.input_row().discarded[DISCARD_COUNTER]) >= 1
    lost_and_back(line, fault)


@pytest.mark.parametrize("model", MODELS)
def test_a_single_frame_with_an_old_counter_is_discarded_and_a_jump_forward_is_taken(model):
    line = line_of(model)
    before = int(line.input_row().discarded[DISCARD_COUNTER])
    line.run(2 * cycle_of(line))
    fault = line.add("cycle-counter-jump", count=1)
    line.run(10 * cycle_of(line))
    assert int(line.input_row().discarded[DISCARD_COUNTER]) == before + 1
    assert fault.evidence().activations == 1
    steps = [(counter(b) - counter(a)) & 0xFFFF for (_, a), (_, b) in zip(line.frames, line.frames[1:], strict=False)]
    step = int(cycle_of(line) / 31.25e-6 + 0.5)
    assert sorted(steps) == sorted([*[step] * (len(steps) - 2), (step - 1024) & 0xFFFF, step + 1024])
    line.add("cycle-counter-jump", params={"by": 20000}, as_="ahead")
    line.run(10 * cycle_of(line))
    assert int(line.input_row().discarded[DISCARD_COUNTER]) == before + 1
    assert line.losses() == 0


@pytest.mark.parametrize("model", MODELS)
def test_frames_with_another_frame_id_are_nobodys(model):
    line = line_of(model)
    agreed = line.frames[-1][1][18:20] if line.frames else None
    fault = line.add("wrong-frame-id", params={"frame_id": 0x8777})
    line.run(2 * cycle_of(line))
    assert line.frames[-1][1][18:20] == b"\x87\x77" != agreed
    lost_and_back(line, fault)
    assert line.frames[-1][1][18:20] != b"\x87\x77"


@pytest.mark.parametrize("by", [-1, 1, 40])
@pytest.mark.parametrize("model", MODELS)
def test_frames_of_another_length_are_discarded(model, by):
    line = line_of(model)
    line.run(2 * cycle_of(line))
    (length,) = {len(frame) for _, frame in line.frames}
    fault = line.add("wrong-length", params={"by": by})
    line.run(2 * cycle_of(line))
    assert {len(frame) for _, frame in line.frames[-2:]} == {length + by}
    # cycle counter and status are behind the data whatever their length
    assert line.frames[-1][1][-2:] == bytes((0x35, 0))
    assert int(line.input_row().discarded[DISCARD_LENGTH]) >= 1
    lost_and_back(line, fault)


def test_a_length_that_is_the_agreed_one_is_refused():
    line = FaultLine()
    with pytest.raises(ConfigError, match=r"params\.by: is 0, which changes nothing"):
        line.add("wrong-length", params={"by": 0})


@pytest.mark.parametrize("model", MODELS)
def test_a_bad_consumer_status_is_in_every_iocs_and_is_good_again_afterwards(model):
    line = line_of(model)
    line.run(2 * cycle_of(line))
    good = line.frames[-1][1]
    fault = line.add("iocs-bad")
    line.run(2 * cycle_of(line))
    bad = line.frames[-1][1]
    (ar,) = line.farm.axes[0].device.ars.values()
    places = {20 + c.iocs_offset for _, cr in ar.providers for c in cr.iocs if c.iocs_offset is not None}
    assert places
    assert all((good[place], bad[place]) == (0x80, 0x40) for place in places)
    line.clear(fault.id)
    line.run(2 * cycle_of(line))
    assert all(line.frames[-1][1][place] == 0x80 for place in places)
    assert line.losses() == 0


@pytest.mark.parametrize("direction", ["out", "in"])
@pytest.mark.parametrize(("fields", "dropped"), [({}, 1), ({"count": 2}, 2), ({"cycles": 2}, 2)])
def test_the_next_cycles_are_dropped_as_many_as_asked(direction, fields, dropped):
    line = line_of("akd-profinet", watchdog=8)
    row = line.input_row if direction == "out" else line.drive_row
    before = int(row().received)
    fault = line.add("drop-cycles", direction=direction, **fields)
    line.run(20 * CYCLE)
    assert int(row().received) == before + 20 - dropped
    assert fault.state == "ended"
    assert fault.evidence().activations == dropped
    assert line.rows_free()


@pytest.mark.parametrize(("late", "lost"), [("20ms", 0), ("60ms", 1)])
def test_a_late_frame_is_a_longer_interval_and_beyond_the_watchdog_a_lost_connection(late, lost):
    line = line_of("akd-profinet")
    line.run(3 * CYCLE)
    fault = line.add("late-frames", count=1, params={"by": late})
    line.run(12 * CYCLE)
    assert line.losses() == lost
    assert fault.evidence().activations == 1
    if not lost:
        gaps = [b - a for (a, _), (b, _) in zip(line.frames, line.frames[1:], strict=False)]
        # what is due while it waits is left out; the next is in time again
        assert max(gaps) == 36 * MS
        assert gaps.count(12 * MS) == 1
        assert fault.state == "ended"
    line.clear()
    assert line.rows_free()
