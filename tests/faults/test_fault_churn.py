"""Faults added and cleared without end leave nothing behind, and find room again."""

from __future__ import annotations

import gc

import pytest
from fault_line import FaultLine
from storm import kept, left_behind

from pnfarm.errors import ConfigError
from pnfarm.faults import manager
from pnfarm.station import event_log

#: One of each way to wait and to act: in the engine, at the gate, on the axis, by a condition, at random.
FIELDS = [
    {"kind": "load", "for_": "2h"},
    {"kind": "load", "when": "velocity > 1e8", "ttl": "1h"},
    {"kind": "loss", "probability": 0.1},
    {"kind": "load", "when": "velocity > 1e8 and zsw1.operation_enabled", "rate": "2/min", "for_": "1s"},
    {"kind": "iops-bad", "count": 1_000_000},
    {"kind": "delay", "for_": "1h"},
    {"kind": "rpc-delay", "for_": "1h"},
    {"kind": "silence", "for_": "1h", "after": "1s"},
]


def churn(line: FaultLine, count: int) -> None:
    for number in range(count):
        line.clear(line.add(**FIELDS[number % len(FIELDS)]).id)
        if number % 50 == 0:
            line.run(0.001)
    line.run(0.001)


def test_two_thousand_adds_and_clears_leave_memory_flat(monkeypatch):
    monkeypatch.setattr(manager, "KEPT", 32)
    monkeypatch.setattr(event_log, "FARM_ENTRIES", 128)
    line = FaultLine()
    line.connect()
    # without it, entries of ended faults would go as soon as they are the first ones
    line.add("load", after="1s", as_="first")
    churn(line, 200)
    before = kept(line)
    gc.collect()
    objects = len(gc.get_objects())
    churn(line, 2000)
    gc.collect()
    assert len(gc.get_objects()) - objects < 500
    after = kept(line)
    assert after.pop("entries kept for them") <= manager.SPARE_ENTRIES + 2
    before.pop("entries kept for them")
    assert after == before
    line.clear()
    assert not left_behind(line)


def test_conditions_of_any_length_find_room_where_shorter_ones_were(line):
    segments = line.faults._conditions._segments
    short = [line.add("load", when="velocity > 1e8") for _ in range(30)]
    assert segments.free < segments.size
    for fault in short[::2]:
        line.clear(fault.id)
    long = " and ".join(["velocity > 1e8"] * 8)
    fault = line.add("load", when=long)
    line.clear(fault.id)
    for fault in short[1::2]:
        line.clear(fault.id)
    assert segments.free == segments.size
    line.plc.columns.program[0].speed = 1000.0
    fault = line.add("load", when=" and ".join(["velocity > 300"] * 8))
    line.run(0.5)
    assert fault.state == "active"


def test_a_table_full_of_conditions_refuses_one_more_and_keeps_nothing_of_it(line):
    watched = line.faults._conditions
    taken = watched._segments.allocate(watched._segments.free - 2)
    with pytest.raises(ConfigError, match="are watched already, the maximum"):
        line.add("load", when="velocity > 1e8 and zsw1.operation_enabled")
    assert (line.faults.list(), line.faults.conditions_watched) == ([], 0)
    watched._segments.release(taken)
    assert line.add("load", when="velocity > 1e8 and zsw1.operation_enabled").state == "waiting"
