"""``python -m tests.fuzz --engine``: changed cyclic frames for the compiled engine, a million a second, bounds checked.

A farm of all models on networks and its controllers in memory, connected.  Each round one table sends its frames;
copies of them, most of them changed, are what the other one receives, which then makes a tick: so changed set points
reach the drives' firmware.  Each chunk of rounds is made twice from the same state, with other octets behind the ends
of the frames.  What must hold afterwards:

- no index left its array: the engine is compiled with checks for this;
- both times came to the same octets, so that nothing behind a frame's end is looked at;
- what the event loop writes is as it was;
- each frame is counted once: as accepted, discarded for a reason, unknown or malformed (without impairments);
- every real number of a drive is one.
"""

# ruff: noqa: T201 - what it prints is its answer

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numba
import numpy as np

from pnfarm.engine.channels import class1
from pnfarm.engine.columns import RX_BATCH, Columns
from pnfarm.engine.tick import receive, tick
from pnfarm.firmware.axis import AXIS
from pnfarm.table.channel import CPM, FRAME_SLOT, FRAMING_RTC, OPEN, PPM
from pnfarm.table.compiling.compiled import compiled, inlined
from pnfarm.table.image import IMAGE
from pnfarm.table.layout import Layout
from pnfarm.testing import Line

GSDML = Path(__file__).resolve().parents[2] / "configs/gsdml"
FARM = f"""
farm: fuzzed
link: {{kind: memory}}
drives:
  - {{name: 'akd-{{n}}', count: 4, model: akd-profinet, ip: 10.77.0.11/23, cycle: 4ms, limits: lax}}
  - {{name: 'e1-{{n}}', count: 4, model: hiwin-e1, ip: 10.77.0.31/23, cycle: 4ms}}
  - {{name: 'msd-{{n}}', count: 4, model: moog-msd, ip: 10.77.0.51/23, cycle: 4ms}}
  - {{name: 'eip-{{n}}', count: 4, model: akd-ethernetip, ip: 10.77.0.71/23}}
devices:
  - name: island
    gsdml: {GSDML}/GSDML-V2.35-Example-Island-20261127.xml
    access_point: DAP 1
    ip: 10.77.0.91/23
    slots: {{1: 16DI, 2: 8DO, 3: EX-AI-4, 4: VALVES}}
controller:
  name: plc
  ip: 10.77.1.250/23
  cycle: 4ms
  program: {{kind: constant, speed_rpm: 600, acknowledge_after: 200ms}}
  ethernetip: {{ip: 10.77.1.251/23, rpi: 10ms}}
"""
IMPAIRMENTS: tuple[dict[str, Any], ...] = (
    {"kind": "duplicate", "copies": 2, "probability": 0.2},
    {"kind": "reorder", "distance": 3, "probability": 0.2},
    {"kind": "corrupt", "bits": 3, "probability": 0.1, "whole": True},
    {"kind": "delay", "delay": "1ms", "jitter": "3ms", "overtake": True},
)
#: A chunk is this many rounds, each a tick behind this many frames.
ROUNDS, FRAMES = 1024, RX_BATCH
ROUND_NS = 2_000_000
#: Octets that are written behind a frame's end.
BEHIND = 128
#: Places in a packet of EtherNet/IP.
CHECKSUM, SEQUENCE = class1.HEADER + class1.IPV4 + 6, class1.LEAST_PLACE + 4
#: The least that a link gives.
HEADER = 14
REPORT_SECONDS = 10.0
#: What the event loop writes, and its threads.
NOT_THE_ENGINE = {"station", "parameter", "fault", "lease"}
LAYOUTS = {"cpm": CPM, "ppm": PPM, "axis": AXIS, "image": IMAGE}
#: Columns whose memory is that of others.
VIEWS = {"frame_octets", "axis_reals", "axis_words", "image_words", "rx_frames"}
#: Counts of a table beside those of its rows.
COUNTS = ("received", "unknown", "malformed")


@inlined
def _next(state: Any) -> int:
    """xorshift, 60 bits."""
    x = state[0]
    x ^= (x << 13) & 0xFFFFFFFFFFFFFFF
    x ^= x >> 7
    x ^= (x << 17) & 0xFFFFFFFFFFFFFFF
    state[0] = x
    return int(x)


@inlined
def _changed(frame: Any, length: int, other: Any, state: Any) -> int:
    """Change a frame in place, one time in eight not at all; its length then."""
    kind = _next(state) & 31
    r = _next(state)
    at = (r >> 8) % length
    if kind < 4:
        pass
    elif kind < 8:
        frame[at] = r & 0xFF
    elif kind < 11:
        frame[at] ^= 1 << (r & 7)
    elif kind < 14:
        longer = HEADER + r % (FRAME_SLOT - HEADER)
        for i in range(length, longer):
            frame[i] = r >> (i & 31) & 0xFF
        length = longer
    elif kind < 16:
        for _ in range(1 + (r & 7)):
            frame[_next(state) % length] = _next(state) & 0xFF
    elif kind < 18:
        value = 0 if r & 1 else 0xFF
        for i in range(at, min(length, at + 4)):
            frame[i] = value
    elif kind < 20:
        for i in range(at, min(length, at + 16)):
            frame[i] = other[i]
    elif kind < 22:
        frame[(r >> 8) % min(length, 64)] = r & 0xFF
    elif kind < 25:
        frame[length - 1 - (r >> 8) % min(length, 8)] = r & 0xFF
    elif kind < 29:
        # behind the header of either bus, at the process data
        for _ in range(1 + (r & 3)):
            frame[16 + _next(state) % max(1, length - 20)] = _next(state) & 0xFF
    elif kind < 30:
        for i in range(length):
            frame[i] = _next(state) & 0xFF
    else:
        for i in range(min(length, 20)):
            frame[i] = other[i]
    return length


@inlined
def _renew(consumer: Any, ahead: int, frame: Any, length: int) -> None:
    """Give a changed frame a count so far ahead of its consumer's, so that it is looked at further."""
    if consumer.framing == FRAMING_RTC:
        count = int(consumer.counter) + ahead
        frame[length - 4] = count >> 8 & 0xFF
        frame[length - 3] = count & 0xFF
    elif length > SEQUENCE + 4:
        count = int(consumer.sequence) + ahead
        for i in range(4):
            frame[SEQUENCE + i] = count >> (8 * i) & 0xFF
        # none
        frame[CHECKSUM] = 0
        frame[CHECKSUM + 1] = 0


@compiled
def storm(
    sender: Columns,
    receiver: Columns,
    rows: Any,
    lengths: Any,
    ports: Any,
    targets: Any,
    now: int,
    rounds: int,
    fill: int,
    state: Any,
) -> int:
    """Rounds of frames from the ``rows`` of the sender's store to the receiver's consumers ``targets``; the time then.

    ``fill``: octets behind a frame's end; ``state`` int64[1]: that of the random numbers.
    """
    engine = receiver.engine[0]
    for _ in range(rounds):
        now += ROUND_NS
        tick(sender, 0, now)
        for i in range(FRAMES):
            one = _next(state) % rows.shape[0]
            row = rows[one]
            frame = receiver.rx_frames[i]
            for k in range(lengths[one]):
                frame[k] = sender.frames[row, k]
            other = sender.frames[rows[_next(state) % rows.shape[0]]]
            length = _changed(frame, int(lengths[one]), other, state)
            if _next(state) & 3:
                _renew(receiver.cpm[targets[one]], 1 + i, frame, length)
            for k in range(length, min(length + BEHIND, FRAME_SLOT)):
                frame[k] = fill
            receiver.rx_length[i] = length
            receiver.rx_port[i] = ports[one] if _next(state) & 31 else ports[_next(state) % ports.shape[0]]
            receiver.rx_ns[i] = now - ROUND_NS + i
        receive(receiver, FRAMES)
        tick(receiver, 0, now)
        if _next(state) & 3:
            # else nobody reads the events
            engine.event_head = 0
    return now


@dataclass
class Side:
    """Who receives, who sends to it, and in which rows, so many octets, to which ports and consumers."""

    name: str
    sender: Columns
    receiver: Columns
    rows: Any
    lengths: Any
    ports: Any
    targets: Any

    def arrays(self) -> dict[str, Any]:
        """Everything that a storm can change."""
        found: dict[str, Any] = {}
        for who, columns in (("sender", self.sender), ("receiver", self.receiver)):
            for name, value in zip(columns._fields, columns, strict=True):
                if name in VIEWS:
                    continue
                parts = value._asdict() if hasattr(value, "_asdict") else {"": value}
                found.update({f"{who}.{name}{part and '.'}{part}": one for part, one in parts.items()})
        return found


def sides(line: Line) -> list[Side]:
    """The farm's table as receiver, and each controller's."""
    farm = line.core.columns
    others = [node.columns for node in line._line.controllers]
    found = []
    for number, other in enumerate(others):
        for name, sender, receiver in ((f"farm {number}", other, farm), (f"controller {number}", farm, other)):
            consumers = {
                (int(one.destination), int(one.frame_id)): (int(one.port), row)
                for row, one in enumerate(receiver.cpm)
                if one.active == OPEN
            }
            wanted = []
            for row in np.flatnonzero(sender.ppm.active == OPEN).tolist():
                destination = int.from_bytes(sender.frames[row, :6].tobytes(), "big")
                if target := consumers.get((destination, int(sender.ppm.frame_id[row]))):
                    wanted.append((row, int(sender.ppm.length[row]), *target))
            if wanted:
                columns = (np.array(column, np.int64) for column in zip(*wanted, strict=True))
                found.append(Side(name, sender, receiver, *columns))
    return found


def _reals(layout: Layout, table: Any) -> dict[str, Any]:
    return {key: layout.read(table, key) for key, field in layout.fields.items() if field.kind == "f8"}


class Chunks:
    """Chunks of one side, each from the same state."""

    def __init__(self, side: Side, now: int, *, counted: bool) -> None:
        self.side, self.now, self.counted = side, now, counted
        self._before = {name: one.copy() for name, one in side.arrays().items()}
        self._fixed = {
            (who, layout.name, key): layout.read(getattr(columns, name), key).copy()
            for who, columns in (("sender", side.sender), ("receiver", side.receiver))
            for name, layout in LAYOUTS.items()
            for key, field in layout.fields.items()
            if field.writer in NOT_THE_ENGINE
        }
        self.outcomes = dict.fromkeys(("accepted", "discarded", "unknown", "malformed"), 0)

    def make(self, seed: int, rounds: int) -> int:
        """One chunk, twice; how many frames.  Raises AssertionError."""
        ends = []
        for fill in (0x00, 0xFF):
            self._restore()
            counts = self._counts()
            side = self.side
            state = np.array([seed | 1], np.int64)
            connections = (side.rows, side.lengths, side.ports, side.targets)
            storm(side.sender, side.receiver, *connections, self.now, rounds, fill, state)
            self._check(counts, rounds * FRAMES)
            ends.append({name: one.tobytes() for name, one in side.arrays().items() if ".rx_" not in name})
        for name, one in ends[0].items():
            assert one == ends[1][name], f"octets behind a frame's end change {name}"
        return 2 * rounds * FRAMES

    def _restore(self) -> None:
        for name, one in self.side.arrays().items():
            np.copyto(one, self._before[name])

    def _counts(self) -> dict[str, int]:
        columns = self.side.receiver
        discarded = columns.cpm.discarded.sum()
        return {
            **{name: int(columns.engine[0][name]) for name in COUNTS},
            "accepted": int(columns.cpm.received.sum()),
            "discarded": int(discarded),
        }

    def _check(self, before: dict[str, int], frames: int) -> None:
        after = self._counts()
        gone = {name: after[name] - before[name] for name in after}
        assert gone["received"] == frames, f"{gone['received']} of {frames} frames received"
        for name in self.outcomes:
            self.outcomes[name] += gone[name]
        if self.counted:
            assert sum(gone[name] for name in self.outcomes) == frames, f"{frames} frames, and counted were {gone}"
        self.check_untouched()
        self.check_numbers()

    def check_untouched(self) -> None:
        """What the event loop writes is as it was.  Raises AssertionError."""
        for (who, name, key), value in self._fixed.items():
            columns = self.side.sender if who == "sender" else self.side.receiver
            assert (LAYOUTS[name].read(getattr(columns, name), key) == value).all(), f"{who}: {name}.{key} was written"

    def check_numbers(self) -> None:
        """No real number of a drive is none.  Raises AssertionError."""
        for columns in (self.side.sender, self.side.receiver):
            for key, value in _reals(AXIS, columns.axis).items():
                # infinite is a limit that there is not
                assert not np.isnan(value).any(), f"axis.{key} is not a number"


def _connected(impairments: tuple[dict[str, Any], ...]) -> list[Chunks]:
    """All sides of a farm, its drives of one number with one of the ``impairments``."""
    line = Line.from_text(FARM)
    line.run(3.0)
    for number, impairment in enumerate(impairments, 1):
        line.inject(on=f"*-{number}", seed=number, **impairment)
    found = sides(line)
    for side in found:
        side.name += " with impairments" if impairments else ""
    return [Chunks(side, line.now_ns, counted=not impairments) for side in found]


def main(options: argparse.Namespace) -> int:
    if not numba.config.BOUNDSCHECK:
        print("the engine is compiled without checks of bounds: NUMBA_BOUNDSCHECK=1 is needed", file=sys.stderr)
        return 2
    began = reported = time.monotonic()
    done, turn = 0, options.turn or 0
    chunks = _connected(()) + _connected(IMPAIRMENTS)
    for one in chunks:
        print(f"{one.side.name}: frames of {len(one.side.rows)} connections", file=sys.stderr, flush=True)
    while done < options.count and (options.seconds is None or time.monotonic() - began < options.seconds):
        which = chunks[turn % len(chunks)]
        try:
            done += which.make((options.seed << 32) + (turn << 8), ROUNDS)
        except (AssertionError, IndexError) as exc:
            print(f"failed: {which.side.name}, turn {turn}, seed {options.seed}: {exc}", file=sys.stderr)
            return 1
        if options.turn is not None:
            break
        turn += 1
        now = time.monotonic()
        if now - reported > REPORT_SECONDS:
            reported = now
            print(f"{done:>13,} frames, {done / (now - began):,.0f} a second", file=sys.stderr, flush=True)
    seconds = time.monotonic() - began
    for one in chunks:
        said = ", ".join(f"{count:,} {name}" for name, count in one.outcomes.items())
        print(f"{one.side.name}: {said}")
    print(f"{done:,} frames in {seconds:.0f} s, {done / seconds:,.0f} a second; every one as it should be")
    return 0
