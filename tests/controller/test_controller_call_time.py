"""The time of a PLC program's call in virtual time: up to a cycle nothing, beyond it a missed cycle for all axes."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from pnfarm.controller.line import VirtualLine
from pnfarm.farm.file.reading import FarmFileError, parse_farm

RIGHT = Path(__file__).parents[2] / "configs" / "programs" / "right.py"
FILE = """
farm: load
link: {{kind: memory}}
drives:
  - {{name: "axis-{{n:02}}", count: {drives}, model: moog-msd, telegram: 2, ip: 10.77.0.11/24}}
controller:
  ip: 10.77.0.1/24
  cycle: 4ms
  program: {{python: "{program}", call_time: {call_time}}}
"""


def missed(drives: int, call_time: str) -> list[int]:
    line = asyncio.run(VirtualLine.create(parse_farm(FILE.format(drives=drives, program=RIGHT, call_time=call_time))))
    assert line.world.run(10, until=lambda: line.plc.all_connected)
    line.world.run(0.5)
    before = [line.programs.snapshot(f"axis-{n:02}")["missed_cycles"] for n in range(1, drives + 1)]
    line.world.run(1.0)
    after = [line.programs.snapshot(f"axis-{n:02}")["missed_cycles"] for n in range(1, drives + 1)]
    asyncio.run(line.close())
    return [late - early for early, late in zip(before, after, strict=True)]


def test_calls_that_fit_into_the_cycle_miss_none() -> None:
    assert missed(4, "900us") == [0] * 4


def test_calls_that_need_more_than_a_cycle_miss_cycles_of_every_axis() -> None:
    found = missed(5, "1ms")
    assert min(found) > 10
    assert max(found) < 250


@pytest.mark.parametrize("value", ["100ns", "2s", "-1ms", "fast"])
def test_a_time_beyond_its_limits_is_refused(value: str) -> None:
    with pytest.raises(FarmFileError, match="call_time"):
        parse_farm(FILE.format(drives=1, program=RIGHT, call_time=value))
