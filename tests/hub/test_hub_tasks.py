"""The hub's tasks: names that are asked anew, and the command's own checks."""

import socket
from collections import Counter

import anyio
import httpx
import pytest
from hub_world import HubWorld

from pnfarm.cli.main import main
from pnfarm.hub import Hub, make_hub_app
from pnfarm.hub.shards import MOST_SHARDS
from pnfarm.hub.tasks import discover, run_hub


def answer(*hosts):
    async def ask(name, port, **_):
        return [
            (socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_STREAM, 6, "", (host, port))
            for host in hosts
        ]

    return ask


def failure(number):
    async def ask(name, port, **_):
        raise socket.gaierror(number, "told by a test")

    return ask


def test_every_address_of_a_name_is_a_shard_and_one_that_left_is_noted(monkeypatch):
    hub, found = Hub(), {}

    def ask(resolver):
        monkeypatch.setattr("pnfarm.hub.tasks.anyio.getaddrinfo", resolver)
        anyio.run(discover, hub, "tasks.farm", 8702, found)
        return {shard.url: shard.left_ns is None for shard in hub.shards}

    both = {"http://10.0.0.3:8702": True, "http://[fd00::4]:8702": True}
    assert ask(answer("10.0.0.3", "fd00::4", "10.0.0.3")) == both
    # a server of names that does not answer changes nothing, and is told
    assert ask(failure(socket.EAI_AGAIN)) == both
    assert hub.discovery == {"tasks.farm:8702": "told by a test"}
    assert ask(answer("fd00::4")) == {**both, "http://10.0.0.3:8702": False}
    assert hub.discovery == {"tasks.farm:8702": ""}
    # a name that has no address any more
    assert ask(failure(socket.EAI_NONAME)) == dict.fromkeys(both, False)
    assert ask(answer("10.0.0.3"))["http://10.0.0.3:8702"]


def test_a_name_with_very_many_addresses_is_bounded(monkeypatch):
    hub = Hub()
    many = answer(*(f"10.1.{n // 250}.{n % 250 + 1}" for n in range(MOST_SHARDS + 50)))
    monkeypatch.setattr("pnfarm.hub.tasks.anyio.getaddrinfo", many)
    anyio.run(discover, hub, "x", 1, {})
    assert len(hub.shards) == MOST_SHARDS


def test_two_names_do_not_take_each_others_shards(monkeypatch):
    hub, found = Hub(), {}
    monkeypatch.setattr("pnfarm.hub.tasks.anyio.getaddrinfo", answer("10.0.0.3"))
    anyio.run(discover, hub, "one", 1, found)
    monkeypatch.setattr("pnfarm.hub.tasks.anyio.getaddrinfo", answer("10.0.0.4"))
    anyio.run(discover, hub, "other", 1, found)
    assert [shard.left_ns for shard in hub.shards] == [None, None]


def test_at_the_start_the_shards_of_one_name_are_not_taken_for_gone_because_of_another_name(monkeypatch):
    asked, told = Counter(), []

    def nobody(request):
        asked[request.url.host] += 1
        if len(asked) == 2 and min(asked.values()) == 2:
            each_twice.set()
        raise httpx.ConnectError("refused", request=request)

    async def ask(name, port, **_):
        return await answer({"one": "10.0.0.3", "other": "10.0.0.4"}[name])(name, port)

    async def main():
        hub = Hub(transport=lambda _: httpx.MockTransport(nobody))
        async with anyio.create_task_group() as tasks:
            await tasks.start(run_hub, hub, [], [("one", 1), ("other", 1)], make_hub_app(hub).state.views)
            # before the start, and since
            await each_twice.wait()
            tasks.cancel_scope.cancel()

    monkeypatch.setattr("pnfarm.hub.tasks.anyio.getaddrinfo", ask)
    monkeypatch.setattr(Hub, "record", lambda _, event: told.append(event))
    each_twice = anyio.Event()
    anyio.run(main)
    assert told == []


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ([], "no shard is given"),
        (["--shard", "http://x/y"], "--shard 'http://x/y' is not the address of a farm"),
        (["--shard", "10.0.0.300"], "--shard '10.0.0.300' is not the address of a farm"),
        (["--shard", "http://[::1::]"], "is not the address of a farm"),
        (["--discover", "farm"], "--discover 'farm' is not a name with a port"),
        (["--shard", "x", "--api", "off"], "--api"),
        (["--shard", "x", "--api-token", "short"], "--api-token"),
    ],
)
def test_what_the_command_is_told_wrongly_is_one_sentence(capsys, arguments, sentence):
    assert main(["hub", *arguments]) == 2
    told = capsys.readouterr().err
    assert sentence in told
    assert told.count("\n") == 1


def test_a_token_in_a_file_that_is_not_there_is_told(capsys, monkeypatch):
    monkeypatch.setenv("PNFARM_HUB_SHARD_TOKEN_FILE", "/nowhere/token")
    assert main(["hub", "--shard", "x"]) == 2
    assert "/nowhere/token (PNFARM_HUB_SHARD_TOKEN_FILE) cannot be read" in capsys.readouterr().err


def test_an_empty_file_of_the_hubs_token_opens_no_hub(capsys, monkeypatch, tmp_path):
    (tmp_path / "token").write_text("\n")
    monkeypatch.setenv("PNFARM_HUB_API_TOKEN_FILE", str(tmp_path / "token"))
    assert main(["hub", "--shard", "x"]) == 2
    assert "token (PNFARM_HUB_API_TOKEN_FILE) is empty" in capsys.readouterr().err


def test_commands_print_what_is_missing_and_end_with_1(capsys, monkeypatch):
    world = HubWorld(("axis-{n:02}", 1), ("pump-{n:02}", 1))
    world.lose(2)

    class Client:
        def __init__(self, *_):
            pass

        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        def get(self, *path):
            return world.get("/".join(path)).json()

        def post(self, *path, body=None, query=None):
            return world.post("/".join(path), body, params=query).json()

    monkeypatch.setattr("pnfarm.terminal.client.FarmClient", Client)
    for arguments, shown, missing in (
        (["inspect"], "unreachable", "s2:8702"),
        (["fault", "add", "silence", "--on", "all", "--as", "a"], "a: silence active on axis-01", "not hit: pump-01"),
        (["fault", "list"], "silence", "their part is missing: s2:8702"),
        (["fault", "clear"], "cleared a", "s2:8702"),
        (["fault", "clear"], "no fault was active on the shards that answer", "s2:8702"),
        (["fault", "list"], "no fault is pending or active on the shards that answer", "s2:8702"),
    ):
        assert main(arguments) == 1
        told = capsys.readouterr()
        assert shown in told.out
        assert missing in told.err
