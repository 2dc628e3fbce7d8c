"""How long after its request a fault is on the wire: the whole way, over HTTP, in a farm at work.

A tap (a packet socket with the kernel's time stamps) on the farm's interface sees the drives' frames leave.  The time
counts from before the request is sent to the first frame with the changed data status.  The floor is the same request
as a dry run, and then the drive's next frame: what HTTP and the wait for the cycle cost, with nothing injected.
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
from typing import TYPE_CHECKING, Any

from pnfarm.bench.line import PARENT, PEER_CPU, farm_and_plc
from pnfarm.bench.result import WINDOWS, Result, Windows
from pnfarm.errors import InternalError
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET, ETHERTYPE_VLAN
from pnfarm.wire.mac import parse_mac

if TYPE_CHECKING:
    from pnfarm.bench.load import Load

__all__ = ["fault_latency"]

DRIVES, CYCLE, CYCLE_NS = 16, "4ms", 4_000_000
DRIVE, API = "axis-0001", ("127.0.0.1", 8702)
GOAL_NS = CYCLE_NS + 2_000_000
#: Data status: the provider is in RUN.
RUNS = 0x10
SO_TIMESTAMPNS = 35
ETH_P_ALL = 3
LONGEST_SECONDS = 2.0
FEWEST = 100
#: What the goal is about, and the normal distribution's deviation that one of a hundred exceeds.
SHARE, ONE_IN_100 = 0.99, 2.33


class _Tap:
    """The cyclic frames that one drive sends: (when they left, ns since the epoch; data status)."""

    def __init__(self, mac: bytes) -> None:
        self._mac = mac
        self._socket = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
        self._socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self._socket.settimeout(LONGEST_SECONDS)
        self._socket.bind((PARENT, ETH_P_ALL))

    def close(self) -> None:
        self._socket.close()

    def first(self, after_ns: int, *, runs: bool | None) -> int:
        """When the first frame from then on left, whose provider is in RUN, in STOP, or either (None)."""
        until = time.monotonic() + LONGEST_SECONDS
        while time.monotonic() < until:
            frame, ancillary, _, _ = self._socket.recvmsg(2048, 64)
            when = self._stamp(ancillary)
            if when < after_ns or frame[6:12] != self._mac:
                continue
            place = 16 if int.from_bytes(frame[12:14], "big") == ETHERTYPE_VLAN else 12
            kind, frame_id = (int.from_bytes(frame[i : i + 2], "big") for i in (place, place + 2))
            if kind != ETHERTYPE_PROFINET or not 0x8000 <= frame_id < 0xC000:
                continue
            if runs is None or bool(frame[-2] & RUNS) is runs:
                return when
        raise InternalError(f"the tap saw no such frame of {DRIVE} within {LONGEST_SECONDS:g} s")

    @staticmethod
    def _stamp(ancillary: list[Any]) -> int:
        for level, kind, data in ancillary:
            if level == socket.SOL_SOCKET and kind == SO_TIMESTAMPNS:
                seconds, rest = (int.from_bytes(data[i : i + 8], sys.byteorder, signed=True) for i in (0, 8))
                return seconds * 1_000_000_000 + rest
        raise InternalError("the kernel gave a frame no time stamp")


def _call(api: http.client.HTTPConnection, method: str, path: str, body: Any = None) -> Any:
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


def _row(name: str, times_ns: list[int], share: float, floor: float, goal: str = "none", ok: bool = True) -> Result:
    """A share of all times, because those of a window are few; the spread is that of windows in the order of time."""
    value, size = _share(times_ns, share), -(-len(times_ns) // WINDOWS)
    windows = Windows(_share(times_ns[at : at + size], share) for at in range(0, len(times_ns), size))
    return Result(f"fault-latency-{name}", value, "ms", value / floor, goal, ok, windows.spread)


def fault_latency(seconds: float, load: Load) -> list[Result]:
    """Inject a fault by the API into one of 16 drives at 4 ms: from the request to the first changed frame."""
    faults, floors = _measured(seconds, load)
    usual, floor = _share(floors, 0.5), _share(floors, SHARE)
    # what the machine alone needs for the request and the next frame cannot be had faster
    goal = GOAL_NS / 1e6
    ok = meets(faults, max(goal, floor))
    return [
        _row("p50", faults, 0.5, usual),
        _row("p99", faults, SHARE, floor, f"<= {goal:g} (one cycle + 2), or the floor", ok),
        _row("floor-p50", floors, 0.5, usual),
        _row("floor-p99", floors, SHARE, floor),
    ]


def _measured(seconds: float, load: Load) -> tuple[list[int], list[int]]:
    """Times of faults and of the floor, in turn, ns."""
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    # beside the controller: the farm has its CPU for itself
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {PEER_CPU})
    faults: list[int] = []
    floors: list[int] = []
    rng = random.Random(1)
    fault = {"kind": "provider-stop", "on": DRIVE}
    try:
        with farm_and_plc(DRIVES, CYCLE, 64, api=f"{API[0]}:{API[1]}"):
            api = http.client.HTTPConnection(*API, timeout=10)
            tap = _Tap(parse_mac(_call(api, "GET", f"drives/{DRIVE}")["mac"]))
            try:
                with load:
                    end = time.monotonic() + seconds
                    while time.monotonic() < end or len(faults) < FEWEST:
                        # any phase of the cycle
                        time.sleep(rng.uniform(0.005, 0.015))
                        begin = time.time_ns()
                        injected = _call(api, "POST", "faults", fault)
                        faults.append(tap.first(begin, runs=False) - begin)
                        _call(api, "DELETE", f"faults/{injected['id']}")
                        tap.first(time.time_ns(), runs=True)
                        # as for the fault
                        time.sleep(rng.uniform(0.005, 0.015))
                        begin = time.time_ns()
                        _call(api, "POST", "faults?dry_run=true", fault)
                        floors.append(tap.first(time.time_ns(), runs=None) - begin)
            finally:
                tap.close()
                api.close()
    finally:
        os.sched_setaffinity(0, before)
    return faults, floors
