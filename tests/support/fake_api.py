"""An API for the command line's tests: it answers what a test wants, and keeps what it was asked."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

__all__ = ["RECORD", "FakeFarm", "served"]

EMPTY = {"mean_seconds": None, "buckets": []}
RECORD = {
    "drive": "axis-01",
    "cycle_seconds": 0.016,
    "intervals": {"mean_seconds": 0.016, "buckets": [{"up_to_seconds": 0.016, "count": 60}]},
    "jitter": EMPTY,
    "missed_updates": 1200,
    "late_frames": {"controller": 1, "farm": 2},
    "last_late_frame": None,
    "watchdog_expirations": {"controller": 0, "farm": 3},
    "attempts": 7,
    "refused": 4,
    "connects": 2,
    "start_ups": [
        {
            "controller": "plc",
            "attempts": 5,
            "complete": True,
            "after_loss_seconds": 1.5,
            "phases": {"identify": 1.0, "connect": 0.5},
        }
    ],
    "faults": [
        {
            "code": "702",
            "kind": "timeout",
            "seconds_ago": 1.0,
            "reaction_seconds": 0.032,
            "acknowledged_seconds": None,
            "stw1": [{"bit": 0, "name": "on", "value": 0, "after_seconds": 0.032}],
        }
    ],
    "sign_of_life": None,
}


@dataclass
class FakeFarm:
    """Answers by (method, path): (status, body); keeps what it was asked."""

    url: str = ""
    answers: dict[tuple[str, str], tuple[int, object]] = field(default_factory=dict)
    asked: list[tuple[str, str, object, str | None]] = field(default_factory=list)

    def answer(self, method: str, path: str, body: object, status: int = 200) -> None:
        self.answers[method, f"/api/v1/{path}"] = (status, body)

    def inspected(self, body: dict, path: str = "drives/axis-01") -> None:
        """A drive, and what its controller did."""
        self.answer("GET", path, body)
        self.answer("GET", f"{path}/controller", RECORD)


@contextmanager
def served() -> Iterator[FakeFarm]:
    """One on a port of its own."""
    fake = FakeFarm()

    class Handler(BaseHTTPRequestHandler):
        def _reply(self) -> None:
            length = int(self.headers.get("Content-Length") or 0)
            body = json.loads(self.rfile.read(length)) if length else None
            fake.asked.append((self.command, self.path, body, self.headers.get("Authorization")))
            nothing = (404, {"detail": f"there is no {self.path}"})
            status, found = fake.answers.get((self.command, self.path), nothing)
            data = found.encode() if isinstance(found, str) else json.dumps(found).encode()
            self.send_response(status)
            self.send_header("Content-Length", str(len(data)))
            self.end_headers()
            self.wfile.write(data)

        do_GET = do_POST = do_PUT = do_DELETE = _reply  # noqa: N815 - the names are the library's

        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        fake.url = f"http://127.0.0.1:{server.server_address[1]}"
        yield fake
        server.shutdown()
        thread.join()
