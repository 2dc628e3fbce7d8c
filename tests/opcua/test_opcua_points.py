"""What a client of OPC UA may write and what is told of it, and its way into the farm's loop: without a server."""

from __future__ import annotations

import asyncio
import threading
from typing import Any

import pytest

from pnfarm.opcua.carrier import Carrier
from pnfarm.opcua.points import FarmPoints
from pnfarm.testing import Line

FARM = """farm: t
link: {kind: memory}
drives:
- {name: x, model: akd-profinet, ip: 10.77.0.11/24}
plant:
  models:
  - {name: gripper, kind: cylinder, time: 20ms}
  - {name: lamp, kind: lamp}
  - {name: tank, kind: first-order, gain: 2, time_constant: 10ms}
  wires:
  - gripper.extended -> lamp.on
"""


@pytest.fixture
def line() -> Line:
    return Line.from_text(FARM)


@pytest.fixture
def points(line: Line) -> FarmPoints:
    return FarmPoints(line.core, lambda: line.now_ns, lambda: None)


@pytest.mark.parametrize("forced", [False, True])
def test_an_input_is_writable_if_it_has_no_wire_whoever_has_it_when_it_is_first_asked_for(
    line: Line, points: FarmPoints, forced: bool
) -> None:
    if forced:
        for name, port in (("lamp", "on"), ("gripper", "extend")):
            line.core.with_signals(name)[1].force({port: True})
    writable = {point.name: point.writable for name in ("lamp", "gripper") for point in points.points_of(name)}
    inputs = {"gripper.extend", "gripper.retract", "gripper.stuck"}
    assert {name for name, may in writable.items() if may} == inputs


def test_the_first_write_of_each_input_that_is_not_refused_is_an_event(line: Line, points: FarmPoints) -> None:
    own = {point.name: point for name in ("tank", "gripper") for point in points.points_of(name)}
    known: set[str] = set()

    def told(**values: Any) -> list[str]:
        before = len(line.core.log.entries())
        points.write([(own[name], value) for name, value in values.items()], "scada", "peer", known)
        return [entry.what.signals for entry in line.core.log.entries()[before:]]

    assert told(**{"tank.input": float("nan")}) == []
    assert told(**{"tank.input": 1.0}) == ["tank.input"]
    assert told(**{"tank.input": 2.0}) == []
    assert told(**{"tank.input": 3.0, "gripper.extend": True}) == ["gripper.extend"]


def test_a_client_that_goes_while_the_farm_is_busy_leaves_no_error_in_the_farms_loop() -> None:
    loop, busy = asyncio.new_event_loop(), threading.Event()
    errors: list[Any] = []
    done: list[str] = []
    loop.set_exception_handler(lambda _, context: errors.append(context))
    thread = threading.Thread(target=loop.run_forever)
    thread.start()

    async def ask() -> None:
        carrier = Carrier(loop)
        loop.call_soon_threadsafe(busy.wait)
        gone = asyncio.create_task(carrier(lambda: done.append("gone")))
        # it begins, and waits for the farm's loop, which is busy
        await asyncio.sleep(0)
        gone.cancel()
        await asyncio.wait([gone])
        busy.set()
        await carrier(lambda: done.append("next"))

    try:
        asyncio.run(ask())
    finally:
        busy.set()
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()
    assert errors == []
    assert done == ["next"]
