"""A farm's API, by the standard library alone: requests on one connection, and a thread that reads the event stream."""

from __future__ import annotations

import http.client
import json
import threading
import time
from random import Random
from typing import Any

from tests.soak.judge import Stream

__all__ = ["Answer", "Api", "EventReader"]

#: A machine that does other things may take the processor away for a while.
SECONDS = 120.0
#: A connection that was idle for longer is not used again: the farm closes it after 5 s.
IDLE_SECONDS = 2.0
#: A proxy would close a quiet stream; the farm sends a comment each 15 s.
STREAM_SECONDS = 60.0


class Answer:
    """Status and body of one request; status 0: there was none."""

    def __init__(self, status: int, text: str) -> None:
        self.status, self.text = status, text

    def json(self) -> Any:
        return json.loads(self.text)

    @property
    def done(self) -> bool:
        return 200 <= self.status < 300

    @property
    def refused(self) -> bool:
        return 400 <= self.status < 500


class Api:
    """One client; it connects again when its connection was closed."""

    def __init__(self, port: int) -> None:
        self._port = port
        self._connection: http.client.HTTPConnection | None = None
        self.failures: list[str] = []
        #: Requests without an answer in time: when they began and ended (wall clock), and what they were.
        self.timeouts: list[tuple[float, float, str]] = []
        self.requests = 0
        self._used = 0.0

    def __call__(self, method: str, path: str, body: Any = ..., *, starting: bool = False) -> Answer:
        """``body`` as JSON, None is ``null``; answers of 500 and above, and none at all, are noted.

        ``starting``: the farm may not listen yet, or answer that it is not ready.
        """
        data = None if body is ... else json.dumps(body)
        self.requests += 1
        if time.monotonic() - self._used > IDLE_SECONDS:
            self.close()
        began, timed_out = time.time(), False
        answer = Answer(0, "")
        for attempt in range(2):
            reused = self._connection is not None
            try:
                answer = self._once(method, path, data)
                break
            except TimeoutError as exc:
                self.close()
                answer, timed_out = Answer(0, f"TimeoutError: {exc}"), True
                break
            except (OSError, http.client.HTTPException) as exc:
                # a server closes a connection that was idle, in the very moment in which it is used again
                self.close()
                answer = Answer(0, f"{type(exc).__name__}: {exc}")
                if attempt or not reused:
                    break
        self._used = time.monotonic()
        if timed_out:
            self.timeouts.append((began, time.time(), f"{method} {path}"))
        elif (answer.status >= 500 or not answer.status) and not starting:
            self.failures.append(f"{method} {path} {(data or '')[:300]}: {answer.status} {answer.text[:300]}")
        return answer

    def _once(self, method: str, path: str, data: str | None) -> Answer:
        if self._connection is None:
            self._connection = http.client.HTTPConnection("127.0.0.1", self._port, timeout=SECONDS)
        headers = {"Content-Type": "application/json"} if data is not None else {}
        self._connection.request(method, path, data, headers)
        response = self._connection.getresponse()
        return Answer(response.status, response.read().decode())

    def close(self) -> None:
        if self._connection is not None:
            self._connection.close()
            self._connection = None


class EventReader(threading.Thread):
    """Reads ``GET events`` from the oldest entry on; hangs up now and then and resumes where it was."""

    def __init__(self, port: int, seed: object, lock: threading.Lock, stream: Stream) -> None:
        super().__init__(daemon=True, name="events")
        self._port, self._rng, self._lock = port, Random(f"events/{seed}"), lock
        self.stream = stream
        self._stop = threading.Event()

    def stop(self) -> None:
        """Ends at the next message, or comment."""
        self._stop.set()

    def run(self) -> None:
        first = True
        while not self._stop.is_set():
            if not first:
                self.stream.resumed += 1
            first = False
            try:
                self._read(time.monotonic() + self._rng.uniform(30, 300))
            except (OSError, http.client.HTTPException, ValueError) as exc:
                if self._stop.is_set():
                    return
                with self._lock:
                    if len(self.stream.wrong) < 50:
                        self.stream.wrong.append(f"the stream broke: {type(exc).__name__}: {exc}")
                self._stop.wait(1.0)

    def _read(self, until: float) -> None:
        connection = http.client.HTTPConnection("127.0.0.1", self._port, timeout=STREAM_SECONDS)
        try:
            # the header wins over `after`, which is for the first time, when there is nothing to resume
            headers = {"Last-Event-ID": str(self.stream.last)} if self.stream.last else {}
            connection.request("GET", "/api/v1/events?after=0", headers=headers)
            response = connection.getresponse()
            if response.status != 200:
                raise http.client.HTTPException(f"status {response.status}: {response.read(300)!r}")
            kind, number, data = "", "", ""
            while not self._stop.is_set() and time.monotonic() < until:
                line = response.readline()
                if not line:
                    raise http.client.HTTPException("the farm closed it")
                field, _, value = line.decode().rstrip("\n").partition(": ")
                if field == "event":
                    kind = value
                elif field == "id":
                    number = value
                elif field == "data":
                    data = value
                elif not field and data:
                    with self._lock:
                        self.stream.message(kind, number, data)
                    kind, number, data = "", "", ""
        finally:
            connection.close()
