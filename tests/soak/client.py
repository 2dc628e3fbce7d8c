"""A farm's API, by the standard library alone: requests on one connection, and a thread that reads the event stream."""

from __future__ import annotations

import http.client
import json
import threading
import time
from random import Random
from typing import Any

from tests.soak.judge import HubOrder, Stream
from tests.soak.losses import Losses

__all__ = ["Answer", "Api", "EventReader", "HubReader", "PageReader"]

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


class _Reader(threading.Thread):
    """Reads server-sent events from ``path``; hangs up now and then and resumes where it was.

    ``alone``: whether what answers is never started anew, so that a stream that breaks is wrong.
    """

    def __init__(self, name: str, port: int, path: str, seed: object, *, alone: bool) -> None:
        super().__init__(daemon=True, name=name)
        self._port, self._path, self._alone = port, path, alone
        self._rng = Random(f"{name}/{seed}")
        self._ended = threading.Event()
        self.last_id = ""
        self.resumed = self.messages = 0
        self.broken: list[str] = []

    def stop(self) -> None:
        """Ends at the next message, or comment."""
        self._ended.set()

    def message(self, kind: str, number: str, data: str) -> None:
        """One message: its type, its id, its data."""
        raise NotImplementedError

    def run(self) -> None:
        while not self._ended.is_set():
            try:
                self._read(time.monotonic() + self._rng.uniform(30, 300))
            except (OSError, http.client.HTTPException, ValueError) as exc:
                if self._ended.is_set():
                    return
                if self._alone and len(self.broken) < 50:
                    self.broken.append(f"the stream broke: {type(exc).__name__}: {exc}")
                self._ended.wait(1.0)
            self.resumed += 1

    def _read(self, until: float) -> None:
        connection = http.client.HTTPConnection("127.0.0.1", self._port, timeout=STREAM_SECONDS)
        try:
            # the header wins over `after`, which is for the first time, when there is nothing to resume
            headers = {"Last-Event-ID": self.last_id} if self.last_id else {}
            connection.request("GET", self._path, headers=headers)
            response = connection.getresponse()
            if response.status != 200:
                raise http.client.HTTPException(f"status {response.status}: {response.read(300)!r}")
            kind, number, data = "", "", ""
            while not self._ended.is_set() and time.monotonic() < until:
                line = response.readline()
                if not line:
                    raise http.client.HTTPException("the other end closed it")
                field, _, value = line.decode().rstrip("\n").partition(": ")
                if field == "event":
                    kind = value
                elif field == "id":
                    number = value
                elif field == "data":
                    data = value
                elif not field and data:
                    self.last_id = number or self.last_id
                    self.messages += 1
                    self.message(kind, number, data)
                    kind, number, data = "", "", ""
        finally:
            connection.close()


class EventReader(_Reader):
    """``GET events`` of a farm that is never started anew, from the oldest entry on."""

    def __init__(self, port: int, seed: object, lock: threading.Lock, stream: Stream, losses: Losses) -> None:
        super().__init__("events", port, "/api/v1/events?after=0", seed, alone=True)
        self._lock, self.stream, self._losses = lock, stream, losses

    def message(self, kind: str, number: str, data: str) -> None:
        with self._lock:
            self.stream.message(kind, number, data)
            if kind != "gap":
                self._losses.entry(json.loads(data))


class HubReader(_Reader):
    """``GET events`` of a hub that is started anew, as its shards are: no entry of a shard's run is missing or twice.

    Entries of drives whose name begins with ``drives`` are told to ``losses``.
    """

    def __init__(self, port: int, seed: object, lock: threading.Lock, losses: Losses, drives: str) -> None:
        super().__init__("hub events", port, "/api/v1/events?after=0", seed, alone=False)
        self._lock, self._losses, self._drives = lock, losses, drives
        self.order = HubOrder()

    def message(self, kind: str, number: str, data: str) -> None:
        with self._lock:
            self.order.message(kind, number, data)
            if kind != "gap" and str((entry := json.loads(data)).get("drive", "")).startswith(self._drives):
                self._losses.entry(entry)


class PageReader(_Reader):
    """A browser with the page open on a drive or a device, until it is stopped."""

    def __init__(self, port: int, number: int, query: str, *, alone: bool) -> None:
        super().__init__(f"page {number}", port, f"/api/v1/live?{query}", number, alone=alone)

    def message(self, kind: str, number: str, data: str) -> None:
        if kind not in {"comment", "error"}:
            json.loads(data)
