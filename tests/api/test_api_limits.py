"""What clients may cost the farm: connections, time, memory.  On a real socket."""

from __future__ import annotations

import errno
import json
import resource
import socket
import time
from contextlib import asynccontextmanager, suppress
from itertools import repeat

import anyio
import httpx
import pytest
import structlog
from api_world import ApiWorld
from events import Something

from pnfarm.api import serve
from pnfarm.api.access import connections, streams, throttle
from pnfarm.api.access.connections import (
    BACKLOG,
    LEAST,
    MOST,
    RESERVED_FILES,
    ListeningSocket,
    connection_limit,
)  # fmt: skip
from pnfarm.api.access.guard import WHO
from pnfarm.farm.process.open_files import MOST_FILES, open_files, raise_file_limit


def posted(length: int) -> bytes:
    """The head of a request with a body of so many octets."""
    lines = ("POST /api/v1/faults HTTP/1.1", "Host: 127.0.0.1", "Content-Type: application/json")
    return "\r\n".join((*lines, f"Content-Length: {length}", "", "")).encode()


HALF = b"GET /api/v1/version HTTP/1.1\r\nHost: 127.0.0.1\r\n"


@asynccontextmanager
async def served(world):
    """(host, port) of a running server."""
    async with anyio.create_task_group() as group:

        async def run(*, task_status):
            await serve(world.app, "127.0.0.1", 0, task_status=task_status)

        yield await group.start(run)
        group.cancel_scope.cancel()


@pytest.fixture
def world():
    return ApiWorld(1, controller=False)


async def until(condition, seconds=20.0):
    """Wait for something that nobody tells of."""
    with anyio.fail_after(seconds):
        while not await condition():  # noqa: ASYNC110  # what is waited for is the server's, which has no event for it
            await anyio.sleep(0.01)


async def sent_until_closed(stream, pieces, pause=0.0) -> bool:
    """Send piece by piece; whether the server ended the connection before the last."""
    try:
        for piece in pieces:
            await stream.send(piece)
            await anyio.sleep(pause)
    except anyio.BrokenResourceError:
        return True
    return False


async def closed(stream, seconds=5.0) -> bool:
    """Whether the server ends this connection, whatever it says before."""
    with anyio.move_on_after(seconds):
        while True:
            try:
                await stream.receive()
            except (anyio.EndOfStream, anyio.BrokenResourceError):
                return True
    return False


def test_half_open_connections_beyond_the_limit_give_way_to_who_has_something_to_ask(world, monkeypatch):
    monkeypatch.setattr(connections, "MOST", 16)

    async def main():
        async with served(world) as (host, port):
            before = open_files()
            held = [await anyio.connect_tcp(host, port) for _ in range(100)]
            for stream in held:
                try:
                    await stream.send(HALF)
                except anyio.BrokenResourceError:
                    continue
            async with httpx.AsyncClient(base_url=f"http://{host}:{port}") as client:
                assert (await client.get("/api/v1/version")).status_code == 200
            # ours are a hundred, the server's no more than the limit
            assert open_files() - before <= 100 + 16 + 1
            assert await closed(held[0])
            for stream in held:
                await stream.aclose()

    anyio.run(main)


def test_a_head_that_comes_octet_by_octet_has_its_time_and_no_more(world, monkeypatch):
    monkeypatch.setitem(connections._SECONDS, connections._Phase.IDLE, 0.4)

    async def main():
        async with served(world) as address, await anyio.connect_tcp(*address) as stream:
            began = time.monotonic()
            assert await sent_until_closed(stream, (bytes([octet]) for octet in HALF * 100), 0.02)
            assert 0.3 < time.monotonic() - began < 20.0

    anyio.run(main)


def test_a_connection_that_says_nothing_is_closed(world, monkeypatch):
    monkeypatch.setitem(connections._SECONDS, connections._Phase.IDLE, 0.2)

    async def main():
        async with served(world) as address, await anyio.connect_tcp(*address) as stream:
            assert await closed(stream)

    anyio.run(main)


def test_a_body_that_never_ends_is_given_up(world, monkeypatch):
    monkeypatch.setitem(connections._SECONDS, connections._Phase.BODY, 0.3)

    async def main():
        async with served(world) as address, await anyio.connect_tcp(*address) as stream:
            await stream.send(posted(60) + b'{"kind": "f')
            assert await closed(stream)

    anyio.run(main)


@pytest.mark.parametrize(
    ("path", "kind", "status"),
    [("faults", "application/json", b"400"), ("faults", "text/plain", b"415"), ("drives", "text/plain", b"405")],
)
def test_a_body_that_is_no_http_ends_its_request_and_is_no_error_of_the_farm(world, caplog, path, kind, status):
    lines = (f"POST /api/v1/{path} HTTP/1.1", "Host: 127.0.0.1", f"Content-Type: {kind}", "Transfer-Encoding: chunked")
    head = "\r\n".join((*lines, "", "")).encode()

    async def run():
        async with served(world) as (host, port):
            for broken in (b"zz\r\n", b"5\r\nabcdefgh", b"1\r\n{\r\nzz\r\n"):
                async with await anyio.connect_tcp(host, port) as stream:
                    await stream.send(head)
                    # what needs no body is answered before it comes
                    answer = b"" if status == b"400" else await stream.receive()
                    await stream.send(broken)
                    with suppress(anyio.EndOfStream, anyio.BrokenResourceError):
                        while True:
                            answer += await stream.receive()
                    assert answer.split(b" ", 2)[1] == status
            async with httpx.AsyncClient(base_url=f"http://{host}:{port}") as client:
                assert (await client.get("/api/v1/drives")).status_code == 200

    with structlog.testing.capture_logs() as logged:
        anyio.run(run)
    assert [entry for entry in logged if entry["log_level"] in {"error", "critical"}] == []
    assert [record for record in caplog.records if record.levelname in {"ERROR", "CRITICAL"}] == []


def test_a_body_beyond_all_bounds_is_refused_while_it_comes_and_the_rest_is_not_kept(world, monkeypatch):
    monkeypatch.setitem(connections._SECONDS, connections._Phase.IDLE, 0.5)

    async def main():
        async with served(world) as address, await anyio.connect_tcp(*address) as stream:
            answer = bytearray()

            async def read():
                try:
                    while True:
                        answer.extend(await stream.receive())
                except (anyio.BrokenResourceError, anyio.EndOfStream):
                    pass

            with anyio.fail_after(20):
                async with anyio.create_task_group() as group:
                    group.start_soon(read)
                    await stream.send(posted(1 << 40))
                    assert await sent_until_closed(stream, repeat(bytes(65_536)))
            assert b"413" in answer.split(b"\r\n")[0]

    anyio.run(main)


def test_an_event_stream_whose_client_never_reads_is_closed(world, monkeypatch):
    monkeypatch.setattr(connections, "STALL_SECONDS", 0.3)

    async def main():
        async with served(world) as address:
            with socket.create_connection(address) as plain:
                plain.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
                plain.sendall(b"GET /api/v1/events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")

                async def opened():
                    return bool(world.context.streams)

                async def ended():
                    for number in range(200):
                        world.line.log.record(number, "axis-01", Something("try", {"text": "x" * 400}))
                    return not world.context.streams

                await until(opened)
                await until(ended)

    anyio.run(main)


def test_streams_beyond_the_most_are_told_so_and_an_end_makes_room(world, monkeypatch):
    monkeypatch.setattr(streams, "MOST_STREAMS", 3)

    async def main():
        async with served(world) as (host, port), httpx.AsyncClient(base_url=f"http://{host}:{port}") as client:

            async def opened():
                return await client.send(client.build_request("GET", "/api/v1/events"), stream=True)

            held = [await opened() for _ in range(3)]
            refused = await client.get("/api/v1/events")
            assert refused.status_code == 503
            assert refused.headers["retry-after"] == "1"
            assert "3 event streams are open" in refused.json()["detail"]
            assert (await client.get("/api/v1/version")).status_code == 200
            await held.pop().aclose()

            async def room():
                held.append(await opened())
                return held[-1].status_code == 200

            await until(room)
            for response in held:
                await response.aclose()

    anyio.run(main)


def test_a_token_that_has_all_streams_gives_up_its_newest_to_another_one_and_does_not_get_it_back(monkeypatch):
    monkeypatch.setattr(streams, "MOST_STREAMS", 3)
    world = ApiWorld(1, controller=False, token="a-long-secret", read_token="another-long-secret")

    async def main():
        async with served(world) as (host, port), httpx.AsyncClient(base_url=f"http://{host}:{port}") as client:

            async def opened(token, path="events"):
                headers = {"Authorization": f"Bearer {token}"}
                return await client.send(client.build_request("GET", f"/api/v1/{path}", headers=headers), stream=True)

            held = [await opened("another-long-secret") for _ in range(3)]
            mine = await opened("a-long-secret", "live")
            assert mine.status_code == 200
            # its end is one that a browser takes for an end
            with anyio.fail_after(10):
                assert (await held[2].aread()).startswith(b"retry")
            again = await opened("another-long-secret")
            assert again.status_code == 503
            assert "3 event streams are open" in json.loads(await again.aread())["detail"]
            assert len(world.context.streams) == 3
            for response in (*held, mine):
                await response.aclose()

    anyio.run(main)


def test_clients_with_one_token_share_its_streams_by_address(monkeypatch):
    monkeypatch.setattr(streams, "MOST_STREAMS", 6)

    async def main():
        begun, ended = [], []

        async def app(scope, _receive, send):
            try:
                await send({"type": "http.response.start", "status": 200, "headers": []})
                begun.append(scope["client"])
                await anyio.sleep_forever()
            finally:
                ended.append(scope["client"])

        async def send(message):
            assert message["type"].startswith("http.response")

        layer = streams.Streams(app)
        async with anyio.create_task_group() as group:

            async def come(who, address):
                scope = {"type": "http", "path": "/api/v1/live", "client": (address, 1), WHO: who}
                group.start_soon(layer, scope, None, send)
                before = len(begun)
                await anyio.wait_all_tasks_blocked()
                return len(begun) > before

            assert [await come("reads", "flood") for _ in range(6)] == [True] * 6
            assert [await come("reads", "page") for _ in range(4)] == [True, True, True, False]
            assert ended == [("flood", 1)] * 3
            # each of two tokens has half of them, whatever addresses their clients have
            assert [await come("other", f"host {n}") for n in range(4)] == [True, True, True, False]
            assert len(ended) == 6
            assert [await come("reads", name) for name in ("third", "fourth")] == [True, False]
            group.cancel_scope.cancel()

    anyio.run(main)


def test_more_requests_than_are_answered_at_once_are_told_to_come_again(world, monkeypatch):
    monkeypatch.setattr(throttle, "MOST_REQUESTS", 2)

    async def main():
        async with served(world) as (host, port), httpx.AsyncClient(base_url=f"http://{host}:{port}") as client:
            answers = []

            async def answered(status):
                answers.append(await client.get("/api/v1/version"))
                return answers[-1].status_code == status

            held = [await anyio.connect_tcp(host, port) for _ in range(2)]
            for stream in held:
                await stream.send(posted(60))
            await until(lambda: answered(503))
            assert answers[-1].headers["content-type"] == "application/problem+json"
            for stream in held:
                await stream.aclose()
            await until(lambda: answered(200))

    anyio.run(main)


def test_an_answer_of_megabytes_leaves_in_pieces_and_whole(world):
    async def main():
        sent = []

        async def app(_scope, _receive, send):
            await send({"type": "http.response.start", "status": 200, "headers": []})
            await send({"type": "http.response.body", "body": bytes(range(256)) * 1000})

        async def send(message):
            sent.append(message)

        scope = {"type": "http", "path": "/metrics"}
        await throttle.Throttle(app)(scope, None, send)
        bodies = [message for message in sent if message["type"] == "http.response.body"]
        assert b"".join(message["body"] for message in bodies) == bytes(range(256)) * 1000
        assert max(len(message["body"]) for message in bodies) == throttle.PIECE
        assert [message["more_body"] for message in bodies] == [True] * (len(bodies) - 1) + [False]

    anyio.run(main)

    async def wire():
        async with served(world) as (host, port), httpx.AsyncClient(base_url=f"http://{host}:{port}") as client:
            found = await client.get("/openapi.json")
            assert int(found.headers["content-length"]) == len(found.content)
            json.loads(found.content)

    anyio.run(wire)


def test_many_streams_cost_one_rendering_of_each_event(world, monkeypatch):
    rendered = []
    dumps = json.dumps
    monkeypatch.setattr("pnfarm.api.events.json.dumps", lambda *a, **k: rendered.append(a) or dumps(*a, **k))

    async def main():
        async with served(world) as (host, port):
            limits = httpx.Limits(max_connections=None)
            async with httpx.AsyncClient(base_url=f"http://{host}:{port}", limits=limits, timeout=10) as client:
                held = [
                    await client.send(client.build_request("GET", "/api/v1/events"), stream=True) for _ in range(20)
                ]
                lines = [response.aiter_lines() for response in held]
                for stream in lines:
                    assert (await anext(stream)).startswith("retry")
                rendered.clear()
                entry = world.line.log.record(1, "axis-01", Something("try"))
                for stream in lines:
                    found = ""
                    while not found.startswith("id:"):
                        found = await anext(stream)
                    assert found == f"id: {world.context.instance}-{entry.sequence}"
                assert len(rendered) == 1
                for response in held:
                    await response.aclose()

    anyio.run(main)


# --- files --------------------------------------------------------------------------------------------------------


@pytest.fixture
def limits():
    """Sets this process's limit of open files, and puts it back."""
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    yield lambda soft: resource.setrlimit(resource.RLIMIT_NOFILE, (soft, before[1]))
    resource.setrlimit(resource.RLIMIT_NOFILE, before)


def test_files_are_set_aside_for_the_farm_itself(limits):
    limits(1024)
    used = open_files()
    assert connection_limit() == min(MOST, 1024 - used - RESERVED_FILES - BACKLOG)
    limits(used + RESERVED_FILES + BACKLOG + 10)
    assert connection_limit() in {9, 10, 11}
    limits(used + 20)
    assert connection_limit() == LEAST


def test_a_farm_takes_as_many_files_as_it_may_have(limits):
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    limits(256)
    most = MOST_FILES if hard == resource.RLIM_INFINITY else min(hard, MOST_FILES)
    assert raise_file_limit() == most
    assert resource.getrlimit(resource.RLIMIT_NOFILE) == (most, hard)


def test_a_listening_socket_without_files_is_not_asked_again_at_once(monkeypatch):
    asked = []

    def accept(self):
        asked.append(self)
        raise OSError(errno.EMFILE, "too many open files")

    monkeypatch.setattr(socket.socket, "accept", accept)
    with ListeningSocket() as one:
        with pytest.raises(OSError, match="too many open files"):
            one.accept()
        for _ in range(32):
            with pytest.raises(BlockingIOError):
                one.accept()
    assert len(asked) == 1
