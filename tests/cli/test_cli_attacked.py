"""A running farm whose API is attacked: the API suffers, never a drive."""

from __future__ import annotations

import json
import re
import resource
import socket
import time
import urllib.error
import urllib.request
from contextlib import ExitStack
from pathlib import Path
from random import Random

import pytest

from pnfarm.api.access.audit_check import check_audit
from pnfarm.api.access.authority import make_certificate
from pnfarm.api.access.token_file import add_token, remove_tokens
from pnfarm.vocabulary.trust import client_context
from pnfarm.web.roles import Role

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
FLOOD = 100_000


@pytest.fixture
def farm(tmp_path, network, background):
    """A farm and its controller at work; the farm, and where the controller tells how it went."""
    return at_work(tmp_path, background)


def at_work(tmp_path, background, *options):
    file = tmp_path / "attacked.pnfarm.yml"
    file.write_text(FARM)
    started = background("--log-format", "console", "up", file, *options)
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


def half_open(stack: ExitStack, octets: bytes = HALF) -> int:
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
            sock.send(octets)
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


class Secured:
    """A farm with certificate, tokens and audit log, at work; ``secrets`` are of its tokens."""

    def __init__(self, tmp_path, background):
        made = make_certificate(tmp_path / "tls", [], 30)
        tokens = tmp_path / "tokens"
        now = time.time()
        self.secrets = {
            "wall": add_token(tokens, "wall", Role.READ, None),
            "ci": add_token(tokens, "ci", Role.INJECT, None),
            "late": add_token(tokens, "late", Role.ADMIN, now - 1),
        }
        self.tokens, self.audit = tokens, tmp_path / "audit.jsonl"
        self.context = client_context(made.authority)
        options = ("--tls-cert", made.certificate, "--tls-key", made.key, "--tokens", tokens, "--audit", self.audit)
        self.started, self.plc, self.summary = at_work(tmp_path, background, *options)

    def status(self, path, who, method="GET", body=None, **headers):
        headers = {"Authorization": f"Bearer {self.secrets[who]}", "Content-Type": "application/json", **headers}
        data = None if body is None else json.dumps(body).encode()
        url = f"https://127.0.0.1:8703{path}"
        request = urllib.request.Request(url, data=data, headers=headers, method=method)
        try:
            with urllib.request.urlopen(request, timeout=20, context=self.context) as answer:
                return answer.status
        except urllib.error.HTTPError as refused:
            with refused:
                return refused.code

    def handshakes(self, count):
        """So many connections that say no more than what TLS needs; how many the farm took."""
        taken = 0
        for _ in range(count):
            try:
                with (
                    socket.create_connection(("127.0.0.1", 8703), 20) as sock,
                    self.context.wrap_socket(sock, server_hostname="127.0.0.1"),
                ):
                    taken += 1
            except OSError:
                continue
        return taken


def test_strangers_at_a_farm_with_tls_cost_no_drive_anything_and_change_nothing(tmp_path, network, background, files):
    farm = Secured(tmp_path, background)
    fault = {"kind": "silence", "on": "axis-01"}
    with ExitStack() as stack:
        # the head of a ClientHello of 512 octets that never come
        assert half_open(stack, bytes.fromhex("160301020001")) == CONNECTIONS
        assert farm.status("/api/v1/drives", "wall") == 200
        assert len(list(Path(f"/proc/{pid_of(farm.started)}/fd").iterdir())) < 400
    assert farm.handshakes(500) == 500
    with socket.create_connection(("127.0.0.1", 8703), 20) as plain:
        plain.sendall(HALF + b"\r\n")
        plain.settimeout(20)
        assert b"HTTP" not in plain.recv(4096)
    for who, origin, status in (
        ("late", None, 401),
        ("wall", None, 403),
        ("ci", "https://evil.example", 403),
        ("ci", "http://127.0.0.1:8703", 403),
    ):
        headers = {} if origin is None else {"Origin": origin}
        assert farm.status("/api/v1/faults", who, "POST", fault, **headers) == status
    assert farm.status("/api/v1/states/loaded", "ci", "PUT", {}) == 403
    assert farm.status("/api/v1/faults?dry_run=true", "ci", "POST", fault) == 200
    remove_tokens(farm.tokens, ["ci"])
    assert farm.status("/api/v1/faults", "ci", "POST", fault) == 401
    assert losses(farm.plc, farm.summary) == {"axis-01": 0, "axis-02": 0}
    assert farm.started.stop() == 0
    assert "Traceback" not in farm.started.err
    assert len(farm.started.err) < 100_000
    found = check_audit(farm.audit)
    asked = [record for record in map(json.loads, farm.audit.read_text().splitlines()) if record["record"] == "request"]
    # what had no valid token, or came from another page, is not in it
    assert [(one["token"], one["path"]) for one in asked] == [
        ("wall", "/api/v1/faults"),
        ("ci", "/api/v1/states/loaded"),
        ("ci", "/api/v1/faults"),
    ]
    assert (found.wrong, found.notes) == ([], [])


@pytest.fixture
def stranger(farm, network):
    """A station more on the farm's bridge: sends frames as fast as it can."""
    bridge = next(
        name for name in re.findall(r"^\d+: ([^:@]+)", network("-o", "link", "show", "type", "bridge"), re.MULTILINE)
    )
    network("link", "add", "stranger0", "type", "veth", "peer", "name", "stranger1")
    network("link", "set", "stranger1", "master", bridge)
    for end in ("stranger0", "stranger1"):
        network("link", "set", end, "up")
    with socket.socket(socket.AF_PACKET, socket.SOCK_RAW) as sock:
        sock.bind(("stranger0", 0))
        yield sock
    network("link", "del", "stranger0")


def hostile_frames(drive: bytes, rng: Random) -> list[bytes]:
    """What a stranger sends to a drive and to everybody: searches, cyclic data, calls, ARP requests, noise."""
    own, everybody = bytes.fromhex("020000000099"), b"\xff" * 6
    there, here = bytes([10, 78, 0, 11]), bytes([10, 78, 0, 99])
    cyclic = [b"\x88\x92" + rng.randrange(0x8000, 0xC000).to_bytes(2, "big") + rng.randbytes(40) for _ in range(64)]
    address = bytes.fromhex("0806000108000604 0001") + own + here + bytes(6) + there
    # IPv4 of 228 octets, UDP to the port of PROFINET's endpoint mapper
    call = bytes.fromhex("0800 450000e4000000004011 0000") + here + there + bytes.fromhex("8900889400d00000")
    calls = [call + rng.randbytes(200) for _ in range(16)]
    types = (b"\x88\x92", b"\x08\x00", b"\x08\x06", b"\x88\xcc")
    noise = [rng.choice(types) + rng.randbytes(1400) for _ in range(16)]
    # DCP Identify for all
    search = bytes.fromhex("8892 fefe 0500") + rng.randbytes(4) + bytes.fromhex("00ff0004 ffff0000") + bytes(40)
    bodies = [*cyclic, *[address] * 8, *calls, *noise]
    return [bytes.fromhex("010ecf000000") + own + search] * 2 + [
        to + own + body for body in bodies for to in (drive, everybody)
    ]


def test_a_flood_of_frames_costs_no_drive_its_connection(farm, stranger):
    started, plc, summary = farm
    rng = Random(8892)
    frames = [
        frame
        for drive in get("/api/v1/drives")["drives"]
        for frame in hostile_frames(bytes.fromhex(drive["mac"].replace(":", "")), rng)
    ]
    for number in range(FLOOD):
        stranger.send(frames[number % len(frames)])
    drives = [get(f"/api/v1/drives/{name}") for name in ("axis-01", "axis-02")]
    assert [drive["ar_state"] for drive in drives] == ["DATA", "DATA"]
    assert min(drive["frames_discarded"]["unknown-frame-id"] for drive in drives) > 1000, "the flood has come"
    assert losses(plc, summary) == {"axis-01": 0, "axis-02": 0}
    assert started.stop() == 0
    assert "Traceback" not in started.err
    assert len(started.err) < 100_000


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
