"""Frames that are lost in bursts, delayed, repeated, reordered, corrupted or throttled: cyclic ones and others."""

import math
from itertools import groupby, pairwise

import numba
import numpy as np
import pytest
from fault_line import FaultLine
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.buses.registry import fault_kinds
from pnfarm.engine.channels.impair import chosen
from pnfarm.errors import ConfigError
from pnfarm.faults.events import InjectionEnded
from pnfarm.faults.gate.choice import BURST, Chooser, choice_of
from pnfarm.faults.gate.shaping import corrupted
from pnfarm.station.splitmix import SplitMix64
from pnfarm.table.channel import DISCARD_COUNTER
from pnfarm.table.impairment import IMPAIRMENT, threshold

MS = 1_000_000
CYCLE = 0.016
FRAMES = 1_000_000


@numba.njit
def choices(rows, hits):
    for i in range(hits.shape[0]):
        hits[i] = chosen(rows[0])


def parse(**fields):
    return fault_kinds().parse({"kind": "loss", "on": "all", **fields})


def hits_of(choice, seed: int, count: int = FRAMES) -> np.ndarray:
    rows = IMPAIRMENT.allocate(1)
    rows[0].threshold = threshold(choice.start)
    for name, value in choice.settings().items():
        rows[0][name] = value
    rows[0].random = (seed * 0x9E3779B97F4A7C15 + 0x1234567) & 0x7FFFFFFFFFFFFFFF
    hits = np.zeros(count, np.bool_)
    choices(rows, hits)
    return hits


def runs_of(hits: np.ndarray) -> np.ndarray:
    """Lengths of the runs of lost frames."""
    edges = np.diff(np.concatenate(([0], hits.astype(np.int8), [0])))
    return np.flatnonzero(edges == -1) - np.flatnonzero(edges == 1)


@pytest.mark.parametrize("seed", [1, 5, 77])
@pytest.mark.parametrize("probability", [0.001, 0.01, 0.2, 0.5, 0.9])
def test_of_a_million_frames_the_share_is_lost_within_the_binomials_interval(probability, seed):
    hits = hits_of(choice_of(parse(probability=probability)), seed)
    # 99.9 % of a normal distribution, as the binomial's is at this size
    allowed = 3.2905 * math.sqrt(FRAMES * probability * (1 - probability))
    assert abs(int(hits.sum()) - FRAMES * probability) <= allowed
    assert np.array_equal(hits[:1000], hits_of(choice_of(parse(probability=probability)), seed, 1000))


@pytest.mark.parametrize(("probability", "burst"), [(0.01, 5), (0.1, 3), (0.3, 20)])
def test_bursts_have_their_length_and_the_share_that_was_asked_for(probability, burst):
    hits = hits_of(choice_of(parse(probability=probability, params={"model": "burst", "burst": burst})), 3)
    lengths = runs_of(hits)[:-1]
    assert (lengths % burst == 0).all()
    assert hits.mean() == pytest.approx(probability, rel=0.03)


@pytest.mark.parametrize(("probability", "burst"), [(0.01, 5), (0.1, 3), (0.3, 20)])
def test_a_gilbert_elliott_model_has_the_mean_loss_and_the_mean_burst_that_were_asked_for(probability, burst):
    hits = hits_of(choice_of(parse(probability=probability, params={"model": "gilbert-elliott", "burst": burst})), 3)
    assert hits.mean() == pytest.approx(probability, rel=0.04)
    assert runs_of(hits).mean() == pytest.approx(burst, rel=0.04)


def test_a_gilbert_elliott_model_by_its_four_numbers_has_their_mean_loss():
    params = {"model": "gilbert-elliott", "good_to_bad": 0.01, "bad_to_good": 0.2, "loss_bad": 0.6, "loss_good": 0.001}
    choice = choice_of(parse(params=params))
    bad = 0.01 / 0.21
    share = bad * 0.6 + (1 - bad) * 0.001
    assert hits_of(choice, 9).mean() == pytest.approx(share, rel=0.04)
    chooser = Chooser(choice, SplitMix64(9))
    assert sum(chooser() for _ in range(200_000)) / 200_000 == pytest.approx(share, rel=0.06)


def test_the_gate_chooses_bursts_as_the_engine_does():
    choice = choice_of(parse(probability=0.1, params={"model": "burst", "burst": 4}))
    assert choice.model == BURST
    chooser = Chooser(choice, SplitMix64(2))
    hits = [chooser() for _ in range(100_000)]
    assert sum(hits) / len(hits) == pytest.approx(0.1, rel=0.05)
    assert all(len(list(run)) % 4 == 0 for hit, run in groupby(hits[:-4]) if hit)


@pytest.mark.parametrize(
    ("fields", "told"),
    [
        ({"params": {"burst": 3}}, "params.burst: means nothing for the model independent"),
        ({"params": {"model": "burst"}}, "params.burst: is missing"),
        ({"params": {"model": "burst", "burst": 0}}, "params.burst: is 0"),
        ({"params": {"model": "burst", "burst": 2, "loss_bad": 0.5}}, "params.loss_bad: means nothing for"),
        ({"params": {"model": "gilbert-elliott", "burst": 2}}, "probability: is 1"),
        ({"probability": 0.1, "params": {"model": "gilbert-elliott"}}, "params.burst: is missing"),
        ({"params": {"model": "gilbert-elliott", "good_to_bad": 0.1}}, "params.bad_to_good: is missing"),
        (
            {"probability": 0.1, "params": {"model": "gilbert-elliott", "good_to_bad": 0.1, "bad_to_good": 0.1}},
            "probability: follows from good_to_bad and bad_to_good",
        ),
        ({"probability": 0.9, "params": {"model": "gilbert-elliott", "burst": 2}}, "probability: is 0.9"),
        ({"params": {"model": "bursts"}}, "params.model: is 'bursts'"),
    ],
)  # fmt: skip
def test_parameters_of_a_model_that_contradict_each_other_are_reported(fields, told):
    with pytest.raises(ConfigError) as caught:
        parse(**fields)
    assert told in str(caught.value)


@given(
    st.floats(0.001, 0.999),
    st.integers(1, 1000),
    st.sampled_from(["burst", "gilbert-elliott"]),
    st.floats(0.0, 1.0),
    st.floats(0.0, 1.0),
)
def test_what_is_taken_is_a_model_of_probabilities(probability, burst, model, bad, good):
    params = {"model": model, "burst": burst}
    if model == "gilbert-elliott":
        params |= {"loss_bad": bad, "loss_good": good}
    try:
        choice = choice_of(parse(probability=probability, params=params))
    except ConfigError:
        return
    assert all(0.0 <= p <= 1.0 for p in (choice.start, choice.enter, choice.leave, choice.hit_bad, choice.hit_good))


@given(st.binary(min_size=15, max_size=200), st.integers(1, 64), st.booleans(), st.integers(0, 1 << 64))
def test_as_many_bits_are_inverted_as_asked_and_the_addresses_stay(frame, bits, whole, seed):
    changed = corrupted(frame, bits, SplitMix64(seed), whole=whole)
    different = sum((a ^ b).bit_count() for a, b in zip(frame, changed, strict=True))
    assert different in {0, bits}
    if not whole:
        assert changed[:14] == frame[:14]


def watched(watchdog: int = 30) -> FaultLine:
    line = FaultLine(watchdog=watchdog)
    line.connect()
    line.frames = []
    line.world.watch(lambda _port, frame, now, way: line.frames.append((now, frame)) if way == "out" else None)
    line.run(0.2)
    return line


def counter(frame: bytes) -> int:
    return int.from_bytes(frame[-4:-2], "big")


def steps(line: FaultLine) -> list[int]:
    return [(counter(b) - counter(a)) & 0xFFFF for (_, a), (_, b) in pairwise(line.frames)]


@pytest.mark.parametrize("direction", ["out", "in"])
def test_cyclic_frames_are_late_by_the_time_that_was_asked_for_with_their_own_counter(direction):
    line = watched()
    row = line.input_row() if direction == "out" else line.drive_row()
    line.run(CYCLE)
    due = int(line.farm.columns.ppm[0].next_ns)
    fault = line.add("delay", direction=direction, params={"delay": "21ms", "frames": "cyclic"})
    before = int(row.received)
    line.frames.clear()
    line.run(10 * CYCLE)
    assert 7 <= int(row.received) - before <= 9
    if direction == "out":
        assert {(now - due) % (16 * MS) for now, _ in line.frames} == {21 * MS % (16 * MS)}
        assert set(steps(line)) == {512}
    assert fault.evidence().activations in {9, 10, 11}
    assert line.losses() == 0
    line.clear(fault.id)
    line.run(2 * CYCLE)
    # what waited arrived at once, and nothing was lost
    assert int(row.received) - before in {11, 12, 13}
    assert int(row.discarded[DISCARD_COUNTER]) == 0
    assert line.rows_free()
    assert not int(line.farm.columns.engine[0].held_out) + int(line.farm.columns.engine[0].held_in)


def test_jitter_keeps_the_order_unless_frames_may_overtake():
    for overtake in (False, True):
        line = watched()
        before = int(line.input_row().discarded[DISCARD_COUNTER])
        params = {"delay": "0ms", "jitter": "60ms", "frames": "cyclic", "overtake": overtake}
        line.add("delay", direction="out", seed=1, params=params)
        line.run(100 * CYCLE)
        assert (int(line.input_row().discarded[DISCARD_COUNTER]) > before) is overtake
        assert line.losses() == 0


def test_a_delayed_frame_that_was_counted_still_arrives_at_its_time():
    line = watched()
    line.frames.clear()
    fault = line.add("delay", direction="out", count=1, params={"delay": "50ms", "frames": "cyclic", "overtake": True})
    line.run(10 * CYCLE)
    assert fault.state == "ended"
    late = [now for (now, a), step in zip(line.frames[1:], steps(line), strict=True) if step > 0x8000]
    assert len(late) == 1


@pytest.mark.parametrize("again", [{}, {"rate": "60/min", "times": 2}])
def test_a_request_that_waits_for_the_drive_when_its_delay_is_over_arrives_then_and_the_delay_ends_once(again):
    line = FaultLine()
    line.connect()
    delay = line.add("delay", "axis-01", params={"frames": "rpc", "delay": "10s"}, direction="in", for_="3s", **again)
    line.until(lambda: delay.state.value == "active")
    line.add("ar-abort", "axis-01", count=1)
    line.run(30.0)
    assert delay.state.value == "ended"
    assert delay.evidence().activations
    ends = [entry for entry in line.log.entries("axis-01") if entry.data.get("id") == delay.id]
    assert [entry.event for entry in ends] == ["fault injected", "injected fault ended"] * again.get("times", 1)
    assert not line.farm.link.in_force(line.farm.axes[0].port.index)
    assert line.plc.all_connected


@pytest.mark.parametrize("direction", ["out", "in"])
def test_copies_of_a_cyclic_frame_are_discarded_by_their_counter(direction):
    line = watched()
    row = line.input_row() if direction == "out" else line.drive_row()
    before, got = int(row.discarded[DISCARD_COUNTER]), int(row.received)
    fault = line.add("duplicate", direction=direction, count=3, params={"copies": 2, "frames": "cyclic"})
    line.run(10 * CYCLE)
    assert int(row.discarded[DISCARD_COUNTER]) == before + 6
    assert int(row.received) == got + 10
    assert fault.state == "ended"


@pytest.mark.parametrize("direction", ["out", "in"])
def test_a_cyclic_frame_behind_later_ones_is_discarded_by_its_counter(direction):
    line = watched()
    row = line.input_row() if direction == "out" else line.drive_row()
    before, got = int(row.discarded[DISCARD_COUNTER]), int(row.received)
    line.frames.clear()
    fault = line.add("reorder", direction=direction, count=1, params={"distance": 2, "frames": "cyclic"})
    line.run(10 * CYCLE)
    assert int(row.discarded[DISCARD_COUNTER]) == before + 1
    assert int(row.received) == got + 9
    assert fault.state == "ended"
    if direction == "out":
        assert (0x10000 - 2 * 512) in steps(line)


def test_corrupt_cyclic_frames_differ_in_as_many_bits_and_the_next_ones_are_whole():
    line = watched()
    line.run(2 * CYCLE)
    good = line.frames[-1][1]
    fault = line.add("corrupt", direction="out", count=1, seed=3, params={"bits": 5, "frames": "cyclic"})
    line.frames.clear()
    line.run(3 * CYCLE)
    assert fault.evidence().activations == 1
    assert line.frames[0][1][:18] == good[:18]
    assert line.frames[0][1][20:-4] != good[20:-4] or line.frames[0][1][18:20] != good[18:20]
    assert line.frames[1][1][:20] == good[:20]
    assert line.losses() == 0


@pytest.mark.parametrize("seed", range(6))
def test_of_cyclic_frames_that_are_corrupted_on_their_way_in_the_next_ones_are_whole(seed):
    line = watched()
    line.run(2 * CYCLE)
    row = line.drive_row()
    got = int(row.received)
    fault = line.add("corrupt", direction="in", count=1, seed=seed, params={"bits": 64, "frames": "cyclic"})
    line.run(10 * CYCLE)
    assert fault.evidence().activations == 1
    # with so many bits the frame itself is not one of this connection any more
    assert int(row.received) - got == 9
    assert line.losses() == 0


def test_a_slow_line_loses_what_it_cannot_carry():
    line = watched(watchdog=60)
    before = int(line.input_row().received)
    # a frame of 64 octets and 24 on the line take 44 ms at 16 kbit/s, nearly three cycles
    fault = line.add("throttle", direction="out", params={"rate": 16, "queue": "50ms", "frames": "cyclic"})
    line.run(100 * CYCLE)
    assert 30 <= int(line.input_row().received) - before <= 42
    assert fault.evidence().activations > 50
    line.clear()
    assert line.rows_free()


def test_faults_of_one_drive_act_together_and_end_each_by_itself():
    line = FaultLine(model="hiwin-e1", cycle="4ms", telegram=3, watchdog=30)
    line.connect(20.0)
    line.run(0.5)
    loss = line.add("loss", direction="out", probability=0.1, seed=2, params={"frames": "cyclic"}, for_="2s")
    delay = line.add("delay", direction="out", params={"delay": "9ms", "frames": "cyclic"}, for_="3s")
    life = line.add("sign-of-life-loss", for_="1s")
    line.run(1.5)
    assert [fault.state for fault in (life, loss, delay)] == ["ended", "active", "active"]
    line.run(1.0)
    assert [fault.state for fault in (life, loss, delay)] == ["ended", "ended", "active"]
    line.run(1.0)
    assert delay.state == "ended"
    assert 30 <= loss.evidence().activations <= 75
    assert life.evidence().activations == pytest.approx(250, abs=2)
    assert line.losses() == 0
    assert line.rows_free()
    before = int(line.input_row().received)
    line.run(1.0)
    assert int(line.input_row().received) == before + 250


def test_a_connection_that_breaks_takes_delayed_frames_with_it():
    line = watched()
    line.add("delay", params={"delay": "300ms"}, as_="slow", direction="out")
    line.run(0.2)
    line.add("ar-abort")
    line.run(0.1)
    line.clear()
    line.connect(10.0)
    line.run(0.5)
    assert line.plc.all_connected
    assert not int(line.farm.columns.engine[0].held_out)
    assert line.rows_free()


@pytest.mark.parametrize("kind", ["delay", "duplicate", "reorder", "corrupt", "throttle"])
@pytest.mark.parametrize("frames", ["acyclic", "rpc", "alarms", "dcp", "arp", "lldp", "all"])
def test_a_drive_connects_through_impairments_of_other_frames_and_nothing_is_left(kind, frames):
    line = FaultLine()
    fault = line.add(kind, probability=0.3, params={"frames": frames}) if kind != "throttle" else line.add(
        kind, params={"frames": frames, "rate": 1000}
    )  # fmt: skip
    line.connect(30.0)
    line.run(1.0)
    line.clear(fault.id)
    line.connect(30.0)
    assert line.farm.link.in_force(line.farm.axes[0].port.index) == []
    assert line.rows_free()


@pytest.mark.parametrize(
    ("kind", "params", "told"),
    [
        ("delay", {"delay": "0ms"}, "params.delay: is 0, as the jitter"),
        ("delay", {"delay": "11s"}, "params.delay: is '11s'; allowed: a duration up to 10s,"),
        ("reorder", {"wait": "0ms"}, "params.wait: is '0ms'; allowed: a duration from 1ns to 10s,"),
        ("throttle", {"queue": "11s"}, "params.queue: is '11s'; allowed: a duration up to 10s,"),
        ("corrupt", {"bits": 0}, "params.bits: is 0"),
        ("duplicate", {"frames": "snmp"}, "params.frames: is 'snmp'"),
    ],
)
def test_parameters_that_make_no_sense_are_reported(kind, params, told):
    with pytest.raises(ConfigError) as caught:
        fault_kinds().parse({"kind": kind, "on": "all", "params": params})
    assert told in str(caught.value)


def test_fault_that_holds_a_frame_to_the_drive_ends_once_and_the_frame_goes_on():
    line = watched()
    fault = line.add("delay", direction="in", params={"delay": "10s", "frames": "rpc"}, for_="1s")
    # the controller asks for a connection again, and what the drive does about it looks at the drive's faults
    line.add("ar-abort")
    assert line.until(lambda: line.farm.link.next_deadline() is not None, 0.9)
    assert line.until(lambda: fault.state == "ended", 2.0)
    line.connect(10.0)
    ended = [entry.what for entry in line.log.entries() if isinstance(entry.what, InjectionEnded)]
    assert [what.id for what in ended].count(fault.id) == 1
    assert line.rows_free()
