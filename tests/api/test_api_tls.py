"""The API by TLS, on a real socket: who is served, who is not, and what strangers at the port cost."""

import asyncio
import errno
import os
import socket
import ssl
import threading
import time
import tracemalloc
from contextlib import asynccontextmanager
from datetime import timedelta
from functools import partial

import anyio
import anyio.lowlevel
import httpx
import pytest
import structlog
from api_world import ApiWorld
from events import Something

from pnfarm.api import serve
from pnfarm.api.access import authority, connections, tls, watched_files
from pnfarm.api.access.authority import make_certificate
from pnfarm.api.access.guard import COOKIE
from pnfarm.api.access.tls import ServerTls
from pnfarm.api.access.token_file import TokenFile, add_token, remove_tokens
from pnfarm.errors import ConfigError, EnvironmentError_
from pnfarm.farm.process.open_files import open_files
from pnfarm.hub import Hub
from pnfarm.hub.settings import url_of
from pnfarm.library import Farm
from pnfarm.terminal.client import FarmClient
from pnfarm.testing import Rig
from pnfarm.vocabulary.trust import client_context
from pnfarm.web.roles import Role
from tests.strangers.attacks import ATTACKS, Target, tokens_of

TOKEN = "a-long-secret"  # a test's, nobody's


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return make_certificate(tmp_path_factory.mktemp("tls"), ["farm.test"], 30)


@pytest.fixture
def world():
    return ApiWorld(1, controller=False)


@asynccontextmanager
async def served(world, made):
    """The port of a running server."""
    async with anyio.create_task_group() as group:

        async def run(*, task_status):
            found = ServerTls(made.certificate, made.key)
            await serve(world.app, "127.0.0.1", 0, tls=found, task_status=task_status)

        _, port = await group.start(run)
        yield port
        group.cancel_scope.cancel()


def asked(address, *, tls_ca=None, token=None):
    """The versions, as the command line asks for them."""
    with FarmClient(address, token, tls_ca) as farm:
        return farm.get("version")


async def answer(*arguments, **options):
    return await anyio.to_thread.run_sync(partial(asked, *arguments, **options))


def test_a_client_that_has_the_authority_is_answered_by_tls(world, made, monkeypatch):
    async def main():
        async with served(world, made) as port:
            assert (await answer(f"https://127.0.0.1:{port}", tls_ca=made.authority))["api"] == "v1"
            assert (await answer(f"localhost:{port}", tls_ca=made.authority))["api"] == "v1"
            monkeypatch.setenv("PNFARM_TLS_CA", str(made.authority))
            assert (await answer(f"https://localhost:{port}"))["api"] == "v1"
            monkeypatch.setenv("PNFARM_TLS_CA", str(made.key))
            with pytest.raises(ConfigError, match=r"server\.key \(PNFARM_TLS_CA\) cannot be used: it holds no cert"):
                await answer(f"https://localhost:{port}")

    anyio.run(main)


def test_the_library_takes_an_authority_as_the_commands_do(world, made):
    async def main():
        async with (
            served(world, made) as port,
            Farm.connect(f"https://localhost:{port}", tls_ca=made.authority) as farm,
        ):
            assert [drive.name for drive in farm.drives] == ["axis-01"]
        with pytest.raises(ConfigError, match="nowhere cannot be used"):
            Farm.connect(f"https://localhost:{port}", tls_ca="nowhere")
        with pytest.raises(ConfigError, match="nowhere cannot be used"):
            Rig(f"https://localhost:{port}", tls_ca="nowhere")

    anyio.run(main)


def test_a_client_without_the_authority_says_why_it_asks_nothing(world, made, tmp_path):
    other = make_certificate(tmp_path, [], 30)

    async def main():
        async with served(world, made) as port:
            for ca in (None, other.authority):
                with pytest.raises(ConfigError, match=r"unknown authority .*--tls-ca"):
                    await answer(f"https://localhost:{port}", tls_ca=ca)
            with pytest.raises(ConfigError, match="nowhere cannot be used: no such file"):
                await answer(f"https://localhost:{port}", tls_ca="nowhere")
            with pytest.raises(EnvironmentError_, match="if it speaks TLS, give its https:// address"):
                await answer(f"http://localhost:{port}")

    anyio.run(main)


def test_a_certificate_for_another_name_is_not_taken(world, tmp_path, monkeypatch):
    monkeypatch.setattr(authority, "LOOPBACK", ())
    elsewhere = make_certificate(tmp_path, ["farm.test"], 30)

    async def main():
        async with served(world, elsewhere) as port:
            with pytest.raises(ConfigError, match="certificate is for another name"):
                await answer(f"https://localhost:{port}", tls_ca=elsewhere.authority)
            with pytest.raises(ConfigError, match="certificate is for another address"):
                await answer(f"https://127.0.0.1:{port}", tls_ca=elsewhere.authority)

    anyio.run(main)


def test_a_client_that_speaks_tls_to_a_farm_without_it_says_so(world, made):
    async def main():
        async with anyio.create_task_group() as group:
            _, port = await group.start(partial(serve, world.app, "127.0.0.1", 0))
            with pytest.raises(ConfigError, match="does not speak TLS: give its address as http://"):
                await answer(f"https://127.0.0.1:{port}", tls_ca=made.authority)
            group.cancel_scope.cancel()

    anyio.run(main)


def test_the_pages_cookie_is_for_tls_only_and_its_origin_must_be_as_well(made):
    world = ApiWorld(1, controller=False, token=TOKEN)

    async def main():
        async with (
            served(world, made) as port,
            httpx.AsyncClient(
                base_url=f"https://localhost:{port}", verify=client_context(made.authority), trust_env=False
            ) as client,
        ):
            cookie = (await client.post("/", data={"token": TOKEN})).headers["set-cookie"]
            assert cookie.startswith(f"{COOKIE}={TOKEN};")
            assert {"Secure", "HttpOnly", "SameSite=strict"} <= {part.strip() for part in cookie.split(";")}
            for scheme, status in (("https", 200), ("http", 403)):
                headers = {"Origin": f"{scheme}://localhost:{port}", "Authorization": f"Bearer {TOKEN}"}
                assert (await client.post("/api/v1/reset", headers=headers)).status_code == status

    anyio.run(main)


def test_a_hub_asks_its_shards_by_tls_and_a_discovered_one_by_its_name(world, made, tmp_path, monkeypatch):
    monkeypatch.setattr(authority, "LOOPBACK", ())
    named = make_certificate(tmp_path, ["tasks.farm"], 30)

    async def state(url, ca, name=None):
        hub = Hub(ca=ca)
        shard = hub.shards.give(url)
        if name is not None:
            hub.server_names[url] = name
        try:
            await hub.probe(shard)
            return "up" if shard in hub.shards.reachable else shard.reason
        finally:
            await hub.aclose()

    async def main():
        async with served(world, made) as port:
            assert await state(url_of(f"127.0.0.1:{port}", secure=True), made.authority) == "up"
            assert "unknown authority" in await state(f"https://127.0.0.1:{port}", None)
        async with served(world, named) as port:
            url = f"https://127.0.0.1:{port}"
            assert "another address" in await state(url, named.authority)
            assert await state(url, named.authority, "tasks.farm") == "up"

    anyio.run(main)


# -- files


def test_a_renewed_certificate_serves_the_next_connection_and_a_wrong_one_none(world, made, tmp_path):
    def served_until(port):
        context = client_context(made.authority)
        with (
            socket.create_connection(("127.0.0.1", port), 10) as sock,
            context.wrap_socket(sock, server_hostname="localhost") as secured,
        ):
            return secured.getpeercert()["notAfter"]

    for name in ("ca.pem", "ca.key"):
        (tmp_path / name).write_bytes((made.authority.parent / name).read_bytes())
    first = make_certificate(tmp_path, [], 30)

    async def main():
        async with served(world, first) as port:
            looked = partial(anyio.to_thread.run_sync, served_until, port)
            old = await looked()
            make_certificate(tmp_path, [], 60)
            new = await looked()
            assert new != old
            good = first.certificate.read_bytes()
            # half of it is there, as while it is copied; then the file is gone
            first.certificate.write_bytes(good[:-100])
            assert await looked() == new
            first.certificate.unlink()
            assert await looked() == new
            first.certificate.write_bytes(good)
            assert await looked() == new

    anyio.run(main)


def test_a_renewed_certificate_that_could_not_be_read_for_a_moment_serves_later(tmp_path, monkeypatch):
    """As where the machine has no file descriptor left."""

    def refuses(path, most):
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    first = make_certificate(tmp_path, [], 30)
    found = ServerTls(first.certificate, first.key)
    old, ends = anyio.run(found.context), found.ends
    make_certificate(tmp_path, [], 60)
    monkeypatch.setattr(watched_files, "AGAIN_SECONDS", 0.0)

    async def main():
        with monkeypatch.context() as patch:
            patch.setattr(tls, "read_regular", refuses)
            assert [await found.context() for _ in range(3)] == [old] * 3
        assert await found.context() is not old

    with structlog.testing.capture_logs() as logs:
        anyio.run(main)
    assert found.ends > ends
    assert [entry["event"] for entry in logs].count("certificate not renewed") == 1


def test_a_disk_that_does_not_answer_leaves_the_certificate_as_it_was(tmp_path, monkeypatch):
    first = make_certificate(tmp_path, [], 30)
    found = ServerTls(first.certificate, first.key)
    old = anyio.run(found.context)
    make_certificate(tmp_path, [], 60)
    answers = threading.Event()
    read = tls.read_regular

    def waits(path, most):
        answers.wait()
        return read(path, most)

    monkeypatch.setattr(tls, "read_regular", waits)
    monkeypatch.setattr(watched_files, "WAIT_SECONDS", 0.1)

    async def main():
        assert [await found.context() for _ in range(3)] == [old] * 3
        answers.set()
        while await found.context() is old:
            await anyio.lowlevel.checkpoint()

    try:
        with structlog.testing.capture_logs() as logs:
            anyio.run(main)
    finally:
        answers.set()
    assert [entry.get("reason") for entry in logs].count("the disk has not answered for 0.1 s") == 1


def test_files_that_cannot_serve_are_refused_with_a_sentence(made, tmp_path, monkeypatch):
    other = make_certificate(tmp_path / "other", [], 30)
    locked, torn = tmp_path / "locked.key", tmp_path / "torn.pem"
    locked.write_text("-----BEGIN ENCRYPTED PRIVATE KEY-----\n")
    torn.write_bytes(made.certificate.read_bytes()[:-100])
    monkeypatch.setattr(authority, "_SLACK", timedelta(days=9))
    late = make_certificate(tmp_path / "late", [], -1)
    for certificate, key, sentence in (
        (tmp_path / "nowhere", made.key, "the certificate .*nowhere cannot be read: no such file"),
        (tmp_path, made.key, "cannot be read: it is a folder"),
        (made.key, made.key, r"server\.key holds no certificate in PEM"),
        (made.certificate, made.certificate, r"server\.pem holds no key in PEM"),
        (made.certificate, None, r"server\.pem holds no key in PEM"),
        (made.certificate, other.key, "does not belong to the certificate"),
        (made.certificate, locked, "has a passphrase"),
        (torn, made.key, "are no certificate and its key"),
        (late.certificate, late.key, "cannot serve: certificate has expired"),
    ):
        with pytest.raises(ConfigError, match=sentence) as caught:
            ServerTls(certificate, key)
        assert "\n" not in str(caught.value)


def test_one_file_may_hold_certificate_and_key(made, tmp_path):
    both = tmp_path / "both.pem"
    both.write_bytes(made.key.read_bytes() + made.certificate.read_bytes())
    assert "farm.test" in ServerTls(both).names


# -- strangers at the port


def test_half_open_handshakes_beyond_the_limit_give_way_to_who_has_something_to_ask(world, made, monkeypatch):
    monkeypatch.setattr(connections, "MOST", 16)

    async def main():
        async with served(world, made) as port:
            before = open_files()
            held = [await anyio.connect_tcp("127.0.0.1", port) for _ in range(100)]
            for stream in held[::2]:
                try:
                    # the head of a ClientHello that does not go on
                    await stream.send(bytes.fromhex("160301020001"))
                except anyio.BrokenResourceError:
                    continue
            assert (await answer(f"https://localhost:{port}", tls_ca=made.authority))["api"] == "v1"
            assert open_files() - before <= 100 + 16 + 1
            for stream in held:
                await stream.aclose()

    anyio.run(main)


def test_a_handshake_has_its_time_and_holds_up_nobody_nor_the_end_of_the_farm(world, made, monkeypatch):
    monkeypatch.setattr(tls, "HANDSHAKE_SECONDS", 0.4)

    async def main():
        async with served(world, made) as port:
            async with await anyio.connect_tcp("127.0.0.1", port) as stream:
                await stream.send(bytes.fromhex("160301020001"))
                assert (await answer(f"https://localhost:{port}", tls_ca=made.authority))["api"] == "v1"
                with anyio.fail_after(10), pytest.raises(anyio.EndOfStream):
                    # nothing is said before
                    await stream.receive()
            monkeypatch.setattr(tls, "HANDSHAKE_SECONDS", 1000.0)
            held = await anyio.connect_tcp("127.0.0.1", port)
            await anyio.lowlevel.checkpoint()
        await held.aclose()

    anyio.run(main)


@pytest.mark.parametrize(
    "octets",
    [
        b"GET /api/v1/drives HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"\x00" * 4096,
        b"\x16\x03\x01\xff\xff" + b"\x01" * 70_000,
        b"\x80\x2e\x01\x00\x02",
    ],
)
def test_what_is_no_handshake_ends_its_own_connection_and_nothing_else(world, made, octets):
    async def main():
        async with served(world, made) as port:
            async with await anyio.connect_tcp("127.0.0.1", port) as stream:
                try:
                    await stream.send(octets)
                    await stream.send_eof()
                    with anyio.fail_after(10):
                        while True:
                            assert b"drives" not in await stream.receive()
                except (anyio.EndOfStream, anyio.BrokenResourceError):
                    pass
            assert (await answer(f"https://localhost:{port}", tls_ca=made.authority))["api"] == "v1"

    anyio.run(main)


def test_who_does_not_say_goodbye_gives_way_as_well(world, made, monkeypatch):
    monkeypatch.setattr(connections, "MOST", 8)
    monkeypatch.setattr(tls, "SHUTDOWN_SECONDS", 1000.0)

    async def main():
        async with served(world, made) as port:
            context = client_context(made.authority)
            held = []
            for _ in range(12):
                # a client of its own, which neither reads nor closes once it has asked
                there, back = ssl.MemoryBIO(), ssl.MemoryBIO()
                client = context.wrap_bio(there, back, server_hostname="localhost")
                stream = await anyio.connect_tcp("127.0.0.1", port)
                held.append(stream)
                while True:
                    try:
                        client.do_handshake()
                        break
                    except ssl.SSLWantReadError:
                        await stream.send(back.read())
                        there.write(await stream.receive())
                client.write(b"GET /api/v1/version HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
                await stream.send(back.read())
                assert await stream.receive()
            assert (await answer(f"https://localhost:{port}", tls_ca=made.authority))["api"] == "v1"
            for stream in held:
                await stream.aclose()

    anyio.run(main)


def test_handshakes_begin_one_after_the_other_and_one_that_was_given_up_takes_no_turn(world, made, monkeypatch):
    monkeypatch.setattr(tls, "PER_SECOND", 10.0)
    monkeypatch.setattr(tls, "AT_ONCE", 1)

    async def main():
        async with served(world, made) as port:
            began = time.monotonic()
            async with anyio.create_task_group() as group:
                for _ in range(6):
                    group.start_soon(partial(answer, f"https://localhost:{port}", tls_ca=made.authority))
            assert time.monotonic() - began > 0.4
            monkeypatch.setattr(tls, "PER_SECOND", 0.02)
            # the first of them takes its turn, of 50 s, and the farm ends before that
            held = [await anyio.connect_tcp("127.0.0.1", port) for _ in range(3)]
            for stream in held:
                await stream.aclose()

    anyio.run(main)


def test_a_client_that_does_not_read_by_tls_is_closed_as_any_other(world, made, monkeypatch):
    monkeypatch.setattr(connections, "STALL_SECONDS", 0.3)
    context = client_context(made.authority)

    def opened(port):
        plain = socket.create_connection(("127.0.0.1", port))
        plain.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        secured = context.wrap_socket(plain, server_hostname="localhost")
        secured.sendall(b"GET /api/v1/events HTTP/1.1\r\nHost: localhost\r\n\r\n")
        return secured

    async def main():
        async with served(world, made) as port:
            with await anyio.to_thread.run_sync(opened, port), anyio.fail_after(60):
                while not world.context.streams:
                    await anyio.lowlevel.checkpoint()
                while world.context.streams:
                    for number in range(200):
                        world.line.log.record(number, "axis-01", Something("try", {"text": "x" * 400}))
                    # the client does not read: the kernel's buffers fill, and the server's limit is on the wall clock
                    await anyio.sleep(0.01)

    anyio.run(main)


def test_a_stream_by_tls_ends_when_its_token_is_removed_and_the_log_has_no_error(made, tmp_path, caplog):
    secret = add_token(tmp_path / "tokens", "wall", Role.READ, None)
    world = ApiWorld(1, controller=False, tokens=TokenFile(tmp_path / "tokens"))

    async def main():
        async with (
            served(world, made) as port,
            httpx.AsyncClient(
                base_url=f"https://localhost:{port}", verify=client_context(made.authority), trust_env=False
            ) as client,
            client.stream("GET", "/api/v1/events", headers={"Authorization": f"Bearer {secret}"}) as response,
        ):
            assert response.status_code == 200
            pieces = response.aiter_bytes()
            assert b"retry" in await anext(pieces)
            remove_tokens(tmp_path / "tokens", ["wall"])
            world.line.log.record(0, "axis-01", Something("after its end"))
            rest = b""
            with anyio.fail_after(60):
                async for piece in pieces:
                    rest += piece
            assert b"after its end" not in rest

    with structlog.testing.capture_logs() as logs:
        anyio.run(main)
    assert not [entry for entry in logs if entry["log_level"] == "error"]
    assert not [record for record in caplog.records if record.levelname in {"WARNING", "ERROR"}]


#: Attacks that take no longer than their requests.
QUICK = sorted(set(ATTACKS) - {"slow requests", "half-open connections", "streams that nobody reads"})


def test_strangers_get_what_is_theirs_change_nothing_and_the_log_has_no_error(made, tmp_path, caplog):
    secrets = tokens_of(tmp_path / "tokens")
    world = ApiWorld(1, controller=False, tokens=TokenFile(tmp_path / "tokens"))
    found = {}

    async def main():
        async with served(world, made) as port:
            target = Target("farm", port, client_context(made.authority), secrets)
            for name in QUICK:
                found[name] = await ATTACKS[name].go(target)

    with structlog.testing.capture_logs() as logged:
        anyio.run(main)
    assert {name: wrong for name in QUICK if (wrong := set(found[name]) - ATTACKS[name].may)} == {}
    headers = {"Authorization": f"Bearer {secrets['wall']}"}
    assert world.get("/api/v1/faults", headers=headers).json()["faults"] == []
    assert world.line.farm.axes[0].station.powered
    assert [entry for entry in logged if entry["log_level"] in {"error", "critical"}] == []
    assert [record for record in caplog.records if record.levelname in {"ERROR", "CRITICAL"}] == []


@pytest.mark.asyncio
async def test_a_connection_holds_no_more_memory_than_its_records_take(world, made):
    trust = client_context(made.authority)
    async with served(world, made) as port:

        async def connect():
            reader, writer = await asyncio.open_connection("127.0.0.1", port, ssl=trust)
            writer.write(b"GET /api/v1/readyz HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
            await reader.readuntil(b"\r\n")
            return writer

        first = await connect()
        tracemalloc.start()
        try:
            # both ends are in this process
            writers = [await connect() for _ in range(20)]
            held = tracemalloc.get_traced_memory()[0] / len(writers)
        finally:
            tracemalloc.stop()
        for writer in (first, *writers):
            writer.close()
    assert held < 200_000
