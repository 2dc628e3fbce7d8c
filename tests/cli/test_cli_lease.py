"""Two machines (namespaces on one bridge), one database, one farm: its drives never speak from both."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from forks import PROGRAM, clean_environment
from postgres_server import PASSWORD, started
from waiting import until

TTL_SECONDS = 3
FARM = """\
farm: leasetest
link: {{kind: macvlan, parent: eth1}}
state: {url}
lease: {{ttl: {ttl}s}}
api: 127.0.0.1:8702
drives:
  - {{name: "pn-{{n}}", count: 2, model: akd-profinet, ip: 10.79.0.11/24}}
  - {{name: "eip-1", model: akd-ethernetip, ip: 10.79.0.21/24}}
controller:
  ip: 10.79.0.1/24
  link: {{kind: veth, bridge: lebr}}
  reconnect: {{after: 200ms}}
  ethernetip: {{ip: 10.79.0.2/24, rpi: 20ms}}
"""
NODES = ("a", "b")
UP = "leasetest: 3 drives"


@pytest.fixture(scope="module")
def server():
    yield from started()


class Node:
    """A machine: a network namespace with one card on the bridge."""

    def __init__(self, name: str, ip) -> None:
        self._near, self._ip = f"le{name}", ip
        self._holder = subprocess.Popen(["unshare", "-n", "sleep", "infinity"])
        self._pid = str(self._holder.pid)
        try:
            here = Path("/proc/thread-self/ns/net").readlink()
            assert until(lambda: Path(f"/proc/{self._pid}/ns/net").readlink() != here)
            ip("link", "add", self._near, "type", "veth", "peer", "name", "eth1", "netns", self._pid)
            ip("link", "set", self._near, "master", "lebr", "up")
            for words in (("lo", "up"), ("eth1", "up")):
                self.run("ip", "link", "set", *words)
        except BaseException:
            self._stop()
            raise

    def _inside(self, *words) -> list[str]:
        return ["nsenter", "-t", self._pid, "-n", *map(str, words)]

    def run(self, *words) -> str:
        return subprocess.run(self._inside(*words), check=True, capture_output=True, text=True).stdout

    def _ran(self, *words) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            self._inside(sys.executable, "-m", PROGRAM, *words), check=False, capture_output=True, text=True,
            env=clean_environment(), timeout=60,
        )  # fmt: skip

    def pnfarm(self, *words) -> str:
        done = self._ran(*words)
        return done.stdout + done.stderr

    def obeys(self, *words) -> bool:
        """Whether it did that: a drive refuses to save what its memory does not take in time."""
        return self._ran(*words).returncode == 0

    def up(self, file, log):
        with log.open("w") as out:
            words = self._inside(sys.executable, "-m", PROGRAM, "--log-format", "console", "up", file)
            return subprocess.Popen(words, stdout=out, stderr=subprocess.STDOUT, env=clean_environment())

    def end(self) -> None:
        try:
            # a namespace goes some time after its last process, and its cables with it
            self._ip("link", "del", self._near)
        finally:
            self._stop()

    def _stop(self) -> None:
        self._holder.kill()
        self._holder.wait()


class Capture:
    """Who spoke when, at both machines' ports of the bridge."""

    def __init__(self) -> None:
        self.seen: list[tuple[float, str, str]] = []
        self._end = False
        self._sockets = {}
        for name in NODES:
            sock = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(3))
            sock.bind((f"le{name}", 3))
            sock.settimeout(0.05)
            self._sockets[name] = sock
        self._threads = [threading.Thread(target=self._listen, args=(name,)) for name in NODES]
        for thread in self._threads:
            thread.start()

    def _listen(self, name: str) -> None:
        sock = self._sockets[name]
        while not self._end:
            try:
                frame, (_, _, kind, _, _) = sock.recvfrom(2048)
            except TimeoutError:
                continue
            if kind != socket.PACKET_OUTGOING:
                self.seen.append((time.monotonic(), name, frame[6:12].hex(":")))

    def close(self) -> None:
        self._end = True
        for thread in self._threads:
            thread.join()
        for sock in self._sockets.values():
            sock.close()

    def places(self, mac: str) -> list[str]:
        """Where an address spoke, in order; the same place once."""
        found: list[str] = []
        for _, place, source in sorted(self.seen):
            if source == mac and found[-1:] != [place]:
                found.append(place)
        return found


def all_connected(node: Node) -> bool:
    try:
        return all(drive["connected"] for drive in json.loads(node.pnfarm("inspect", "--format", "json"))["drives"])
    except (ValueError, KeyError):
        return False


def value(node: Node) -> int:
    return json.loads(node.pnfarm("param", "get", "pn-1", "DRV.ACC", "--format", "json"))["value"]


#: Prints the answer of GET readyz.
READY = """
import urllib.error, urllib.request
try:
    print(urllib.request.urlopen("http://127.0.0.1:8702/api/v1/readyz").read())
except urllib.error.HTTPError as error:
    print(error.code, error.read().decode())
"""


@pytest.fixture
def nodes(network):
    network("link", "add", "lebr", "type", "bridge")
    network("link", "set", "lebr", "up")
    made = []
    try:
        made += (Node(name, network) for name in NODES)
        yield made
    finally:
        for node in made:
            node.end()
        network("link", "del", "lebr")


@pytest.fixture
def file(tmp_path, server):
    path = tmp_path / "leasetest.pnfarm.yml"
    path.write_text(FARM.format(url=server.url, ttl=TTL_SECONDS))
    return path


@pytest.fixture
def ups(nodes, file, tmp_path, server):
    """Starts farms on nodes, and ends them; no log has the password."""
    running, logs = [], []

    def start(node: Node):
        log = tmp_path / f"up-{len(logs)}"
        logs.append(log)
        running.append(node.up(file, log))
        return running[-1], log

    yield start
    server.thaw()
    for process in running:
        if process.poll() is None:
            process.send_signal(signal.SIGCONT)
            process.terminate()
            process.wait(30)
    assert all(PASSWORD not in log.read_text() for log in logs)


@pytest.fixture
def capture(nodes):
    made = Capture()
    yield made
    made.close()


def said(log: Path, text: str, seconds: float = 60.0) -> None:
    assert until(lambda: text in log.read_text(), seconds), log.read_text()


@pytest.mark.slow
def test_a_frozen_machine_that_wakes_up_stays_mute_while_another_has_its_drives(nodes, ups, capture, file, background):
    a, b = nodes
    first, log_of_first = ups(a)
    said(log_of_first, UP)
    view = json.loads(a.pnfarm("inspect", "--format", "json"))
    macs = [drive["mac"] for drive in view["drives"]]
    assert (view["standing"]["lease"], view["standing"]["memory_up"]) == ("held", True)
    assert view["standing"]["mute_after_seconds"] == pytest.approx(TTL_SECONDS * 0.8)
    second, log_of_second = ups(b)
    said(log_of_second, "waiting for drives that run elsewhere")
    plc = background("--log-format", "console", "plc", file, "--seconds", "60")
    assert until(lambda: all_connected(a))
    # the waiting copy has no interface and said nothing
    assert all(capture.places(mac) == ["a"] for mac in macs)
    assert "macvlan" not in b.run("ip", "-d", "link")
    before = value(a)
    assert until(lambda: a.obeys("param", "set", "pn-1", "DRV.ACC", str(before + 1000)))
    assert until(lambda: a.obeys("param", "set", "pn-1", "DRV.NVSAVE", "1"))
    first.send_signal(signal.SIGSTOP)
    said(log_of_second, UP)
    assert until(lambda: all_connected(b))
    first.send_signal(signal.SIGCONT)
    said(log_of_first, "lease taken by another")
    # what was saved there is in force here
    assert value(b) == before + 1000
    standing = json.loads(a.pnfarm("inspect", "--format", "json"))["standing"]
    assert (standing["lease"], standing["held_by"]["shard"]) == ("waiting", "")
    assert "their lease is not held" in a.run(sys.executable, "-c", READY)
    assert all(capture.places(mac) == ["a", "b"] for mac in macs)
    # the one that took over is killed, and the first one has the drives again, restarted
    second.kill()
    second.wait(30)
    said(log_of_first, "lease regained")
    assert until(lambda: all_connected(a)), log_of_first.read_text()
    assert all(capture.places(mac) == ["a", "b", "a"] for mac in macs)
    first.send_signal(signal.SIGTERM)
    assert first.wait(30) == 0
    plc.stop()


@pytest.mark.slow
def test_without_its_database_the_drives_fall_silent_and_come_back_with_it(
    nodes, ups, capture, file, background, server
):
    a, _ = nodes
    first, log = ups(a)
    said(log, UP)
    plc = background("--log-format", "console", "plc", file, "--seconds", "60")
    assert until(lambda: all_connected(a))
    server.freeze()
    said(log, "memory away")
    said(log, "lease lost")
    time.sleep(0.5)
    heard = len(capture.seen)
    down = a.run("ip", "-br", "link", "show", "type", "macvlan")
    assert down.count("DOWN") == 3
    time.sleep(0.5)
    assert [
        mac for _, _, mac in capture.seen[heard:] if mac[:2] == "02" and (capture.places(mac) or [""])[-1] == "a"
    ] == []
    server.thaw()
    said(log, "lease regained")
    assert until(lambda: all_connected(a)), log.read_text()
    assert "memory back" in log.read_text()
    first.send_signal(signal.SIGTERM)
    assert first.wait(30) == 0
    plc.stop()
