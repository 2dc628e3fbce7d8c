"""What is random about impairments: shares, delays, seeds that repeat; for cyclic frames and for all others."""

import math
from itertools import groupby, pairwise

import numpy as np
import pytest
from fault_line import FaultLine

from pnfarm.buses.registry import fault_kinds
from pnfarm.faults.gate.choice import Chooser, choice_of
from pnfarm.faults.gate.shaping import Shape
from pnfarm.station.splitmix import SplitMix64
from pnfarm.wire.ethernet import ETHERTYPE_LLDP, EthernetFrame, emit_ethernet

MS = 1_000_000
CYCLE_NS = 16 * MS
#: For each shape: its fault on some of the frames.
SHAPES = {
    "independent": ("loss", {}),
    "burst": ("loss", {"model": "burst", "burst": 3}),
    "gilbert-elliott": ("loss", {"model": "gilbert-elliott", "burst": 3}),
    "delay": ("delay", {"delay": "3ms", "jitter": "9ms", "overtake": True}),
    "duplicate": ("duplicate", {}),
    "reorder": ("reorder", {"wait": "3ms"}),
    "corrupt": ("corrupt", {"bits": 4}),
}


def choice(**params):
    return choice_of(fault_kinds().parse({"kind": "loss", "on": "all", **params}))


def hits(chosen, seed: int, count: int) -> np.ndarray:
    chooser = Chooser(chosen, SplitMix64(seed))
    return np.fromiter((chooser() for _ in range(count)), np.bool_, count)


@pytest.mark.parametrize("probability", [0.001, 0.2, 0.9])
def test_the_gate_loses_the_share_that_was_asked_for_within_the_binomials_interval(probability):
    count = 200_000
    found = hits(choice(probability=probability), 5, count)
    # 99.9 % of a normal distribution, as the binomial's is at this size
    assert abs(int(found.sum()) - count * probability) <= 3.2905 * math.sqrt(count * probability * (1 - probability))
    # as often behind a lost frame as behind any other
    pairs = int((found[1:] & found[:-1]).sum())
    assert abs(pairs - count * probability**2) <= 5 * math.sqrt(count) * probability


def test_the_gate_loses_by_gilbert_and_elliott_in_bursts_of_the_mean_length_that_was_asked_for():
    found = hits(choice(probability=0.1, params={"model": "gilbert-elliott", "burst": 4}), 5, 200_000)
    lengths = [len(list(run)) for lost, run in groupby(found) if lost]
    assert found.mean() == pytest.approx(0.1, rel=0.05)
    assert np.mean(lengths) == pytest.approx(4, rel=0.05)


def is_uniform(values: np.ndarray, low: float, high: float) -> bool:
    """Kolmogorov and Smirnov, at 99.9 %."""
    ordered = np.sort((values - low) / (high - low))
    steps = np.arange(1, len(ordered) + 1) / len(ordered)
    return float(np.abs(ordered - steps).max()) < 1.95 / math.sqrt(len(ordered)) + 1 / len(ordered)


def test_delays_of_other_frames_have_the_distribution_that_was_asked_for():
    shape = Shape(3, delay_ns=7 * MS, jitter_ns=20 * MS, overtakes=True)
    late = np.array([shape.hit("out", b"", due)[0][0] - due for due in range(0, 20_000 * MS, MS)])
    assert late.min() >= 7 * MS
    assert late.max() < 27 * MS
    assert is_uniform(late, 7 * MS, 27 * MS)


class Wire:
    """Two drives in virtual time, and every cyclic frame that they send: drive, time, octets."""

    def __init__(self) -> None:
        self.line = FaultLine(2, watchdog=60)
        self.line.connect(10.0)
        self.frames: list[tuple[str, int, bytes]] = []
        names = {station.port.index: station.configured_name for station in self.line.farm.axes}
        self.line.world.watch(
            lambda port, frame, now, way: self.frames.append((names[port], now, frame)) if way == "out" else None
        )

    def of(self, drive: str) -> list[tuple[int, bytes]]:
        return [(now, frame) for name, now, frame in self.frames if name == drive]


def counter(frame: bytes) -> int:
    return int.from_bytes(frame[-4:-2], "big")


def test_delays_of_cyclic_frames_have_the_distribution_that_was_asked_for_to_the_tick():
    wire = Wire()
    wire.line.run(0.1)
    zero = [now - counter(frame) * 31_250 for now, frame in wire.of("axis-01")][-1]
    wire.frames.clear()
    params = {"delay": "3ms", "jitter": "12ms", "overtake": True, "frames": "cyclic"}
    wire.line.add("delay", on="axis-01", direction="out", seed=1, params=params)
    wire.line.run(400 * CYCLE_NS / 1e9)
    turn = 0x10000 * 31_250
    late = np.array([(now - counter(frame) * 31_250 - zero) % turn for now, frame in wire.of("axis-01")][1:])
    tick = int(wire.line.farm.columns.engine[0].tick_ns)
    assert len(late) > 390
    assert late.min() >= 3 * MS
    assert late.max() < 15 * MS + tick
    assert is_uniform(late.astype(float), 3 * MS, 15 * MS)


def what_the_engine_does(kind: str, params: dict, seed: int) -> tuple[list, list]:
    """The frames of both drives under the same fault, as (place in time, counter, octets)."""
    wire = Wire()
    fields = {} if kind == "throttle" else {"probability": 0.15}
    wire.line.add(kind, on="all", direction="out", seed=seed, params={**params, "frames": "cyclic"}, **fields)
    begin = wire.line.world.now
    wire.frames.clear()
    wire.line.run(120 * CYCLE_NS / 1e9)
    assert wire.line.losses(0) == wire.line.losses(1) == 0
    first, second = (wire.of(name) for name in ("axis-01", "axis-02"))
    return [(now - begin, frame) for now, frame in first], [(now - begin, frame) for now, frame in second]


def pattern(frames: list) -> list[tuple[int, int]]:
    """What is there of a drive's frames, without its own phase and count."""
    return [(now // CYCLE_NS, (counter(frame) - counter(frames[0][1])) & 0xFFFF) for now, frame in frames]


@pytest.mark.parametrize("shape", SHAPES)
def test_the_engine_does_the_same_to_the_same_frames_by_the_same_seed_and_something_else_to_another_drive(shape):
    kind, params = SHAPES[shape]
    first, second = what_the_engine_does(kind, params, 4)
    assert (first, second) == what_the_engine_does(kind, params, 4)
    assert first != what_the_engine_does(kind, params, 5)[0]
    if kind != "corrupt":
        assert pattern(first) != pattern(second)


def what_the_gate_does(kind: str, params: dict, seed: int) -> tuple[list, list]:
    """What goes on of 300 frames of each of two drives: (time, octets)."""
    line = FaultLine(2, controller=False)
    heard: list[tuple[int, bytes]] = []
    begin = line.world.now
    line.farm_link._switch.attach(bytes(6), lambda _, frame, now: heard.append((now - begin, frame)))
    line.add(kind, on="all", direction="out", seed=seed, probability=0.15, params={**params, "frames": "lldp"})
    other = bytes.fromhex("0180c2000003")
    for number in range(300):
        for station in line.farm.axes:
            payload = number.to_bytes(2, "big") + bytes(44)
            frame = emit_ethernet(EthernetFrame(other, station.port.mac, ETHERTYPE_LLDP, payload))
            line.farm.link.send(station.port.index, frame)
        line.run(0.001)
    line.run(0.1)
    first, second = (station.port.mac for station in line.farm.axes)

    def of(mac: bytes) -> list[tuple[int, bytes]]:
        return [(now, frame[:6] + frame[12:]) for now, frame in heard if frame[6:12] == mac and frame[:6] == other]

    return of(first), of(second)


@pytest.mark.parametrize("shape", SHAPES)
def test_the_gate_does_the_same_to_the_same_frames_by_the_same_seed_and_something_else_to_another_drive(shape):
    kind, params = SHAPES[shape]
    first, second = what_the_gate_does(kind, params, 4)
    assert len(first) > 200
    assert (first, second) == what_the_gate_does(kind, params, 4)
    assert first != what_the_gate_does(kind, params, 5)[0]
    assert first != second


def test_two_kinds_with_one_seed_on_one_drive_hit_different_frames():
    wire = Wire()
    loss = wire.line.add("loss", on="axis-01", direction="out", seed=7, probability=0.3, params={"frames": "cyclic"})
    copies = wire.line.add(
        "duplicate", on="axis-01", direction="out", seed=7, probability=0.3, params={"frames": "cyclic"}
    )
    wire.frames.clear()
    wire.line.run(400 * CYCLE_NS / 1e9)
    lost, repeated = loss.evidence().activations, copies.evidence().activations
    sent = [counter(frame) for _, frame in wire.of("axis-01")]
    assert 85 < lost < 155
    # of those that were repeated, a share of 0.7 was not lost
    both = sum(a == b for a, b in pairwise(sent))
    assert 0.4 * repeated < both < 0.95 * repeated, (lost, repeated, both)
