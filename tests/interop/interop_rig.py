"""The rig of the interop tests: two joined namespaces, a farm in one, peers and captures in the other."""

import contextlib
import json
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
import wireshark
from forks import Fork, run_fork
from wireshark import tshark

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
CAPTURES = ROOT.parent / "shared" / "captures"
START_SECONDS = 60.0
#: The programs of this folder import the project from where it stands.
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT)}


class CannotRunError(Exception):
    """This machine has not what the rig needs; the text says what."""


class Lab:
    """Two namespaces with a cable between them, gone with this object or with the process that made it."""

    def __init__(self):
        self._holder = subprocess.Popen(
            [sys.executable, str(HERE / "interop_anchor.py")],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=ENVIRONMENT,
        )
        line = self._holder.stdout.readline()
        told = json.loads(line) if line else {"cannot": self._holder.stderr.read().strip().splitlines()[-1]}
        if "cannot" in told:
            self.close()
            raise CannotRunError(told["cannot"])
        self._pids = told

    def close(self):
        self._holder.stdin.close()
        self._holder.wait(10)
        self._holder.stdout.close()
        self._holder.stderr.close()

    def command(self, where, *arguments):
        """The command line that runs ``arguments`` in namespace ``farm`` or ``peer``."""
        return [sys.executable, str(HERE / "interop_enter.py"), str(self._pids[where]), *map(str, arguments)]

    def run(self, where, *arguments, timeout=30, check=True, **options):
        """Runs to the end; the finished process with its text."""
        done = subprocess.run(
            self.command(where, *arguments),
            capture_output=True,
            text=True,
            timeout=timeout,
            check=False,
            env=ENVIRONMENT,
            **options,
        )
        assert not check or done.returncode == 0, f"{arguments}: {done.stdout}\n{done.stderr}"
        return done

    def start(self, where, *arguments, **options):
        return subprocess.Popen(self.command(where, *arguments), env=ENVIRONMENT, **options)

    def fork(self, where, script, *arguments):
        """A script of this project's that needs no start, since its imports are there."""
        return Fork(
            script, *arguments, env=ENVIRONMENT, namespaces=self._pids[where],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip

    def peer_json(self, script, *arguments, timeout=60):
        """A peer's program of this folder; the JSON of its last line."""
        done = run_fork(HERE / script, *arguments, timeout=timeout, env=ENVIRONMENT, namespaces=self._pids["peer"])
        assert done.returncode == 0, f"{script} {arguments}: {done.stdout}\n{done.stderr}"
        return json.loads(done.stdout.strip().splitlines()[-1])


class Worker:
    """A farm or a controller in its namespace; ``ask`` a verb of :mod:`interop_worker`."""

    def __init__(self, lab, where, kind, path):
        self._process = lab.fork(where, HERE / "interop_worker.py", kind, path)
        self._lines = queue.Queue()
        self._complaints = []
        self._readers = [
            threading.Thread(target=self._read_answers, daemon=True),
            threading.Thread(target=self._read_complaints, daemon=True),
        ]
        for thread in self._readers:
            thread.start()
        self._answer(START_SECONDS)

    def _read_answers(self):
        for line in self._process.stdout:
            self._lines.put(line)
        self._lines.put(None)

    def _read_complaints(self):
        self._complaints.extend(self._process.stderr)

    @property
    def complaints(self):
        return "".join(self._complaints)

    def _answer(self, seconds):
        line = self._lines.get(timeout=seconds)
        if line is None:
            self._process.wait(5)
            raise AssertionError(f"the {self._process.args} ended by itself:\n{self.complaints}")
        answer = json.loads(line)
        if "error" in answer:
            raise AssertionError(f"{answer['error']}\n{self.complaints}")
        return answer["ok"]

    def ask(self, verb, /, patience=40.0, **arguments):
        self._process.stdin.write(json.dumps({"do": verb, **arguments}) + "\n")
        self._process.stdin.flush()
        return self._answer(patience)

    def until(self, condition, what, seconds=10.0, **arguments):
        """Asks until ``condition`` of the answer holds; the answer."""
        end = time.monotonic() + seconds
        while True:
            answer = self.ask(what, **arguments)
            if condition(answer):
                return answer
            assert time.monotonic() < end, f"{what} {arguments} stayed {answer}"
            time.sleep(0.02)

    @contextlib.contextmanager
    def stopped(self):
        """As if somebody pulled the processor's plug for a while."""
        self._process.send_signal(signal.SIGSTOP)
        try:
            yield
        finally:
            self._process.send_signal(signal.SIGCONT)

    def close(self):
        self._process.stdin.close()
        try:
            code = self._process.wait(20)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            raise
        finally:
            for thread in self._readers:
                thread.join(5)
            self._process.stdout.close()
            self._process.stderr.close()
        assert code == 0, f"the worker ended with {code}:\n{self.complaints}"


FARM = """
farm: {name}
link: {{kind: macvlan, parent: nic0}}
api: off
drives:
{drives}
{rest}
"""


@contextlib.contextmanager
def running(lab, folder, drives, *, rest="", kind="farm", where="farm", name="interop"):
    """A worker with a farm file of these drives (lines of YAML); ended in good order."""
    path = folder / f"{name}-{kind}.pnfarm.yml"
    path.write_text(FARM.format(name=name, drives="\n".join(f"  - {d}" for d in drives), rest=rest), encoding="utf-8")
    worker = Worker(lab, where, kind, path)
    try:
        yield worker
    except BaseException:
        with contextlib.suppress(Exception):  # what went wrong first is the story to tell
            worker.close()
        raise
    worker.close()


class Capture:
    """All frames at the peer's end of the cable, in a file, while the context lasts."""

    def __init__(self, lab, path):
        self._lab = lab
        self.path = path

    def __enter__(self):
        self._process = self._lab.start(
            "peer",
            "dumpcap", "-q", "-i", "plc0", "-B", "16", "-w", self.path,
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        # dumpcap says on which file it writes once it has its socket
        for line in self._process.stderr:
            if line.startswith("File:"):
                break
        else:
            raise AssertionError("dumpcap ended at once")
        return self

    def __exit__(self, *_):
        time.sleep(0.3)
        self._process.send_signal(signal.SIGINT)
        self._process.communicate(timeout=20)

    def fields(self, *names, where="", options=()):
        """Rows of tshark's fields, each a list with one text per name; ``where`` is a display filter."""
        return tshark_fields(self.path, *names, where=where, options=options)


#: Checksums count too; a frame's sequence analysis by another host's stack is not ours to judge.
STRICT = ("-o", "ip.check_checksum:TRUE", "-o", "udp.check_checksum:TRUE")


def tshark_fields(path, *names, where="", options=()):
    return wireshark.tshark_fields(path, *names, where=where, options=(*STRICT, *options))


def tshark_tree(path, number):
    """One frame in full, for a failing test's message."""
    return tshark(path, *STRICT, "-V", "-x", "-Y", f"frame.number=={number}")


def tshark_words(path, where):
    """The whole trees of some frames, as one text."""
    return tshark(path, *STRICT, "-V", "-Y", where)


def captured_datagrams(name):
    """(source ip, destination ip, UDP payload) of a captured start-up's DCE/RPC datagrams, in order."""
    path = CAPTURES / f"{name}.pcap"
    if not path.exists():
        pytest.skip(f"the captures of real controllers are not here: no {path.name} beside the project")
    rows = tshark_fields(path, "ip.src", "ip.dst", "udp.payload", where="udp && dcerpc")
    return [(source, destination, bytes.fromhex(payload)) for source, destination, payload in rows]
