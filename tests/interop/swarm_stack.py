"""The stack of compose.swarm.yaml on three engines, its hub's API, and who speaks with which MAC address where."""

import contextlib
import ctypes
import errno
import itertools
import json
import os
import re
import socket
import tempfile
import threading
import time
from pathlib import Path

import pytest
from rig_engine import BUILT, Engine, why_not
from swarm_rig import Swarm

from pnfarm.cli.farm_file import read
from pnfarm.farm.file.reading import expand

SHARDS = 3
TOKEN, PASSWORD = "a-token-of-the-swarm", "a-password-of-the-database"
#: One request in the hub's container: method, path, body; prints [status, text].
ASK = """
import json, sys, urllib.error, urllib.request
method, path, body = sys.argv[1:]
token = open("/run/secrets/token").read().strip()
headers = {"Content-Type": "application/json", "Authorization": "Bearer " + token}
url = "http://127.0.0.1:8702/api/v1/" + path
request = urllib.request.Request(url, body.encode() or None, headers, method=method)
try:
    with urllib.request.urlopen(request, timeout=20) as answer:
        print(json.dumps([answer.status, answer.read().decode()]))
except urllib.error.HTTPError as error:
    print(json.dumps([error.code, error.read().decode()]))
"""
FARM_FILE = Path(__file__).resolve().parents[2] / "configs" / "swarm" / "farm.pnfarm.yml"


def eventually(what, seconds=60.0):
    """``what()`` once it is true, and how long that took; an answer that fails is none yet."""
    began = time.monotonic()
    last = None
    while time.monotonic() - began < seconds:
        try:
            if found := what():
                return found, time.monotonic() - began
        except AssertionError as exc:
            last = exc
        # other machines are asked: nothing here tells when their answer changes
        time.sleep(0.3)
    raise AssertionError(f"not within {seconds} s; {last}")


class Capture:
    """Which MAC addresses spoke at which port of the fieldbus's switch, and when: runs of (port, first, last)."""

    def __init__(self, swarm):
        self.runs = {}
        self._end = False
        self._lock = threading.Lock()
        self._sockets = {}
        with _in_space(swarm.switch):
            for node in swarm.nodes:
                sock = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(3))
                sock.bind((f"wire{node.number}", 3))
                sock.settimeout(0.1)
                self._sockets[node.number] = sock
        self._threads = [threading.Thread(target=self._listen, args=item) for item in self._sockets.items()]
        for thread in self._threads:
            thread.start()

    def _listen(self, number, sock):
        frame = bytearray(14)
        while not self._end:
            try:
                _, (_, _, kind, _, _) = sock.recvfrom_into(frame)
            except TimeoutError:
                continue
            except OSError as exc:
                # the cable was pulled; the socket hears more once it is plugged
                if exc.errno != errno.ENETDOWN:
                    raise
                continue
            if kind == socket.PACKET_OUTGOING:
                continue
            now, mac = time.monotonic(), bytes(frame[6:12])
            with self._lock:
                runs = self.runs.setdefault(mac, [])
                if runs and runs[-1][0] == number:
                    runs[-1][2] = now
                else:
                    runs.append([number, now, now])

    def close(self):
        self._end = True
        for thread in self._threads:
            thread.join()
        for sock in self._sockets.values():
            sock.close()

    def places(self, mac):
        """The ports where an address spoke, in order; the same port once."""
        with self._lock:
            return [run[0] for run in self.runs.get(mac, [])]

    def silence(self, macs):
        """The longest time between the last frame at one port and the first at the next, s."""
        with self._lock:
            runs = [self.runs[mac] for mac in macs]
        return max(after[1] - before[2] for each in runs for before, after in itertools.pairwise(each))


@contextlib.contextmanager
def _in_space(name):
    """This thread in a network namespace: sockets stay in the one where they were made."""
    # Python 3.11 has no call of its own
    libc = ctypes.CDLL(None, use_errno=True)
    with open("/proc/thread-self/ns/net") as here, open(f"/var/run/netns/{name}") as there:  # noqa: PTH123 - names of kernel objects
        try:
            if libc.setns(there.fileno(), 0):
                raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
            yield
        finally:
            libc.setns(here.fileno(), 0)


class Stack:
    """The deployed stack."""

    def __init__(self, folder, images):
        self.swarm = Swarm(folder, images)
        self.capture = None
        self.macs = {drive.name: drive.mac for drive in expand(read(FARM_FILE))}
        self.names = list(self.macs)

    def up(self):
        self.swarm.up()
        self.capture = Capture(self.swarm)
        for name, value in (("pnfarm_token", TOKEN), ("pnfarm_db", PASSWORD), ("pnfarm_grafana", "unused")):
            self.swarm.secret(name, value)
        self.swarm.deploy()

    def places(self, names):
        """Each drive's ports of the switch, in the order in which it spoke there."""
        return {name: self.capture.places(self.macs[name]) for name in names}

    def spoke_twice(self):
        """Drives that spoke at one port, then at another, and then at the first one again."""
        return {name: found for name, found in self.places(self.names).items() if len(found) != len(set(found))}

    def silence(self, names):
        """The longest time between a drive's last frame at one port and its first at the next, s."""
        return self.capture.silence([self.macs[name] for name in names])

    def close(self):
        try:
            if self.capture is not None:
                self.capture.close()
        finally:
            self.swarm.close()

    # -- the hub

    def ask(self, path, method="GET", body=None):
        text = "" if body is None else json.dumps(body)
        status, answer = json.loads(self.swarm.hub("python", "-c", ASK, method, path, text))
        assert status < 400, f"{status}: {answer}"
        return json.loads(answer)

    def drives(self):
        return {drive["name"]: drive for drive in self.ask("drives")["drives"]}

    def working(self):
        """Names of the drives that exchange data and are in operation."""
        return [name for name, drive in self.drives().items() if drive["connected"] and drive["state"] == "S4"]

    def all_work(self):
        return self.working() == self.names

    def param(self, drive, name, value=None):
        words = ("get", drive, name) if value is None else ("set", drive, name, str(value))
        return json.loads(self.swarm.hub("pnfarm", "param", *words, "--format", "json"))["value"]

    # -- where what runs

    def shards(self):
        """The shard's number -> its node, of the containers that run."""
        found = {}
        for node in self.swarm.nodes:
            for container in node.containers("pnfarm_farm") if node.alive else ():
                said = node.docker("inspect", "-f", "{{json .Config.Env}}", container)
                found[int(re.search(r"PNFARM_UP_SHARD=(\d+)/", said)[1])] = node
        return found

    def names_of(self, shard):
        """Equal drives are dealt out in turn."""
        return self.names[shard - 1 :: SHARDS]

    def node_of_hub(self):
        return next(node for node in self.swarm.nodes if node.alive and node.containers("pnfarm_hub"))

    def state_of(self, node):
        said = self.swarm.manager.docker("node", "inspect", "-f", "{{.Status.State}}", self.swarm.ids[node.number])
        return said.strip()


def made_stack():
    """A stack that was deployed, gone at the end; as a generator, for fixtures."""
    if reason := why_not():
        pytest.skip(reason)
    given = os.environ.get("PNFARM_RIG")
    images = Engine(Path(given or tempfile.mkdtemp(prefix="pnfarm-rig-")))
    # paths of unix sockets are short: not under pytest's own folder
    stack = Stack(Path(tempfile.mkdtemp(prefix="pnfarm-sw-")), images.folder)
    try:
        if given is None:
            images.prepare()
        else:
            said = (images.folder / BUILT).read_text("utf-8")
            assert not said, said
        stack.up()
        yield stack
    finally:
        stack.close()
        if given is None:
            images.close()
