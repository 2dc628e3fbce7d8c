"""How long after its request a fault or a signal is on the wire: the whole way, over HTTP, in a farm at work.

A tap (a packet socket with the kernel's time stamps) on the farm's interface sees the stations' frames leave.  The time
counts from before the request is sent to the first frame that shows the change.  The floor is the same request with
nothing to change (a fault's dry run), and then the station's next frame: what HTTP and the wait for the cycle cost.
"""

from __future__ import annotations

import http.client
import json
import math
import os
import random
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.bench.line import PARENT, PEER_CPU, farm_and_plc
from pnfarm.bench.result import WINDOWS, Result, Windows
from pnfarm.errors import InternalError
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET, ETHERTYPE_VLAN
from pnfarm.wire.mac import parse_mac

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from pnfarm.bench.load import Load

__all__ = ["API", "Change", "call", "change_times", "fault_latency", "latency_rows"]

DRIVES, CYCLE, CYCLE_NS = 16, "4ms", 4_000_000
DRIVE, API = "axis-0001", ("127.0.0.1", 8702)
#: Whether a cyclic frame, from its FrameID on, shows a change.
Shows = Callable[[bytes], bool]
#: Data status: the provider is in RUN.
RUNS = 0x10
SO_TIMESTAMPNS = 35
ETH_P_ALL = 3
LONGEST_SECONDS = 2.0
FEWEST = 100
#: What the goal is about, and the normal distribution's deviation that one of a hundred exceeds.
SHARE, ONE_IN_100 = 0.99, 2.33


class _Tap:
    """The cyclic frames that one station sends, and when they left, ns since the epoch."""

    def __init__(self, mac: bytes) -> None:
        self._mac = mac
        self._socket = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
        self._socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self._socket.settimeout(LONGEST_SECONDS)
        self._socket.bind((PARENT, ETH_P_ALL))

    def close(self) -> None:
        self._socket.close()

    def first(self, after_ns: int, shows: Shows) -> int:
        """When the first frame from then on left that shows something."""
        until = time.monotonic() + LONGEST_SECONDS
        while time.monotonic() < until:
            frame, ancillary, _, _ = self._socket.recvmsg(2048, 64)
            when = self._stamp(ancillary)
            if when < after_ns or frame[6:12] != self._mac:
                continue
            place = 16 if int.from_bytes(frame[12:14], "big") == ETHERTYPE_VLAN else 12
            kind, frame_id = (int.from_bytes(frame[i : i + 2], "big") for i in (place, place + 2))
            if kind == ETHERTYPE_PROFINET and 0x8000 <= frame_id < 0xC000 and shows(frame[place + 2 :]):
                return when
        raise InternalError(f"the tap saw no such frame of {self._mac.hex(':')} within {LONGEST_SECONDS:g} s")

    @staticmethod
    def _stamp(ancillary: list[Any]) -> int:
        for level, kind, data in ancillary:
            if level == socket.SOL_SOCKET and kind == SO_TIMESTAMPNS:
                seconds, rest = (int.from_bytes(data[i : i + 8], sys.byteorder, signed=True) for i in (0, 8))
                return seconds * 1_000_000_000 + rest
        raise InternalError("the kernel gave a frame no time stamp")


def call(api: http.client.HTTPConnection, method: str, path: str, body: Any = None) -> Any:
    """The API's answer to a request, from JSON; raises :class:`InternalError` for a problem."""
    octets = None if body is None else json.dumps(body).encode()
    api.request(method, f"/api/v1/{path}", octets, {"Content-Type": "application/json"} if octets else {})
    answer = api.getresponse()
    text = answer.read()
    if answer.status >= 300:
        raise InternalError(f"{method} {path}: {text[:200]!r}")
    return json.loads(text)


def _share(times_ns: list[int], share: float) -> float:
    """Milliseconds that this share of the times stays below."""
    return sorted(times_ns)[min(len(times_ns) - 1, int(len(times_ns) * share))] / 1e6


def meets(times_ns: list[int], limit_ms: float) -> bool:
    """Whether no more than 1 % of the times are above the limit, as far as so many of them can say.

    The limit may be such a share of as many times of the floor, so that the counting error is in both: a 99th
    percentile of a thousand times hangs on ten.  Missed is what chance alone does in one run of a hundred.
    """
    expected = len(times_ns) * (1 - SHARE)
    return sum(time > limit_ms * 1e6 for time in times_ns) <= expected + ONE_IN_100 * math.sqrt(2 * expected * SHARE)


@dataclass(frozen=True, slots=True)
class Change:
    """What is timed: ``make`` asks for a change, ``undo`` takes it back, and both say how a frame shows it.

    ``nothing`` is the same request with nothing to change.
    """

    make: Callable[[http.client.HTTPConnection], Shows]
    undo: Callable[[http.client.HTTPConnection], Shows]
    nothing: Callable[[http.client.HTTPConnection], Any]


def latency_rows(head: str, times_ns: tuple[list[int], list[int]], cycle_ns: int) -> list[Result]:
    """Rows of times of changes and of the floor: 50th and 99th percentiles; the goal is one cycle and 2 ms."""
    changes, floors = times_ns
    usual, floor = _share(floors, 0.5), _share(floors, SHARE)
    # what the machine alone needs for the request and the next frame cannot be had faster
    goal = (cycle_ns + 2_000_000) / 1e6
    ok = meets(changes, max(goal, floor))

    def row(name: str, times: list[int], share: float, floor: float, goal: str = "none", ok: bool = True) -> Result:
        # a share of all times, because those of a window are few; the spread is that of windows in the order of time
        value, size = _share(times, share), -(-len(times) // WINDOWS)
        windows = Windows(_share(times[at : at + size], share) for at in range(0, len(times), size))
        return Result(f"{head}-{name}", value, "ms", value / floor, goal, ok, windows.spread)

    return [
        row("p50", changes, 0.5, usual),
        row("p99", changes, SHARE, floor, f"<= {goal:g} (one cycle + 2), or the floor", ok),
        row("floor-p50", floors, 0.5, usual),
        row("floor-p99", floors, SHARE, floor),
    ]


def fault_latency(seconds: float, load: Load) -> list[Result]:
    """Inject a fault by the API into one of 16 drives at 4 ms: from the request to the first changed frame."""
    fault = {"kind": "provider-stop", "on": DRIVE}
    injected: list[Any] = []

    def make(api: http.client.HTTPConnection) -> Shows:
        injected.append(call(api, "POST", "faults", fault))
        return lambda frame: not frame[-2] & RUNS

    def undo(api: http.client.HTTPConnection) -> Shows:
        call(api, "DELETE", f"faults/{injected.pop()['id']}")
        return lambda frame: bool(frame[-2] & RUNS)

    change = Change(make, undo, lambda api: call(api, "POST", "faults?dry_run=true", fault))
    ends = farm_and_plc(DRIVES, CYCLE, 64, api=f"{API[0]}:{API[1]}")
    return latency_rows("fault-latency", change_times(ends, f"drives/{DRIVE}", change, seconds, load), CYCLE_NS)


def change_times(
    ends: AbstractContextManager[Any], station: str, change: Change, seconds: float, load: Load
) -> tuple[list[int], list[int]]:
    """Times of changes and of the floor, in turn, ns, of a farm with its API at :data:`API` and its controller.

    ``station``: the API's path of the one whose frames count.
    """
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    # beside the controller: the farm has its CPU for itself
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {PEER_CPU})
    changes: list[int] = []
    floors: list[int] = []
    rng = random.Random(1)
    try:
        with ends:
            api = http.client.HTTPConnection(*API, timeout=10)
            tap = _Tap(parse_mac(call(api, "GET", station)["mac"]))
            try:
                with load:
                    end = time.monotonic() + seconds
                    while time.monotonic() < end or len(changes) < FEWEST:
                        # any phase of the cycle
                        time.sleep(rng.uniform(0.005, 0.015))
                        begin = time.time_ns()
                        shows = change.make(api)
                        changes.append(tap.first(begin, shows) - begin)
                        undone = change.undo(api)
                        tap.first(time.time_ns(), undone)
                        # as for the change
                        time.sleep(rng.uniform(0.005, 0.015))
                        begin = time.time_ns()
                        change.nothing(api)
                        floors.append(tap.first(time.time_ns(), lambda _: True) - begin)
            finally:
                tap.close()
                api.close()
    finally:
        os.sched_setaffinity(0, before)
    return changes, floors
