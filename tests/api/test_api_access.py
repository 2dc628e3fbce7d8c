"""Attempts to get in: without the token, with parts of it, through a browser on the farm's own machine."""

from __future__ import annotations

from contextlib import AsyncExitStack

import anyio
import httpx
import pytest
from api_world import BASE, ApiWorld, assert_problem

from pnfarm.api import serve
from pnfarm.api.access import login
from pnfarm.api.access.guard import MOST_STRANGERS
from pnfarm.api.access.throttle import MOST_REQUESTS

FULL, READS = "the-farms-own-token", "the-token-that-reads"  # a test's, nobody's
DRIVES = "/api/v1/drives"
FAULT = {"kind": "silence", "on": "axis-01"}


@pytest.fixture(scope="module")
def guarded() -> ApiWorld:
    return ApiWorld(1, controller=False, token=FULL, read_token=READS)


@pytest.fixture(scope="module")
def local() -> ApiWorld:
    return ApiWorld(1, controller=False)


@pytest.mark.parametrize(
    "headers",
    [
        {"Authorization": FULL},
        {"Authorization": f"Basic {FULL}"},
        {"Authorization": f"Token {FULL}"},
        {"Authorization": "Bearer"},
        {"Authorization": "Bearer "},
        {"Authorization": f"Bearer {FULL[:-1]}"},
        {"Authorization": f"Bearer {FULL}{FULL}"},
        {"Authorization": f"Bearer {FULL},{READS}"},
        {"Authorization": f"Bearer {FULL.upper()}"},
        {"Authorization": b"Bearer \xc3\xa9\xff\x80"},
        {"Authorization": f"Bearer {'x' * 100_000}"},
        {"Cookie": f"other={FULL}"},
        {"Cookie": f"pnfarm_token={FULL}x"},
        {"Cookie": b'pnfarm_token="\xff\xfe'},
        {"Cookie": f"pnfarm_token=; pnfarm_token ={READS}1"},
        {"X-Token": FULL},
    ],
)
def test_what_is_not_the_token_is_refused_and_never_an_error_of_the_farm(guarded, headers):
    assert_problem(guarded.get(DRIVES, headers=headers), 401, "token")
    assert_problem(guarded.post("/api/v1/faults", FAULT, headers=headers), 401, "token")
    assert guarded.faults.list() == []


def test_a_token_in_the_query_opens_the_page_only(guarded):
    assert_problem(guarded.get(f"{DRIVES}?token={FULL}"), 401, "token")
    assert_problem(guarded.post(f"/api/v1/reset?token={FULL}"), 401, "token")
    assert_problem(guarded.get(f"/metrics?token={FULL}"), 401, "token")
    assert guarded.get("/?token=%C3%A9%FF").status_code == 200, "the login page"
    assert guarded.get(f"/?token={FULL}").status_code == 303


def test_strangers_who_let_the_farm_wait_leave_room_for_who_has_a_token(guarded, monkeypatch):
    """A form whose body never comes, on as many connections as there are: more than some are told to come again."""
    # a busy machine needs longer than a browser to ask all this
    monkeypatch.setattr(login, "FORM_SECONDS", 60.0)

    async def never():
        await anyio.sleep_forever()
        yield b""

    async def main():
        transport = httpx.ASGITransport(guarded.app)
        async with httpx.AsyncClient(transport=transport, base_url=BASE) as client, anyio.create_task_group() as group:
            statuses, are_refused = [], anyio.Event()

            async def open_form():
                statuses.append((await client.post("/", content=never())).status_code)
                if len(statuses) == MOST_REQUESTS - MOST_STRANGERS:
                    are_refused.set()

            for _ in range(MOST_REQUESTS):
                group.start_soon(open_form)
            with anyio.fail_after(60):
                await are_refused.wait()
            assert set(statuses) == {503}
            full = {"Authorization": f"Bearer {FULL}"}
            assert (await client.get(DRIVES, headers=full)).status_code == 200
            assert (await client.get("/openapi.json", headers=full)).status_code == 200
            # who comes now has the place of one that let the farm wait
            assert (await client.get("/openapi.json")).status_code == 200
            assert (await client.get("/api/v1/healthz")).status_code == 200
            logged_in = await client.post("/", content=f"token={FULL}")
            assert logged_in.status_code == 303
            group.cancel_scope.cancel()

    anyio.run(main)
    assert guarded.get("/").status_code == 200


def test_strangers_who_do_not_read_what_they_ask_for_keep_nobody_out(guarded):
    """The API's description several times on each of as many connections as there are places, and nothing is read."""

    async def main():
        async with anyio.create_task_group() as group, AsyncExitStack() as streams:

            async def run(*, task_status):
                await serve(guarded.app, "127.0.0.1", 0, task_status=task_status)

            host, port = await group.start(run)
            async with httpx.AsyncClient(base_url=f"http://{host}:{port}", timeout=30) as client:
                octets = len((await client.get("/openapi.json")).content)
                wanted = 3_000_000 // octets
                for _ in range(MOST_STRANGERS):
                    stream = await streams.enter_async_context(await anyio.connect_tcp(host, port))
                    await stream.send(b"GET /openapi.json HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n" * wanted)
                # each of them has been answered once the server has read it
                for _ in range(3):
                    assert (await client.get("/api/v1/healthz")).status_code == 200
                    assert (await client.get("/")).status_code == 200
            group.cancel_scope.cancel()

    anyio.run(main)


def test_a_form_that_does_not_come_is_waited_for_no_longer_than_a_browser_takes(guarded, monkeypatch):
    monkeypatch.setattr(login, "FORM_SECONDS", 0.01)

    async def never():
        await anyio.sleep_forever()
        yield b""

    assert guarded.request("POST", "/", content=never()).status_code == 403


def test_cookies_of_other_programs_of_the_host_lock_no_browser_out(guarded):
    for other in ('prefs={"a":1}', "name=a b", b"name=\xfc", "=", ";"):
        cookie = (other if isinstance(other, bytes) else other.encode()) + f"; pnfarm_token={FULL}".encode()
        assert guarded.get(DRIVES, headers={"Cookie": cookie}).status_code == 200


def test_a_token_in_the_address_replaces_that_of_the_browser_and_does_not_stay_there(guarded):
    answer = guarded.get(f"/?token={FULL}", headers={"Cookie": f"pnfarm_token={READS}"})
    assert (answer.status_code, answer.headers["location"]) == (303, "/")
    assert f"pnfarm_token={FULL}" in answer.headers["set-cookie"]
    assert guarded.get("/?token=wrong", headers={"Cookie": f"pnfarm_token={READS}"}).status_code == 200


def test_of_many_authorizations_the_first_counts(guarded):
    many = [("Authorization", "Bearer wrong"), ("Authorization", f"Bearer {FULL}")]
    assert_problem(guarded.get(DRIVES, headers=many), 401, "token")


def test_every_method_but_reading_is_refused_to_the_token_that_reads(guarded):
    headers = {"Authorization": f"Bearer {READS}"}
    for method in ("POST", "PUT", "DELETE", "PATCH", "BREW"):
        assert guarded.request(method, DRIVES, headers=headers).status_code == 403, method
    assert guarded.request("HEAD", DRIVES, headers=headers).status_code in {200, 405}


@pytest.mark.parametrize(
    "host",
    [
        "evil.example",
        "evil.example:8702",
        "127.0.0.1.evil.example",
        "localhost.evil.example:8702",
        "localhost@evil.example",
        "evil.example@localhost",
        "localhost#.evil.example",
        "localhost/.evil.example",
        "[::1",
        "[::1].evil.example",
        "10.0.0.5:8702",
        "0.0.0.0:8702",
        "localhost:port",
        "",
        b"\xff\xfe",
    ],
)
def test_a_name_that_a_page_elsewhere_points_to_loopback_reaches_nothing(local, host):
    assert_problem(local.get(DRIVES, headers={"Host": host}), 403, "localhost only")
    assert_problem(local.post("/api/v1/faults", FAULT, headers={"Host": host}), 403)
    assert local.faults.list() == []


@pytest.mark.parametrize("host", ["localhost", "LOCALHOST:8702", "127.0.0.1:8702", "127.3.2.1", "[::1]:8702", "[::1]"])
def test_loopback_by_any_of_its_names_is_answered(local, host):
    assert local.get(DRIVES, headers={"Host": host}).status_code == 200


@pytest.mark.parametrize(
    "origin",
    [
        "https://evil.example",
        "null",
        "http://[",
        "http://127.0.0.1:9999",
        "http://localhost:8702",
        "",
        "file://",
        b"\xff",
    ],
)
def test_a_page_of_another_origin_changes_nothing(local, origin):
    assert_problem(local.post("/api/v1/faults", FAULT, headers={"Origin": origin}), 403, "may not change this farm")
    assert_problem(local.post("/api/v1/reset", headers={"Origin": origin}), 403)
    assert local.faults.list() == []
    # what it reads, the browser keeps from it: no header permits it
    answer = local.get(DRIVES, headers={"Origin": origin})
    assert "access-control-allow-origin" not in answer.headers


def test_the_farms_own_page_may(local):
    answer = local.post("/api/v1/reset", headers={"Origin": "http://127.0.0.1:8702"})
    assert answer.status_code == 200


def test_every_change_has_an_entry_that_says_who(guarded):
    headers = {"Authorization": f"Bearer {FULL}"}

    def entries() -> list[dict]:
        found = [entry.as_dict() for entry in guarded.line.log.entries()]
        return [entry for entry in found if entry["event"] == "changed by a client"]

    trace = guarded.post("/api/v1/traces", {"on": "all", "signals": ["velocity"]}, headers=headers).json()
    guarded.request("DELETE", f"/api/v1/traces/{trace['id']}", headers=headers)
    found = [(entry["who"], entry["peer"], entry["method"], entry["path"]) for entry in entries()]
    assert found == [
        ("token", "127.0.0.1", "POST", "/api/v1/traces"),
        ("token", "127.0.0.1", "DELETE", f"/api/v1/traces/{trace['id']}"),
    ]
    # what has an entry of its own has no second one; what changes nothing has none
    guarded.post("/api/v1/faults", {**FAULT, "ttl": "10s", "as": "held"}, headers=headers)
    guarded.post("/api/v1/faults?dry_run=true", FAULT, headers=headers)
    guarded.post("/api/v1/faults/held/renew", headers=headers)
    guarded.post("/api/v1/traces", {"on": "nobody"}, headers=headers)
    guarded.post("/api/v1/reset", headers=headers)
    assert entries()[2:] == []
