"""The audit log: what it holds, that nothing is done without it, and that it cannot be changed without a trace."""

import asyncio
import contextlib
import errno
import hashlib
import json
import os
import threading
from functools import cached_property
from types import SimpleNamespace

import anyio
import httpx
import pytest
from api_world import BASE, ApiWorld, assert_problem

from pnfarm.api.access import audit as audit_module
from pnfarm.api.access.audit import FIRST, MOST_LINE, AuditLog, digest_of_line, kept
from pnfarm.api.access.audit_check import check_audit
from pnfarm.api.access.token_file import TokenFile, add_token
from pnfarm.cli.main import main
from pnfarm.errors import ConfigError, EnvironmentError_
from pnfarm.web.roles import Role

FAULTS = "/api/v1/faults"
FAULT = {"kind": "silence", "on": "axis-01"}


class Run:
    """A run of a farm with an audit log; ``ask`` changes something, ``end`` and ``kill`` end it."""

    def __init__(self, folder):
        self.file, self.note = folder / "audit.jsonl", folder / "state" / "audit-end.json"
        self.log = AuditLog(self.file, self.note)
        self.log.begin("line-1")

    @cached_property
    def world(self):
        return ApiWorld(1, controller=False, audit=self.log)

    def note_one(self):
        """A request and its answer, without a farm."""

        async def both():
            await self.log.answer(await self.log.request({"path": "/"}), 200)

        anyio.run(both)

    def ask(self):
        return self.world.post("/api/v1/reset")

    def end(self):
        anyio.run(self.log.close)

    def kill(self):
        self.log.release()

    @property
    def records(self):
        return [json.loads(line) for line in self.file.read_text().splitlines()]


@pytest.fixture
def run(tmp_path):
    found = Run(tmp_path)
    yield found
    found.kill()


def test_each_change_has_a_record_before_it_and_one_for_its_answer(tmp_path):
    secret = add_token(tmp_path / "tokens", "ci", Role.INJECT, None)
    reads = add_token(tmp_path / "tokens", "wall", Role.READ, None)
    log = AuditLog(tmp_path / "audit.jsonl")
    world = ApiWorld(1, controller=False, audit=log, tokens=TokenFile(tmp_path / "tokens"))
    body = json.dumps(FAULT).encode()
    headers = {"Content-Type": "application/json", "Authorization": f"Bearer {secret}"}

    async def main():
        async with kept(log, "line-1"):
            await anyio.to_thread.run_sync(ask)

    def ask():
        assert world.request("POST", f"{FAULTS}?dry_run=true", content=body, headers=headers).status_code == 200
        assert world.request("POST", "/api/v1/reset", headers={"Authorization": f"Bearer {reads}"}).status_code == 403
        assert world.get("/api/v1/drives", headers=headers).status_code == 200
        assert world.request("POST", "/api/v1/reset", headers={"Authorization": "Bearer other"}).status_code == 401

    anyio.run(main)
    records = [json.loads(line) for line in (tmp_path / "audit.jsonl").read_text().splitlines()]
    assert [one["record"] for one in records] == ["begin", "request", "answer", "request", "answer", "end"]
    assert [one["sequence"] for one in records] == [1, 2, 3, 4, 5, 6]
    begin, first, answered, refused, forbidden, _ = records
    assert (begin["found"], begin["name"], begin["previous"]) == ("new", "line-1", FIRST)
    asked = ("token", "role", "peer", "method", "path", "query", "body")
    digest = hashlib.sha256(body).hexdigest()
    assert [first[key] for key in asked] == ["ci", "inject", "127.0.0.1", "POST", FAULTS, "dry_run=true", digest]
    assert (answered["of"], answered["status"]) == (2, 200)
    assert (refused["token"], refused["role"], forbidden["status"]) == ("wall", "read", 403)
    assert check_audit(tmp_path / "audit.jsonl").wrong == []
    assert (tmp_path / "audit.jsonl").stat().st_mode & 0o777 == 0o600


def test_who_shows_no_token_writes_nothing_not_even_on_an_open_path(tmp_path):
    log = AuditLog(tmp_path / "audit.jsonl")
    world = ApiWorld(1, controller=False, audit=log, token="the-farms-own")
    for path in ("/openapi.json", "/api/v1/healthz", "/api/v1/readyz", "/api/v1/reset"):
        assert world.post(path).status_code == 401
        assert (world.get(path).status_code == 401) is path.endswith("reset")
    assert log.sequence == 0
    log.release()


def test_what_a_client_makes_long_is_cut_and_known_by_its_digest(run):
    long = "x" * 30_000
    assert run.world.post(f"/api/v1/{long}?{long}").status_code == 404
    told = run.records[1]
    digest = hashlib.sha256(f"/api/v1/{long}".encode()).hexdigest()
    assert told["path"] == f"/api/v1/{long[:1992]}... (30008 characters, SHA-256 {digest})"
    assert len(told["query"]) < 2200
    assert check_audit(run.file).wrong == []


def test_a_record_that_the_check_could_not_read_is_not_written(run):
    with pytest.raises(OSError, match="too long"):
        anyio.run(run.log.request, {"path": "x" * MOST_LINE})
    run.note_one()
    assert check_audit(run.file).wrong == []


def test_a_request_that_is_given_up_while_it_is_written_is_not_written_over(run, monkeypatch):
    began, go_on, sync = threading.Event(), threading.Event(), os.fdatasync

    def slow(file):
        began.set()
        assert go_on.wait(60)
        sync(file)

    monkeypatch.setattr(audit_module.os, "fdatasync", slow)

    async def main():
        # as a server does that ends: it cancels the task, not by a scope of its own
        task = asyncio.ensure_future(run.log.request({"path": "/"}))
        await anyio.to_thread.run_sync(began.wait)
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task
        ending = asyncio.ensure_future(run.log.close())
        await asyncio.sleep(0)  # a turn of the loop: the end waits for the octets before it
        go_on.set()
        await ending

    asyncio.run(main())
    assert [one["record"] for one in run.records] == ["begin", "request", "end"]
    assert check_audit(run.file).wrong == []


@pytest.fixture
def silent(monkeypatch):
    """A disk that does not answer until it is ``released``, and sets ``answered`` then."""
    sync, found = os.fdatasync, SimpleNamespace(released=threading.Event(), answered=threading.Event())

    def slow(file):
        found.released.wait(10)
        sync(file)
        found.answered.set()

    monkeypatch.setattr(audit_module, "WAIT_SECONDS", 0.05)
    monkeypatch.setattr(audit_module.os, "fdatasync", slow)
    yield found
    found.released.set()


def test_while_the_disk_is_silent_each_change_is_refused_and_what_it_takes_later_is_not_carried_out(
    run, silent, monkeypatch
):
    world = run.world

    async def main():
        transport = httpx.ASGITransport(world.app)
        async with httpx.AsyncClient(transport=transport, base_url=BASE) as client:
            for _ in range(2):
                answer = await client.post(FAULTS, json=FAULT)
                assert_problem(answer, 503, "nothing was changed", "the disk has not answered")
            assert not silent.answered.is_set()
            assert world.faults.list() == []
            monkeypatch.setattr(audit_module, "WAIT_SECONDS", 60.0)
            silent.released.set()
            assert (await client.post(FAULTS, json=FAULT)).status_code == 201

    asyncio.run(main())
    told = [(one["record"], one.get("of"), one.get("status")) for one in run.records[1:]]
    refused = [("request", None, None), ("answer", 2, 503)]
    assert told == [*refused, ("request", None, None), ("answer", 4, 201)]
    assert check_audit(run.file).wrong == []


def test_the_end_of_a_run_does_not_wait_for_a_silent_disk(run, silent):
    asyncio.run(run.log.close())
    assert not silent.answered.is_set()
    # it has the files until the disk answers
    with pytest.raises(EnvironmentError_, match="written by another process"):
        AuditLog(run.file)


def test_half_a_line_that_cannot_be_taken_back_at_once_is_gone_before_the_next(run, monkeypatch):
    write = os.write

    def full(file, data):
        return write(file, data[:20]) if file == run.log._file else write(file, data)

    def refuses(file, size):
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    with monkeypatch.context() as patch:
        patch.setattr(audit_module.os, "write", full)
        patch.setattr(audit_module.os, "ftruncate", refuses)
        assert run.ask().status_code == 503
    assert run.ask().status_code == 200
    assert check_audit(run.file).wrong == []


def test_the_handler_gets_the_body_that_was_read_and_a_body_without_end_none(run):
    assert run.world.post(FAULTS, FAULT).status_code == 201
    assert [record["record"] for record in run.records] == ["begin", "request", "answer"]
    answer = run.world.request("POST", FAULTS, content=b"x" * 70_000, headers={"Content-Type": "application/json"})
    assert_problem(answer, 413, "more than 65536 octets")
    assert len(run.records) == 3


@pytest.mark.parametrize("octets", [0, 40])
def test_what_cannot_be_written_is_not_done_and_the_farm_goes_on(run, monkeypatch, octets):
    """The disk is full, before a record or within it."""
    assert run.ask().status_code == 200
    before = run.file.read_bytes()
    write = os.write

    def full(file, data):
        if file != run.log._file:
            return write(file, data)
        if octets:
            return write(file, data[:octets])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(audit_module.os, "write", full)
        answer = run.world.post(FAULTS, FAULT)
        assert_problem(answer, 503, "nothing was changed", "no space left")
        assert answer.headers["retry-after"]
        assert run.world.get("/api/v1/drives").status_code == 200
    assert run.world.faults.list() == []
    assert run.file.read_bytes() == before
    assert run.world.post(FAULTS, FAULT).status_code == 201
    assert check_audit(run.file).wrong == []


@pytest.mark.parametrize("is_replaced", [False, True])
def test_while_the_file_is_not_in_its_place_nothing_is_changed(run, tmp_path, is_replaced):
    moved = run.file.rename(tmp_path / "moved")
    if is_replaced:
        run.file.write_text("")
    assert_problem(run.world.post(FAULTS, FAULT), 503, "nothing was changed")
    assert run.world.faults.list() == []
    moved.rename(run.file)
    assert run.world.post(FAULTS, FAULT).status_code == 201
    assert check_audit(run.file).wrong == []


def test_an_answer_that_could_not_be_written_is_there_before_the_next_request(run, monkeypatch):
    write = os.write

    def no_answers(file, data):
        if file == run.log._file and b'"answer"' in data:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return write(file, data)

    with monkeypatch.context() as patch:
        patch.setattr(audit_module.os, "write", no_answers)
        assert run.world.post(FAULTS, FAULT).status_code == 201
        assert_problem(run.ask(), 503, "input/output error")
    assert run.ask().status_code == 200
    assert [(one["record"], one.get("of")) for one in run.records[1:]] == [
        ("request", None),
        ("answer", 2),
        ("request", None),
        ("answer", 4),
    ]


# -- from run to run


def test_a_second_run_continues_the_file(run, tmp_path):
    run.note_one()
    run.end()
    again = Run(tmp_path)
    assert again.records[-1]["found"] == "continued"
    assert again.records[-1]["noted"]["sequence"] == 4
    again.kill()
    found = check_audit(run.file)
    assert (found.wrong, found.notes, found.records) == ([], [], 5)


def cut(octets):
    """Without its last two lines."""
    return b"".join(octets.splitlines(keepends=True)[:-2])


def other_peer(octets):
    lines = octets.splitlines(keepends=True)
    return b"".join([*lines[:-1], lines[-1].replace(b'"end"', b'"End"')])


@pytest.mark.parametrize(
    ("change", "found"),
    [(cut, "shortened"), (lambda _: b"", "shortened"), (other_peer, "changed"), (None, "missing")],
)
def test_a_run_says_when_the_end_of_the_file_is_not_as_it_was(run, tmp_path, change, found):
    run.note_one()
    run.end()
    noted = {"sequence": run.log.sequence, "digest": run.log.digest}
    if change is None:
        run.file.unlink()
    else:
        run.file.write_bytes(change(run.file.read_bytes()))
    again = Run(tmp_path)
    begin = again.records[-1]
    again.kill()
    assert (begin["found"], begin["noted"]) == (found, noted)
    # numbers go on behind the last one that is known
    assert begin["sequence"] == 5
    wrong = check_audit(run.file).wrong
    assert any(f"found the file {found}" in one and noted["digest"] in one for one in wrong)


def test_a_run_without_the_note_says_so(run, tmp_path):
    run.note_one()
    run.end()
    run.note.unlink()
    again = Run(tmp_path)
    assert (again.records[-1]["found"], again.records[-1]["sequence"]) == ("unnoted", 5)
    again.kill()
    found = check_audit(run.file)
    assert found.wrong == []
    assert "no note of the file's end" in found.notes[0]


def test_a_killed_run_leaves_no_more_than_notes(run, tmp_path):
    run.note_one()
    run.kill()
    # the power failed within a line, behind what is on the disk for certain
    with run.file.open("ab") as file:
        file.write(b'{"sequence":4,"time":"2026')
    again = Run(tmp_path)
    again.note_one()
    again.end()
    found = check_audit(run.file)
    assert found.wrong == []
    assert len(found.notes) == 1
    assert "it is not a record" in found.notes[0]


def test_a_request_that_a_run_did_not_answer_is_noted(run, tmp_path):
    anyio.run(run.log.request, {"path": "/"})
    run.kill()
    for _ in range(2):
        again = Run(tmp_path)
        again.note_one()
        again.end()
    found = check_audit(run.file)
    assert found.wrong == []
    assert found.notes == [f"{run.file}: line 2: the run ended before it answered this request"]


def test_a_log_that_is_only_looked_at_is_not_made(run, tmp_path):
    run.end()
    run.file.unlink()
    for _ in range(2):
        log = AuditLog(run.file, run.note)
        assert log.found == "missing"
        log.release()
    assert not run.file.exists()


def test_two_processes_do_not_write_one_file(run, tmp_path):
    with pytest.raises(EnvironmentError_, match="written by another process"):
        AuditLog(run.file)


def test_a_file_that_is_no_audit_log_is_left_as_it_is(tmp_path):
    (tmp_path / "notes").write_text("what I wanted to do\n")
    with pytest.raises(ConfigError, match="is not an audit log"):
        AuditLog(tmp_path / "notes")
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(ConfigError, match="not a regular file"):
        AuditLog(tmp_path / "pipe")
    with pytest.raises(ConfigError, match="cannot be opened: file exists"):
        AuditLog(tmp_path / "notes" / "in")
    assert (tmp_path / "notes").read_text() == "what I wanted to do\n"


# -- the check


@pytest.fixture
def whole(run):
    for _ in range(3):
        run.note_one()
    run.end()
    return run.file


def test_the_check_prints_what_to_note_and_finds_it_again(whole, capsys):
    assert main(["audit", "check", str(whole)]) == 0
    told = capsys.readouterr().out
    assert "whole, 8 records, 3 requests" in told
    last = told.splitlines()[-1].split()
    assert last[:2] == ["last:", "8"]
    assert main(["audit", "check", str(whole), "--noted", last[2]]) == 0
    whole.write_bytes(cut(whole.read_bytes()))
    capsys.readouterr()
    # shortened at its end it is whole, but for who noted its end
    assert main(["audit", "check", str(whole)]) == 0
    assert main(["audit", "check", str(whole), "--noted", last[2]]) == 1
    assert "shortened or rewritten" in capsys.readouterr().out
    assert main(["audit", "check", f"{whole}.none"]) == 2


@pytest.mark.parametrize("ends", ["orderly", "killed", "within a line"])
def test_a_file_that_was_moved_away_and_the_one_behind_it_are_whole_together(run, tmp_path, ends, capsys):
    run.note_one()
    if ends == "orderly":
        run.end()
    else:
        run.kill()
    if ends == "within a line":
        with run.file.open("ab") as file:
            file.write(b'{"sequence":4,"time":"2026')
    moved = run.file.rename(tmp_path / "november.jsonl")
    again = Run(tmp_path)
    again.note_one()
    again.end()
    assert main(["audit", "check", str(moved), str(run.file)]) == 0
    assert "whole" in capsys.readouterr().out
    # alone, the new one does not say what was before it
    assert main(["audit", "check", str(run.file)]) == 1
    assert "if it was moved away, name it before this one" in capsys.readouterr().out
    lines_changed(moved, lambda lines: lines.__setitem__(1, lines[1].replace(b'"previous"', b' "previous"')))
    assert main(["audit", "check", str(moved), str(run.file)]) == 1
    assert f"{moved}: line 3: it does not follow" in capsys.readouterr().out


@pytest.mark.parametrize("missing", [1, 2, 3])
def test_a_file_that_was_shortened_and_moved_away_is_found_by_the_one_behind_it(run, tmp_path, missing):
    run.note_one()
    run.end()
    moved = run.file.rename(tmp_path / "november.jsonl")
    again = Run(tmp_path)
    again.end()
    assert check_audit(moved, run.file).wrong == []
    lines_changed(moved, lambda lines: lines.__delitem__(slice(-missing, None)))
    assert check_audit(moved).wrong == []
    assert check_audit(moved, run.file).wrong


def test_a_file_whose_last_line_was_changed_after_it_was_moved_away_is_found_by_the_one_behind_it(run, tmp_path):
    run.note_one()
    run.end()
    moved = run.file.rename(tmp_path / "november.jsonl")
    again = Run(tmp_path)
    again.end()
    assert check_audit(moved, run.file).wrong == []
    lines_changed(moved, lambda lines: lines.append(lines.pop().replace(b'"record":"end"', b'"record":"End"')))
    assert check_audit(moved).wrong == []
    assert any("the run that begins here found the file missing" in what for what in check_audit(moved, run.file).wrong)


def test_the_check_says_from_when_to_when_the_records_are(whole):
    found, times = check_audit(whole), [json.loads(line)["time"] for line in whole.read_text().splitlines()]
    assert (found.first_time, found.last_time) == (times[0], times[-1])


def test_a_clock_that_goes_back_is_noted(tmp_path):
    file, previous, lines = tmp_path / "audit.jsonl", FIRST, []
    for number, second in enumerate((5, 7, 6), 1):
        time = f"2026-11-30T12:00:0{second}.000000Z"
        line = json.dumps({"sequence": number, "time": time, "record": "begin", "previous": previous}).encode()
        lines.append(line)
        previous = digest_of_line(line)
    file.write_bytes(b"\n".join(lines) + b"\n")
    found = check_audit(file)
    assert found.wrong == []
    assert found.notes == [f"{file}: line 3: its time is before that of the line before, 2026-11-30T12:00:07.000000Z"]


def test_of_many_findings_the_first_are_listed_and_all_are_counted(tmp_path):
    file = tmp_path / "audit.jsonl"
    file.write_bytes(b"x\n" * 30)
    found = check_audit(file)
    assert (len(found.wrong), found.more) == (20, 10)


def lines_changed(whole, change):
    lines = whole.read_bytes().splitlines(keepends=True)
    change(lines)
    whole.write_bytes(b"".join(lines))


@pytest.mark.parametrize(
    "change",
    [
        lambda lines: lines.pop(3),
        lambda lines: lines.pop(0),
        lambda lines: lines.insert(2, lines[2]),
        lambda lines: lines.__setitem__(2, lines[2].replace(b"200", b"403")),
        lambda lines: lines.__setitem__(4, b"\n"),
        lambda lines: lines.__setitem__(4, b"[1]\n"),
        lambda lines: lines.__setitem__(4, lines[4].replace(b'"sequence":', b'"sequence":"5","then":')),
        lambda lines: lines.__setitem__(4, lines[4].replace(b'"time":', b'"time":7,"then":')),
        lambda lines: lines.__setitem__(4, lines[4][:-20] + b"\n"),
        lambda lines: lines.__setitem__(4, b"x" * 300_000 + b"\n"),
        lambda lines: lines.__setitem__(slice(2, 4), lines[3:1:-1]),
        lambda lines: lines.append(b'{"sequence":9'),
        lambda lines: lines.__setitem__(0, lines[0].replace(b'"noted":', b'"noted":7,"then":')),
        lambda lines: lines.__setitem__(0, lines[0].replace(b'"found":', b'"found":[],"then":')),
        lambda lines: lines.__setitem__(2, lines[2].replace(b'"of":', b'"of":[],"then":')),
    ],
)
def test_the_check_finds_each_change_inside_the_file(whole, change, capsys):
    lines_changed(whole, change)
    assert check_audit(whole).wrong
    assert main(["audit", "check", str(whole), "--format", "json"]) == 1
    assert json.loads(capsys.readouterr().out)["ok"] is False
