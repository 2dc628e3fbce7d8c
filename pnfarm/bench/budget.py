"""What a frame and a step of a drive's firmware cost on this machine: ``python -m pnfarm.bench.budget``.

A process of its own, because it enters a private network namespace.  Prints one JSON object: ``frame_ns`` and
``step_ns`` of CPU, each null where it could not be measured, with ``why``.
"""

from __future__ import annotations

import json
import socket
import sys
import time
from typing import Any

from pnfarm.errors import PnfarmError
from pnfarm.links.kernel.sandbox import enter_sandbox
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET

__all__ = ["main"]

# The imports come late on purpose: a namespace is entered before anything may start a thread.

#: Stations on the wire, and how often each sends in the time that is measured.
STATIONS = 32
PERIOD_NS = 1_000_000
SECONDS = 0.5
NEAR, FAR = "pnbudget0", "pnbudget1"


def _frame_ns() -> float:
    """CPU of a frame that goes from a macvlan to the far end of a veth pair, or back, in the floor's loop."""
    from pnfarm.engine.floor import make_vectors, run_floor
    from pnfarm.engine.sockets.receive_ring import open_receive_ring
    from pnfarm.links.base import PortSpec
    from pnfarm.links.kernel.interfaces import Interfaces

    with Interfaces() as interfaces:
        interfaces.create_cable(NEAR, FAR)
        wanted = [PortSpec(f"station {n}", bytes((0x02, 0xF1, 0, 0, 0, n))) for n in range(STATIONS)]
        ports = interfaces.create_macvlans("budget", NEAR, wanted)
        far = interfaces.find(FAR, "veth")
    out = [(port.index, port.mac, far.mac) for port in ports]
    back = [(far.index, far.mac, port.mac) for port in ports]
    vectors = make_vectors([*out, *back])
    with socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETHERTYPE_PROFINET)) as sock:
        ring = open_receive_ring(sock, 2 * STATIONS)

        def run(seconds: float) -> None:
            until = time.monotonic_ns() + int(seconds * 1e9)
            run_floor(
                sock.fileno(), ring, vectors.rx, vectors.tx, 1, vectors.counts, vectors.lateness, vectors.times,
                PERIOD_NS, until,
            )  # fmt: skip

        # may compile
        run(0.001)
        vectors.counts[:] = 0
        before = time.process_time_ns()
        run(SECONDS)
        spent = time.process_time_ns() - before
    return spent / max(1, int(vectors.counts[:2].sum()))


def _step_ns() -> float:
    from pnfarm.bench.in_memory.firmware import SPEED, cost_of_a_step

    return cost_of_a_step(SPEED.replace("count: 64", "count: 8"))


def main() -> None:
    """See the module's docstring."""
    answer: dict[str, Any] = {"frame_ns": None, "step_ns": None, "why": ""}
    try:
        enter_sandbox()
        answer["frame_ns"] = _frame_ns()
    except (PnfarmError, OSError) as exc:
        answer["why"] = str(exc)
    answer["step_ns"] = _step_ns()
    json.dump(answer, sys.stdout)


if __name__ == "__main__":
    main()
