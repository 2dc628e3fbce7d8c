"""Log lines: one for an event, and a sum each second for what repeats, whatever a peer does."""

from __future__ import annotations

import json
import logging
import subprocess
import sys
from pathlib import Path

import pytest
import structlog

from pnfarm.cli.log.limit import ALL_LINES, KIND_LINES, MAX_KINDS, MAX_SUMS, LineLimit
from pnfarm.cli.log.setup import configure

ROOT = Path(__file__).resolve().parents[2]


class Log:
    """A limit with a clock and a timer that the test moves; ``lines`` is what was written."""

    def __init__(self):
        self.now = 1000.0
        self.due = []
        self.lines = []
        self.limit = LineLimit(clock=lambda: self.now, timer=lambda seconds, action: self.due.append((seconds, action)))
        structlog.configure(processors=[self.limit, self._keep], cache_logger_on_first_use=False)
        self.logger = structlog.get_logger()

    def _keep(self, _logger, level, line):
        self.lines.append({**line, "level": level})
        raise structlog.DropEvent

    def wait(self, seconds=1.0):
        self.now += seconds
        due, self.due = self.due, []
        for _, action in due:
            action()


@pytest.fixture
def log():
    yield Log()
    structlog.reset_defaults()


def test_a_start_up_is_logged_line_by_line(log):
    for state in ("S1", "S2", "S3", "S4"):
        log.logger.info("state changed", drive="axis-01", state=state)
    assert [line["state"] for line in log.lines] == ["S1", "S2", "S3", "S4"]
    assert log.due == []


def test_a_flood_is_one_line_a_second_with_its_count_and_its_last_peer(log):
    for number in range(10_000):
        log.logger.warning("connection replaced", drive="axis-01", peer=number)
    assert len(log.lines) == KIND_LINES
    log.wait()
    assert log.lines[-1] == {
        "event": "connection replaced",
        "drive": "axis-01",
        "peer": 9_999,
        "repeated": 10_000 - KIND_LINES,
        "level": "warning",
    }
    del log.lines[:]
    for _ in range(60):
        for number in range(1_000):
            log.logger.warning("connection replaced", drive="axis-01", peer=number)
        log.wait()
    # in each second the line that came back to the credit, and the sum of the others
    assert len(log.lines) <= 2 * 60
    assert sum(line.get("repeated", 1) for line in log.lines) == 60_000


def test_a_held_line_that_stands_for_several_counts_as_them(log):
    for _ in range(int(KIND_LINES)):
        log.logger.info("connection refused", drive="axis-01")
    log.logger.info("connection refused", drive="axis-01", repeated=600)
    log.logger.info("connection refused", drive="axis-01")
    log.wait()
    assert log.lines[-1]["repeated"] == 601


def test_another_drive_and_another_event_are_not_held_back_with_it(log):
    for _ in range(100):
        log.logger.info("connection lost", drive="axis-01")
    log.logger.info("connection lost", drive="axis-02")
    log.logger.info("fault", drive="axis-01")
    assert [(line["event"], line["drive"]) for line in log.lines[-2:]] == [
        ("connection lost", "axis-02"),
        ("fault", "axis-01"),
    ]


def test_what_a_client_changes_is_not_held_back_with_what_another_does(log):
    for number in range(100):
        log.logger.warning("fault requested", who="loopback", peer="127.0.0.1", id=f"fault-{number}")
    log.logger.warning("fault requested", who="token", peer="10.0.0.9", id="mine")
    assert (log.lines[-1]["peer"], log.lines[-1]["id"]) == ("10.0.0.9", "mine")
    log.wait()
    assert {key: log.lines[-1][key] for key in ("peer", "id", "repeated")} == {
        "peer": "127.0.0.1", "id": "fault-99", "repeated": 100 - KIND_LINES,
    }  # fmt: skip


def test_after_a_flood_a_kind_of_line_is_written_as_it_comes(log):
    for _ in range(1_000):
        log.logger.info("connection lost", drive="axis-01")
    log.wait()
    log.wait(60.0)
    before = len(log.lines)
    log.logger.info("connection lost", drive="axis-01")
    assert len(log.lines) == before + 1
    assert "repeated" not in log.lines[-1]


def test_all_kinds_together_have_a_bound(log):
    for number in range(40_000):
        log.logger.info("station appeared", drive=f"axis-{number % 4000}", number=number)
    assert len(log.lines) == ALL_LINES
    log.wait()
    sums = log.lines[int(ALL_LINES) :]
    assert len(sums) == MAX_SUMS + 1
    assert sums[-1]["event"] == "other log lines held back"
    assert sum(line["repeated"] for line in sums) == 40_000 - ALL_LINES


def test_kinds_that_a_peer_names_take_no_memory_without_bound(log):
    for number in range(3 * MAX_KINDS):
        event = f"name {number}"
        log.logger.info(event, drive="x" * 10_000)
    assert len(log.limit._kinds) <= MAX_KINDS + 1
    assert max(len(part) for key in log.limit._kinds for part in key) <= 200


def test_a_kind_that_was_quiet_makes_room_for_others(log):
    for number in range(MAX_KINDS):
        event = f"name {number}"
        log.logger.info(event)
    log.wait(60.0)
    log.logger.info("one more")
    assert len(log.limit._kinds) == 1


def test_kinds_that_are_quiet_are_forgotten_before_there_are_many(log):
    for number in range(10):
        log.logger.info(f"name {number}")  # noqa: G004 - each is a kind of its own
    log.wait(60.0)
    log.logger.info("one more")
    assert [event for event, *_ in log.limit._kinds] == ["one more"]


def test_lines_of_libraries_are_limited_by_the_place_that_writes_them(log):
    def record(message):
        return logging.LogRecord("asyncio", logging.ERROR, "/lib/selector_events.py", 190, message, (), None)

    passed = [log.limit.filter(record(f"socket.accept() out of system resource {n}")) for n in range(500)]
    assert sum(passed) == KIND_LINES
    log.wait()
    assert (log.lines[-1]["logger"], log.lines[-1]["level"]) == ("asyncio", "error")
    assert log.lines[-1]["repeated"] == 500 - KIND_LINES


def test_without_a_thread_for_the_sums_nothing_is_lost(log, monkeypatch):
    def none_left(_seconds, _action):
        raise RuntimeError("can't start new thread")

    limit = LineLimit(clock=lambda: log.now, timer=none_left)
    structlog.configure(processors=[limit, log._keep])
    for _ in range(100):
        log.logger.info("again")
    limit.flush()
    assert sum(line.get("repeated", 1) for line in log.lines) == 100


def run(program: str, *arguments: str) -> str:
    """What the program writes to standard error."""
    done = subprocess.run(
        [sys.executable, "-c", program, *arguments], check=True, capture_output=True, text=True, timeout=120, cwd=ROOT
    )
    return done.stderr


@pytest.mark.parametrize("style", ["json", "console"])
def test_what_is_held_back_is_summed_up_when_the_program_ends(style):
    text = run(
        "import sys; sys.path.insert(0, 'tests/support'); from events import Something\n"
        "from pnfarm.cli.log.setup import configure; from pnfarm.station.event_log import EventLog\n"
        "configure(as_json=sys.argv[1] == 'json')\n"
        "log = EventLog()\n"
        "for n in range(5000): log.record(n, 'axis-01', Something('connection replaced', {'peer': n}))\n"
        "assert len(log.entries()) > 4000\n",
        style,
    )
    lines = text.splitlines()
    assert len(lines) <= KIND_LINES + 3
    assert "repeated" in lines[-1]


def test_a_traceback_shows_no_values_of_variables():
    text = run(
        "import sys; from pnfarm.cli.log.setup import configure; import structlog\n"
        "configure(as_json=sys.argv[1] == 'json')\n"
        "def fail(secret): raise ValueError('no')\n"
        "try: fail('hunter2' * 10000)\n"
        "except ValueError: structlog.get_logger().exception('failed')\n",
        "json",
    )
    (line,) = map(json.loads, text.splitlines())
    assert line["exception"][0]["exc_type"] == "ValueError"
    assert "hunter2" not in text
    assert len(text) < 4_000


HANG_UP = """
import socket, sys, threading
sys.path[:0] = ["tests/support", "tests/api"]
import anyio
from api_world import ApiWorld
from pnfarm.api import serve
from pnfarm.cli.log.setup import configure
configure(as_json=True)
world = ApiWorld(1, controller=False)

def hang_up(port):
    for _ in range(int(sys.argv[1])):
        with socket.create_connection(("127.0.0.1", port)) as peer:
            peer.sendall(b"POST /api/v1/faults HTTP/1.1\\r\\nHost: localhost\\r\\n"
                         b"Content-Type: application/json\\r\\nContent-Length: 60000\\r\\n\\r\\n" + b"x" * 30000)
            # hung up, and the server has seen it when it closes its side
            peer.shutdown(socket.SHUT_WR)
            while peer.recv(65536):
                pass
    with socket.create_connection(("127.0.0.1", port)) as peer:
        peer.sendall(b"GET /health HTTP/1.1\\r\\nHost: localhost\\r\\nConnection: close\\r\\n\\r\\n")
        while peer.recv(65536):
            pass

async def main():
    async with anyio.create_task_group() as group:
        async def run(*, task_status):
            await serve(world.app, "127.0.0.1", 0, task_status=task_status)
        host, port = await group.start(run)
        await anyio.to_thread.run_sync(hang_up, port)
        group.cancel_scope.cancel()
anyio.run(main)
"""


def test_a_client_that_hangs_up_in_its_request_is_one_short_line():
    text = run(HANG_UP, "40")
    lines = [json.loads(line) for line in text.splitlines()]
    assert {line["event"] for line in lines} == {"client hung up"}
    assert sum(line.get("repeated", 1) for line in lines) == 40
    assert len(lines) <= KIND_LINES + 3
    assert max(map(len, text.splitlines())) < 300


@pytest.mark.parametrize("turn", ["sets the log up", "has lines held back", "has none of them"])
def test_what_the_log_holds_back_of_a_test_is_not_written_in_a_later_one(turn, capsys):
    if turn == "sets the log up":
        configure(as_json=True)
    elif turn == "has lines held back":
        for _ in range(50):
            structlog.get_logger().info("many")
    else:
        # as a second later, by a thread of its own
        structlog.get_config()["processors"][0].flush()
        assert capsys.readouterr().err == ""
