"""The benchmark ``page-1000``: what viewers of the web page cost a farm of 1,000 drives that turn.

A viewer here reads the page's stream and draws nothing: a browser's own work is the viewer's machine's.
"""

from __future__ import annotations

import socket
import threading
import time
from typing import TYPE_CHECKING, Any

from pnfarm.bench.line import Child, cores, farm_and_plc, lateness, measure
from pnfarm.bench.loops import interpreter_loop
from pnfarm.bench.result import Result, Windows
from pnfarm.errors import InternalError

if TYPE_CHECKING:
    from pnfarm.bench.load import Load

__all__ = ["page_1000"]

DRIVES, CYCLE, WATCHDOG = 1000, "64ms", 30
VIEWERS = 8
API = ("127.0.0.1", 8719)
REQUEST = b"GET /api/v1/live HTTP/1.1\r\nHost: 127.0.0.1\r\nAccept: text/event-stream\r\n\r\n"
#: A page gets every drive first; a second each.
SETTLE_SECONDS = 4.0
#: A viewer that does not read fills the buffers of its connection in this time; it is closed some time later.
STALLED_SECONDS = 8.0
CONNECT_SECONDS = 10.0


class _Viewer:
    """One page: reads in a thread of its own, or does not read at all."""

    def __init__(self, *, reads: bool = True) -> None:
        self._socket = socket.create_connection(API, CONNECT_SECONDS)
        self._socket.settimeout(CONNECT_SECONDS)
        self._socket.sendall(REQUEST)
        self.octets = self.messages = 0
        self._closing = False
        self._thread: threading.Thread | None = None
        if reads:
            self._thread = threading.Thread(target=self._read, daemon=True)
            self._thread.start()

    def _read(self) -> None:
        try:
            while data := self._socket.recv(1 << 18):
                self.octets += len(data)
                self.messages += data.count(b"event: overview")
        except OSError:
            if not self._closing:
                raise

    def close(self) -> None:
        self._closing = True
        if self._thread is not None:
            self._socket.shutdown(socket.SHUT_RDWR)
            self._thread.join(CONNECT_SECONDS)
        self._socket.close()


def _memory(farm: Child) -> int:
    return int(farm.told("rss")["rss"])


def page_1000(seconds: float, load: Load) -> list[Result]:
    """What viewers of the web page cost a farm of 1,000 drives that turn."""
    viewers: list[_Viewer] = []
    loops: list[float] = []

    def close() -> None:
        while viewers:
            viewers.pop().close()

    with farm_and_plc(DRIVES, CYCLE, WATCHDOG, api=f"{API[0]}:{API[1]}") as (farm, plc):

        def watched(count: int) -> list[dict[str, Any]]:
            """With so many viewers, once they have all drives."""
            viewers.extend(_Viewer() for _ in range(count))
            time.sleep(SETTLE_SECONDS)
            loops.append(interpreter_loop())
            figures, _ = measure(farm, plc, seconds, load)
            loops.append(interpreter_loop())
            return figures

        try:
            # each beside a time without viewers before it and after it: what else a farm does changes as well
            quiet = [watched(0)]
            viewer = _Viewer()
            viewers.append(viewer)
            time.sleep(SETTLE_SECONDS)
            begin = time.monotonic(), viewer.messages, viewer.octets
            one = watched(0)
            took = time.monotonic() - begin[0]
            rate, flow = (viewer.messages - begin[1]) / took, (viewer.octets - begin[2]) / took
            if not rate:
                raise InternalError("the farm sent nothing to a page")
            # with one viewer the farm has what all of them share
            alone = _memory(farm)
            viewers.extend(_Viewer() for _ in range(VIEWERS - 1))
            time.sleep(SETTLE_SECONDS)
            each = (_memory(farm) - alone) / (VIEWERS - 1)
            close()
            quiet.append(watched(0))
            many = watched(VIEWERS)
            close()
            quiet.append(watched(0))
            before = _memory(farm)
            viewers.extend(_Viewer(reads=False) for _ in range(VIEWERS))
            time.sleep(STALLED_SECONDS)
            held = (_memory(farm) - before) / VIEWERS
        finally:
            close()
    loop = Windows(loops)
    before_and_after = cores(quiet[0] + quiet[1]).median, cores(quiet[1] + quiet[2]).median
    cost, all_cost = cores(one).less(before_and_after[0]), cores(many).less(before_and_after[1])
    late = lateness(many, 0.99)
    ratio = late.over(lateness(quiet[1] + quiet[2], 0.99))
    # a second of watching over the loop, both in CPU
    loop_seconds = loop.median / 1e3
    alone_ok = cost.median <= 0.05
    return [
        cost.row("page-1000-cpu", "cores for one viewer", cost.median / loop_seconds, "<= 0.05", alone_ok),
        all_cost.row(f"page-1000-cpu-{VIEWERS}", f"cores for {VIEWERS} viewers", all_cost.median / loop_seconds),
        Result("page-1000-memory", each / 1e3, "kB for each viewer", None, "<= 1000", each <= 1e6),
        Result("page-1000-stalled", held / 1e3, "kB for each that does not read", None, "<= 1000", held <= 1e6),
        late.row("page-1000-lateness", f"us, p99, with {VIEWERS} viewers", ratio, "ratio <= 1.2", ratio <= 1.2),
        Result("page-1000-rate", rate, "messages each second", None, ">= 8", rate >= 8),
        Result("page-1000-flow", flow / 1e3, "kB each second to one viewer", None, "none", True),
        loop.row("page-1000-interpreter", "ms for a fixed loop in Python", 1.0),
    ]
