"""Tokens with roles: what each may do, when it ends, and that no route is without a role."""

import errno
import json
import os
import threading

import anyio
import pytest
from api_world import ApiWorld, assert_problem
from events import Something
from hub_world import HubWorld
from structlog.testing import capture_logs

from pnfarm.api.access import token_file, watched_files
from pnfarm.api.access.guard import COOKIE, OPEN_PATHS, SAFE_METHODS
from pnfarm.api.access.rights import role_of
from pnfarm.api.access.token_file import TokenFile, add_token, read_tokens, remove_tokens
from pnfarm.errors import ConfigError
from pnfarm.web.paths import ROLE_KEY, Paths
from pnfarm.web.roles import Role

DRIVES, FAULTS, STATES = "/api/v1/drives", "/api/v1/faults", "/api/v1/states/loaded"
FAULT = {"kind": "silence", "on": "axis-01"}
RESTORE = {"text": json.dumps({"scenario": "a", "steps": [{"restore": "loaded"}]})}


class Tokens:
    """A file of tokens, and a farm that takes them; ``secrets`` by name."""

    def __init__(self, folder, **roles):
        self.path = folder / "tokens"
        self.secrets = {name: add_token(self.path, name, role, None) for name, role in roles.items()}
        self.world = ApiWorld(1, controller=False, tokens=TokenFile(self.path))

    def ask(self, who, method, path, body=None, **headers):
        headers = {"Authorization": f"Bearer {self.secrets[who]}", **headers}
        return self.world.request(method, path, json=body, headers=headers)


@pytest.fixture
def tokens(tmp_path):
    return Tokens(tmp_path, wall=Role.READ, ci=Role.INJECT, boss=Role.ADMIN)


# -- what a role may


def test_each_role_may_what_those_before_it_may_and_is_told_which_one_it_lacks(tokens):
    for method, path, body, least, done in (
        ("GET", DRIVES, None, Role.READ, 200),
        ("POST", FAULTS, FAULT, Role.INJECT, 201),
        ("POST", "/api/v1/reset", None, Role.INJECT, 200),
        ("PUT", f"{DRIVES}/axis-01/params/DRV.OPMODE", {"value": 1}, Role.INJECT, 200),
        ("PUT", STATES, None, Role.ADMIN, 422),
        ("DELETE", STATES, None, Role.ADMIN, 422),
        ("POST", f"{STATES}/restore?check=true", None, Role.ADMIN, 422),
    ):
        for who, role in (("wall", Role.READ), ("ci", Role.INJECT), ("boss", Role.ADMIN)):
            answer = tokens.ask(who, method, path, body)
            if role.covers(least):
                assert answer.status_code == done, (who, method, path, answer.text)
            else:
                found = assert_problem(answer, 403, f"role {least}")
                assert (found["role"], found["needed_role"]) == (role, least)


def test_a_scenario_takes_no_more_than_who_starts_it_may(tokens):
    refused = assert_problem(tokens.ask("ci", "POST", "/api/v1/scenarios", RESTORE), 403, "may not `restore`", "admin")
    assert "line 1" in refused["detail"]
    # it may, and there is none
    assert_problem(tokens.ask("boss", "POST", "/api/v1/scenarios", RESTORE), 422, "no folder for states")


def test_a_path_that_does_not_exist_tells_a_token_that_reads_nothing_more(tokens):
    assert tokens.ask("wall", "GET", "/api/v1/none").status_code == 404
    for who, status in (("wall", 403), ("ci", 404)):
        assert tokens.ask(who, "POST", "/api/v1/none").status_code == status
    for who, status in (("wall", 403), ("ci", 405)):
        assert tokens.ask(who, "POST", DRIVES).status_code == status


def test_the_log_names_the_token(tokens):
    tokens.ask("ci", "POST", FAULTS, FAULT)
    found = [entry.as_dict() for entry in tokens.world.line.log.entries()]
    assert [entry["who"] for entry in found if entry["event"] == "fault requested"] == ["ci"]


def test_the_page_is_told_whether_its_token_may_change_something(tokens):
    for who, writes in (("wall", False), ("ci", True)):
        live = tokens.ask(who, "GET", "/api/v1/live?follow=false").text
        assert f'"writes":{json.dumps(writes)}' in live


def test_a_hub_holds_its_own_tokens_against_what_it_passes_on_and_what_it_does_itself(tmp_path):
    path = tmp_path / "tokens"
    secrets = {role: add_token(path, f"the-{role}", role, None) for role in Role}
    world = HubWorld(("axis-{n:02}", 1), tokens=TokenFile(path))
    for method, where, least in (
        ("GET", "drives", Role.READ),
        ("GET", "drives/axis-01", Role.READ),
        ("POST", "drives/axis-01/power-cycle", Role.INJECT),
        ("POST", "reset", Role.INJECT),
        ("DELETE", "states/loaded", Role.ADMIN),
    ):
        for role in Role:
            headers = {"Authorization": f"Bearer {secrets[role]}"}
            answer = world.request(method, where, headers=headers)
            assert (answer.status_code == 403) is not role.covers(least), (method, where, role, answer.text)
    assert_problem(world.get("drives"), 401)


# -- no route without a role


def farm_and_hub():
    return [
        ApiWorld(1, controller=False).app,
        HubWorld(("axis-{n:02}", 1)).app,
    ]


def test_every_route_has_a_role_and_none_that_changes_something_is_for_who_reads():
    for app in farm_and_hub():
        seen = 0
        for route in app.routes:
            methods = set(getattr(route, "methods", None) or ())
            if route.path not in OPEN_PATHS:
                assert ROLE_KEY in (route.openapi_extra or {}), route.path
            if not methods <= SAFE_METHODS:
                assert role_of(route) in {Role.INJECT, Role.ADMIN}, (methods, route.path)
                seen += 1
            if "/states/" in route.path and not methods <= SAFE_METHODS:
                assert role_of(route) is Role.ADMIN, route.path
        assert seen > 15


def test_a_route_that_names_no_role_is_for_admins_alone_and_one_that_changes_something_must_name_one(tokens):
    app = tokens.world.app

    async def handler():
        return {}

    with pytest.raises(ValueError, match="POST bare changes something and names no role"):
        Paths(app, "x")("POST bare", dict)(handler)
    app.add_api_route("/bare", handler, methods=["GET"])
    assert [tokens.ask(who, "GET", "/bare").status_code for who in ("wall", "ci", "boss")] == [403, 403, 200]


# -- when a token ends


def test_an_expired_token_is_refused_with_its_reason_and_so_is_the_pages_cookie(tmp_path):
    path, now = tmp_path / "tokens", 1_800_000_000.0
    secret = add_token(path, "ci", Role.INJECT, now)
    clock = [now]
    world = ApiWorld(1, controller=False, tokens=TokenFile(path), wall=lambda: clock[0])
    for headers in ({"Authorization": f"Bearer {secret}"}, {"Cookie": f"{COOKIE}={secret}"}):
        answer = world.get(DRIVES, headers=headers)
        assert_problem(answer, 401, "the token ci expired at 2027-01-15T08:00:00Z")
        assert answer.headers["www-authenticate"] == 'Bearer error="invalid_token"'
        assert_problem(world.post(FAULTS, FAULT, headers=headers), 401)
    page = world.get("/", headers={"Cookie": f"{COOKIE}={secret}"})
    assert "the token ci expired" in page.text
    assert "set-cookie" not in page.headers
    # the login of the page, once more
    login = world.request("POST", "/", data={"token": secret})
    assert (login.status_code, "set-cookie" in login.headers) == (403, False)
    assert world.get(f"/?token={secret}").status_code == 403
    clock[0] -= 1
    assert world.get(DRIVES, headers=headers).status_code == 200
    assert world.request("POST", "/", data={"token": secret}).headers["set-cookie"]


def test_a_token_that_is_removed_ends_at_once_and_with_it_the_login_of_a_page(tokens):
    cookie = {"Cookie": f"{COOKIE}={tokens.secrets['ci']}"}
    assert tokens.world.get(DRIVES, headers=cookie).status_code == 200
    remove_tokens(tokens.path, ["ci"])
    assert_problem(tokens.world.get(DRIVES, headers=cookie), 401, "needs its token")
    assert_problem(tokens.ask("ci", "GET", DRIVES), 401)
    assert tokens.ask("wall", "GET", DRIVES).status_code == 200
    tokens.secrets["new"] = add_token(tokens.path, "new", Role.READ, None)
    assert tokens.ask("new", "GET", DRIVES).status_code == 200


def test_an_open_stream_ends_with_its_token(tokens):
    """Without a socket: what the server is told to send."""
    sent = []
    authorization = f"Bearer {tokens.secrets['wall']}".encode()
    scope = {
        "type": "http",
        "method": "GET",
        "path": "/api/v1/events",
        "query_string": b"",
        "scheme": "http",
        "headers": [(b"authorization", authorization), (b"host", b"127.0.0.1")],
    }

    async def main():
        async def receive():
            await anyio.sleep_forever()

        async def send(message):
            sent.append(message)
            if message.get("body"):
                remove_tokens(tokens.path, ["wall"])
                tokens.world.line.log.record(0, "", Something("late"))

        with anyio.fail_after(60):
            await tokens.world.app(scope, receive, send)

    anyio.run(main)
    assert sent[0]["status"] == 200
    assert not sent[-1].get("more_body", False)
    assert b"late" not in b"".join(message.get("body", b"") for message in sent)


def test_a_changed_file_that_could_not_be_read_for_a_moment_is_read_again(tmp_path, monkeypatch):
    """As where the machine has no file descriptor left."""

    def refuses(path, most):
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    path = tmp_path / "tokens"
    add_token(path, "ci", Role.READ, None)
    file = TokenFile(path)
    add_token(path, "wall", Role.READ, None)

    async def holders():
        await file.follow()
        return [holder.name for holder in file.holders]

    async def main():
        monkeypatch.setattr(watched_files, "AGAIN_SECONDS", 0.0)
        with monkeypatch.context() as patch:
            patch.setattr(token_file, "read_regular", refuses)
            assert [await holders() for _ in range(3)] == [[], [], []]
        assert await holders() == ["ci", "wall"]

    with capture_logs() as shown:
        anyio.run(main)
    assert [entry["event"] for entry in shown].count("no token of the file is taken") == 1


def test_a_disk_that_does_not_answer_holds_up_neither_the_farm_nor_the_other_tokens(tmp_path, monkeypatch):
    """As a network disk whose server has gone: the file has changed, and reading it does not return."""
    path, own = tmp_path / "tokens", "the-farms-own-token"  # a test's, nobody's
    secret = add_token(path, "ci", Role.READ, None)
    answers = threading.Event()
    read = token_file.read_regular

    def waits(path, most):
        answers.wait()
        return read(path, most)

    monkeypatch.setattr(token_file, "read_regular", waits)
    answers.set()
    file = TokenFile(path)
    answers.clear()
    world = ApiWorld(1, controller=False, token=own, tokens=file)
    path.write_text(path.read_text() + "# changed\n")

    async def main():
        ticks = 0

        async def beat():
            nonlocal ticks
            while True:
                # a loop that is held up does not come back from this
                await anyio.sleep(0.01)
                ticks += 1

        async with anyio.create_task_group() as group, world.client() as client:
            group.start_soon(beat)

            async def status(token):
                return (await client.get(DRIVES, headers={"Authorization": f"Bearer {token}"})).status_code

            assert (await status(own), await status(secret)) == (200, 401)
            # it waited for the disk once, and the event loop not at all
            assert ticks > 10
            assert not answers.is_set()
            answers.set()
            while await status(secret) != 200:
                await anyio.lowlevel.checkpoint()
            group.cancel_scope.cancel()

    try:
        with capture_logs() as shown:
            anyio.run(main)
    finally:
        answers.set()
    reasons = [entry["reason"] for entry in shown if entry["event"] == "no token of the file is taken"]
    assert reasons == ["the disk has not answered for 1 s"]


def test_while_the_file_is_wrong_none_of_its_tokens_is_taken_and_the_farms_own_is(tmp_path):
    path = tmp_path / "tokens"
    secret = add_token(path, "ci", Role.ADMIN, None)
    own = "the-farms-own-token"  # a test's, nobody's
    world = ApiWorld(1, controller=False, token=own, tokens=TokenFile(path))
    good = path.read_text()
    for text in (good + "ci read never\n", "\x00", "x" * 300_000, None):
        if text is None:
            path.unlink()
        else:
            path.write_text(text)
        assert_problem(world.get(DRIVES, headers={"Authorization": f"Bearer {secret}"}), 401)
        assert world.get(DRIVES, headers={"Authorization": f"Bearer {own}"}).status_code == 200
    path.write_text(good)
    assert world.get(DRIVES, headers={"Authorization": f"Bearer {secret}"}).status_code == 200


# -- the file


HEX = "0" * 64


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (f"ci inject never {HEX}", "line 1: the last word is not sha256:"),
        ("# a\n\nci inject never", "line 3: a line has four words"),
        (f"ci root never sha256:{HEX}", "line 1: there is no role 'root'; there are read, inject, admin"),
        (f"ci read soon sha256:{HEX}", "line 1: 'soon' is not a time such as"),
        (f"ci read 9999-12-31T23:59:59-14:00 sha256:{HEX}", "line 1: .* is not a time such as"),
        (f"../ci read never sha256:{HEX}", r"line 1: '\.\./ci' is not a name"),
        (f"loopback read never sha256:{HEX}", "line 1: loopback is a name of pnfarm's own"),
        (f"a read never sha256:{HEX}\na read never sha256:{HEX[1:]}1", "line 2: a second token is called a"),
        (f"a read never sha256:{HEX}\nb admin never sha256:{HEX}", "line 2: b has the secret of another token"),
    ],
)
def test_a_wrong_line_is_named(tmp_path, text, sentence):
    (tmp_path / "tokens").write_text(text)
    with pytest.raises(ConfigError, match=sentence):
        read_tokens(tmp_path / "tokens")


def test_a_change_through_a_link_changes_the_file_and_leaves_its_owner(tmp_path):
    file, link = tmp_path / "shared", tmp_path / "link"
    add_token(file, "leaver", Role.ADMIN, None)
    file.chmod(0o640)
    if os.geteuid() == 0:
        os.chown(file, 1234, 4321)
    before = file.stat()
    link.symlink_to(file)
    add_token(link, "ci", Role.READ, None)
    remove_tokens(link, ["leaver"])
    assert link.is_symlink()
    assert [holder.name for holder in TokenFile(file).holders] == ["ci"]
    after = file.stat()
    assert (after.st_uid, after.st_gid, after.st_mode) == (before.st_uid, before.st_gid, before.st_mode)


def test_of_two_changes_at_once_none_is_lost(tmp_path, monkeypatch):
    """A token is removed while another one is added: each reads the file and writes it."""
    file = tmp_path / "tokens"
    add_token(file, "leaver", Role.ADMIN, None)
    read, go_on = threading.Event(), threading.Event()
    parse = token_file.parse

    def slow(path, text):
        read.set()
        assert go_on.wait(60)
        return parse(path, text)

    monkeypatch.setattr(token_file, "parse", slow)
    adding = threading.Thread(target=add_token, args=(file, "ci", Role.READ, None))
    adding.start()
    assert read.wait(60)
    removing = threading.Thread(target=remove_tokens, args=(file, ["leaver"]))
    removing.start()
    go_on.set()
    for one in (adding, removing):
        one.join()
    assert [holder.name for holder in read_tokens(file)] == ["ci"]


def test_the_file_keeps_no_secret_and_what_its_owner_wrote(tmp_path):
    path = tmp_path / "tokens"
    path.write_text(f"# ours\nold read 2027-01-31 sha256:{HEX}  # of the wall")
    secret = add_token(path, "ci", Role.INJECT, None)
    assert secret not in path.read_text()
    assert path.read_text().startswith(f"# ours\nold read 2027-01-31 sha256:{HEX}  # of the wall\nci  inject  never  ")
    assert [holder.name for holder in read_tokens(path)] == ["old", "ci"]
    remove_tokens(path, ["old"])
    assert path.read_text().startswith("# ours\nci  inject")
    with pytest.raises(ConfigError, match="has a token ci already"):
        add_token(path, "ci", Role.READ, None)
    with pytest.raises(ConfigError, match="has no token old; it has ci"):
        remove_tokens(path, ["old"])


@pytest.mark.parametrize(("before", "kept"), [("", ""), ("# ours", "# ours\n"), ("# ours\n", "# ours\n")])
def test_a_token_is_a_line_of_its_own_behind_what_the_file_ends_with(tmp_path, before, kept):
    file = tmp_path / "tokens"
    file.write_text(before)
    for name in ("one", "two"):
        add_token(file, name, Role.READ, None)
    text = file.read_text()
    assert text.startswith(kept)
    assert [line.split()[0] for line in text.removeprefix(kept).split("\n")[:-1]] == ["one", "two"]
    assert text.endswith("\n")
