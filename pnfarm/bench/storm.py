"""The benchmark ``connect-storm``: many drives at once, with farm and controller on one CPU.

Two controllers are behind one end of the wire, each on a macvlan and in a network namespace of its own.  One runs 64
drives already; the other connects 256 of the same farm.
"""

from __future__ import annotations

import json
import subprocess
import time
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.bench.child import difference
from pnfarm.bench.line import FARM_CPU, PARENT, PEER, PEER_CPU, Child, begun, floor_ends, percentile, wire
from pnfarm.bench.loops import interpreter_loop
from pnfarm.bench.result import Result, Windows
from pnfarm.errors import InternalError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.bench.load import Load

__all__ = ["storm"]

#: Two controllers behind one end of the wire.
CALM, STORMY = "pnbcalm", "pnbstorm"
#: Engines on the farm's CPU: with what they ask for by default, and with the ordinary scheduler.
DEFAULT, ORDINARY = {"cpu": FARM_CPU}, {"cpu": FARM_CPU, "fifo": 0}

STORM_DRIVES = """
  - name: {name}-{{n:04}}
    count: {count}
    model: akd-profinet
    ip: {ip}/16
    limits: lax
"""
RUNNING = STORM_DRIVES.format(name="run", count=64, ip="10.64.0.11")
STORM = """
farm: {name}
link: {{kind: macvlan, parent: {parent}}}
api: off
realtime: {realtime}
drives:{drives}
"""
STORM_CONTROLLER = """
controller:
  name: {name}
  ip: {ip}/16
  interface: {interface}
  cycle: {cycle}
  watchdog_factor: {watchdog}
  program: {{kind: sine, speed_rpm: 600, period: 4s, acknowledge_after: 100ms}}
"""


def _storm_files(realtime: dict[str, int], groups: str) -> tuple[str, str, str]:
    """The farm files: of the farm, of the controller whose 64 drives run already, and of the one that connects 256.

    ``groups``: of the farm's drives, these 64 or none, before the 256.
    """
    many = STORM_DRIVES.format(name="storm", count=256, ip="10.64.2.1")
    farm = STORM.format(name="bench", parent=PARENT, realtime=json.dumps(realtime), drives=groups + many)
    calm = STORM.format(name="calm", parent=PARENT, realtime=json.dumps({"cpu": PEER_CPU}), drives=RUNNING)
    calm += STORM_CONTROLLER.format(name="plc-calm", ip="10.64.255.250", interface=CALM, cycle="4ms", watchdog=400)
    storm = STORM.format(name="storm", parent=PARENT, realtime=json.dumps(ORDINARY | {"nice": 0}), drives=many)
    storm += STORM_CONTROLLER.format(name="plc-storm", ip="10.64.255.251", interface=STORMY, cycle="16ms", watchdog=100)
    return farm, calm, storm


@dataclass(frozen=True, slots=True)
class _Storm:
    """Seconds, milliseconds of CPU per connection at either end, microseconds of lateness before and during."""

    seconds: float
    farm_ms: float
    plc_ms: float
    quiet_p99: float
    p99: float
    lost: int


@contextmanager
def _line() -> Iterator[None]:
    """A wire whose far end carries an interface for each of the two controllers."""
    with wire():
        for name in (CALM, STORMY):
            subprocess.run(["ip", "link", "add", "link", PEER, name, "type", "macvlan", "mode", "bridge"], check=True)
        yield


def _connect(plc: Child) -> dict[str, Any]:
    answer = plc.told("connected 120")
    if not answer["connected"]:
        raise InternalError("256 drives did not connect within 120 s")
    return answer


def _storm(seconds: float, realtime: dict[str, int], load: Load) -> _Storm:
    farm_file, calm_file, storm_file = _storm_files(realtime, RUNNING)
    with _line(), ExitStack() as stack:
        farm = begun(stack, "farm", FARM_CPU, file=farm_file)
        calm = begun(stack, "plc", PEER_CPU, file=calm_file, interface_from_outside=CALM)
        plc = begun(stack, "plc", FARM_CPU, file=storm_file, interface_from_outside=STORMY, hold=True)
        if not calm.told("connected 60")["connected"]:
            raise InternalError("64 drives did not connect within 60 s")
        # let the start-up of the 64 settle; then measure a quiet period of the length asked for
        time.sleep(2.0)
        with load:
            before = farm.told("mark")
            # nothing to wait for: the quiet period itself
            time.sleep(seconds)
            begin = farm.told("mark")
            start = time.monotonic()
            connected = _connect(plc)
            took = time.monotonic() - start
            end = farm.told("mark")
        during, quiet = difference(begin, end), difference(before, begin)
        lost = during["expirations"] + calm.told("mark")["expirations"]
    # subtract what the 64 cost in quiet operation
    farm_cpu = during["cpu"] - quiet["cpu"] / quiet["wall"] * during["wall"]
    return _Storm(
        took,
        farm_cpu / 256 * 1e3,
        connected["cpu"] / 256 * 1e3,
        percentile(quiet["lateness"], 0.99),
        percentile(during["lateness"], 0.99),
        lost,
    )


def _floor_p99(seconds: float, load: Load) -> float:
    """Lateness of a minimal loop that exchanges the frames of the 64, beside the same storm; it takes about so long."""
    farm_file, _, storm_file = _storm_files(ORDINARY, "")
    with _line(), ExitStack() as stack:
        begun(stack, "farm", FARM_CPU, file=farm_file)
        plc = begun(stack, "plc", FARM_CPU, file=storm_file, interface_from_outside=STORMY, hold=True)
        floor, calm = stack.enter_context(floor_ends(64, 4, 1_000_000, far=CALM, scheduled={"fifo_priority": 0}))
        with load:
            for child in (floor, calm):
                child.ask(f"measure {seconds}")
            _connect(plc)
            answer = floor.answer()
            calm.answer()
    return percentile(answer["lateness"], 0.99)


def storm(seconds: float, load: Load) -> list[Result]:
    """Connect 256 drives at once, both ends on one core, while 64 others run at 4 ms."""
    loops = [interpreter_loop(3)]
    first = _storm(seconds, DEFAULT, load)
    loops.append(interpreter_loop(3))
    other = _storm(seconds, ORDINARY, load)
    floor = _floor_p99(other.seconds, load)
    loops.append(interpreter_loop(3))
    loop = Windows(loops)
    took, lost = max(first.seconds, other.seconds), first.lost + other.lost
    farm_ms, plc_ms = max(first.farm_ms, other.farm_ms), max(first.plc_ms, other.plc_ms)
    ratio, ordinary = first.p99 / first.quiet_p99, other.p99 / floor
    unit = "ms of CPU per connection"
    return [
        Result("connect-storm-256", took, "s", took * 1e3 / loop.median, "<= 8", took <= 8),
        Result("connect-storm-farm", farm_ms, unit, farm_ms / loop.median, "<= 20", farm_ms <= 20),
        Result("connect-storm-controller", plc_ms, unit, plc_ms / loop.median, "<= 20", plc_ms <= 20),
        Result("connect-storm-lateness-p99", first.p99, "us, SCHED_FIFO", None, "none", True),
        Result("connect-storm-lateness-ratio", ratio, "during over before", None, "<= 2", ratio <= 2),
        Result(
            "connect-storm-ordinary-p99", other.p99, "us, ordinary scheduler", ordinary, "ratio <= 1", ordinary <= 1
        ),
        Result("connect-storm-ordinary-floor", floor, "us, a minimal loop in the storm", 1.0, "none", True),
        Result("connect-storm-expirations", lost, "of 64 connections", None, "0", lost == 0),
        loop.row("connect-storm-interpreter", "ms for a fixed loop in Python", 1.0),
    ]
