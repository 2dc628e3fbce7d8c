"""A running farm whose API is attacked: the API suffers, never a drive."""

from __future__ import annotations

import json
import resource
import socket
import time
import urllib.request
from contextlib import ExitStack
from pathlib import Path

import pytest

FARM = """\
farm: attacked
link: {kind: veth}
api: 127.0.0.1:8703
drives:
  - {name: "axis-{n:02}", count: 2, model: akd-profinet, ip: 10.78.0.11/24}
controller:
  name: plc
  ip: 10.78.0.1/24
  cycle: 16ms
  watchdog_factor: 60
"""
API = "http://127.0.0.1:8703"
HALF = b"GET /api/v1/drives HTTP/1.1\r\nHost: 127.0.0.1\r\n"
CONNECTIONS = 1300


@pytest.fixture
def farm(tmp_path, network, background):
    """A farm and its controller at work; the farm, and where the controller tells how it went."""
    file = tmp_path / "attacked.pnfarm.yml"
    file.write_text(FARM)
    started = background("--log-format", "console", "up", file)
    started.wait_for("attacked: 2 drives")
    plc = background("plc", file, "--json", tmp_path / "plc.json")
    plc.wait_for('"connected"')
    plc.wait_for('"connected"')
    return started, plc, tmp_path / "plc.json"


@pytest.fixture
def files():
    """Lets this process have as many files as the attack takes."""
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(before[1], 8192), before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_NOFILE, before)


def pid_of(started) -> int:
    return started._process.pid


def half_open(stack: ExitStack) -> int:
    """Connections that begin a request; how many the machine let us have."""
    count = 0
    for _ in range(CONNECTIONS):
        sock = stack.enter_context(socket.socket())
        sock.setblocking(False)
        sock.connect_ex(("127.0.0.1", 8703))
        count += 1
        if count % 50 == 0:
            time.sleep(0.05)  # a burst beyond the listen queue would not arrive at all
        try:
            sock.send(HALF)
        except OSError:
            continue
    return count


def get(path: str, seconds: float = 20.0):
    with urllib.request.urlopen(API + path, timeout=seconds) as answer:
        return json.loads(answer.read())


def losses(plc, summary: Path) -> dict[str, int]:
    assert plc.stop() == 0
    return {row["name"]: row["losses"] for row in json.loads(summary.read_text())["drives"]}


def test_thirteen_hundred_half_open_connections_cost_no_drive_anything_and_the_api_answers(farm, files):
    started, plc, summary = farm
    with ExitStack() as stack:
        assert half_open(stack) == CONNECTIONS
        assert len(get("/api/v1/drives")["drives"]) == 2
        assert len(list(Path(f"/proc/{pid_of(started)}/fd").iterdir())) < 400
    assert losses(plc, summary) == {"axis-01": 0, "axis-02": 0}
    assert started.stop() == 0
    assert "Traceback" not in started.err


def test_a_farm_without_a_single_file_left_goes_on_and_its_cables_come_back(farm, files):
    started, plc, summary = farm
    pid = pid_of(started)
    used = len(list(Path(f"/proc/{pid}/fd").iterdir()))
    before = resource.prlimit(pid, resource.RLIMIT_NOFILE)
    body = json.dumps({"kind": "link-down", "on": "axis-01", "for": "1s"}).encode()
    request = urllib.request.Request(
        f"{API}/api/v1/faults", data=body, headers={"Content-Type": "application/json"}, method="POST"
    )
    with urllib.request.urlopen(request, timeout=20) as answer:
        assert answer.status == 201
    with ExitStack() as stack:
        # from now on the process gets no further file, while a cable is out
        resource.prlimit(pid, resource.RLIMIT_NOFILE, (used, before[1]))
        half_open(stack)
        # the farm looks twice a second whether its interfaces are there, and the cable is due
        time.sleep(4.0)
        assert started._process.poll() is None, started.err
        resource.prlimit(pid, resource.RLIMIT_NOFILE, before)

    def states() -> set[str]:
        return {drive["ar_state"] for drive in get("/api/v1/drives")["drives"]}

    end = time.monotonic() + 20
    while states() != {"DATA"} and time.monotonic() < end:
        time.sleep(0.1)
    assert states() == {"DATA"}
    assert losses(plc, summary)["axis-02"] == 0
    assert started.stop() == 0
    assert "was removed" not in started.err
