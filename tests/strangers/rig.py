"""A farm and a hub by TLS with tokens and audit logs, their controller, and what is measured of them."""

from __future__ import annotations

import http.client
import json
import ssl
import subprocess
import sys
import threading
import time
from collections import Counter
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

from pnfarm.api.access.audit_check import check_audit
from pnfarm.api.access.authority import make_certificate
from pnfarm.vocabulary.trust import client_context
from tests.soak.side import ROOT, Side, SoakError
from tests.strangers.attacks import tokens_of

__all__ = ["PORTS", "Floor", "Honest", "Rig"]

PORTS = {"farm": 8702, "hub": 8703}
LATENESS = "pnfarm_engine_lateness_seconds_bucket"
FARM = """\
farm: strangers
link: {{kind: veth}}
api: 127.0.0.1:{port}
realtime: {{fifo: {fifo}}}
drives:
  - {{name: "akd-{{n:02}}", count: {drives}, model: akd-profinet, ip: 10.77.0.11/23}}
controller:
  name: plc
  ip: 10.77.0.1/23
  cycle: 16ms
  watchdog_factor: 16
  program: {{kind: constant, speed_rpm: 60, acknowledge_after: 200ms}}
"""
START_SECONDS, ANSWER_SECONDS = 300.0, 30.0


class Floor:
    """A minimal loop in a process of its own (:mod:`tests.strangers.floor`)."""

    def __init__(self, fifo: int) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.strangers.floor", str(fifo)],
            cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip

    def passed(self, name: str) -> None:
        """A time of this name has just passed; of an empty name, which is not looked at, too."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{name}\n")
        self._process.stdin.flush()

    def close(self) -> dict[str, float]:
        """The p99 of each time, s."""
        said, _ = self._process.communicate(timeout=ANSWER_SECONDS)
        return dict(json.loads(said))


class Rig:
    """Made by :meth:`open`; ``secrets``: those of the tokens by name."""

    def __init__(self, folder: Path, drives: int, fifo: int) -> None:
        self._folder, self._drives, self._fifo = folder, drives, fifo
        self._stack = ExitStack()
        self.sides: dict[str, Side] = {}
        self.audits = {name: folder / f"{name}-audit.jsonl" for name in PORTS}
        made = make_certificate(folder / "tls", [], 30)
        self.authority = made.authority
        self.context = client_context(made.authority)
        self._served = ("--tls-cert", made.certificate, "--tls-key", made.key)
        self._tokens = folder / "tokens"
        self.secrets = tokens_of(self._tokens)

    def open(self) -> None:
        """Start all, and wait until every drive is in operation."""
        file = self._folder / "strangers.pnfarm.yml"
        file.write_text(FARM.format(port=PORTS["farm"], drives=self._drives, fifo=self._fifo))
        served = [*self._served, "--tokens", self._tokens]
        self._start("farm", "up", file, *served, "--audit", self.audits["farm"])
        self._wait("the farm is up", lambda: self.ask("farm", "GET", "/api/v1/readyz")[0] == 200)
        farm = f"https://127.0.0.1:{PORTS['farm']}"
        hub = ["--shard", farm, "--tls-ca", self.authority, "--shard-token", self.secrets["boss"]]
        self._start("hub", "hub", "--api", f"127.0.0.1:{PORTS['hub']}", *hub, *served, "--audit", self.audits["hub"])
        self._start("controller", "plc", file, "--format", "json")
        self._wait("every drive is in operation", lambda: self.back() == self._drives)

    def _start(self, name: str, *arguments: str | Path) -> None:
        self.sides[name] = Side(name, self._folder, *arguments)
        self._stack.callback(self.sides[name].stop)

    def _wait(self, what: str, condition: Any) -> None:
        end = time.monotonic() + START_SECONDS
        while True:
            with suppress(OSError, http.client.HTTPException):
                if condition():
                    return
            if self.ended() or time.monotonic() > end:
                raise SoakError(f"not within {START_SECONDS:g} s: {what}; ended: {self.ended()}")
            time.sleep(0.5)

    def ask(self, server: str, method: str, path: str, body: Any = None, who: str = "boss") -> tuple[int, bytes]:
        """Status and body of the answer to somebody who may ask; raises what :mod:`http.client` raises."""
        link = http.client.HTTPSConnection("127.0.0.1", PORTS[server], timeout=ANSWER_SECONDS, context=self.context)
        try:
            headers = {"Authorization": f"Bearer {self.secrets[who]}", "Content-Type": "application/json"}
            link.request(method, path, None if body is None else json.dumps(body), headers)
            answer = link.getresponse()
            return answer.status, answer.read()
        finally:
            link.close()

    def drives(self) -> list[dict[str, Any]]:
        """The farm's drives."""
        return list(json.loads(self.ask("farm", "GET", "/api/v1/drives")[1])["drives"])

    def back(self) -> int:
        """How many drives are in operation."""
        return sum(drive["state"] == "S4" and drive["fault"] is None for drive in self.drives())

    def connects(self) -> int:
        """Connections of all drives since the start."""
        return sum(drive["connects"] for drive in self.drives())

    def losses(self) -> list[str]:
        """What the farm says of connections that were lost, and when processes did not run since it was asked."""
        drives = self.drives()
        reasons = sum((Counter(drive["aborts"]) for drive in drives), Counter())
        expired, by_farm = (sum(drive[f"watchdog_expirations{of}"] for drive in drives) for of in ("", "_by_farm"))
        said = [f"aborts {dict(reasons)}, watchdogs expired {expired}, by the farm's lateness {by_farm}"]
        for name, side in self.sides.items():
            said += [f"the {name}'s {what} did not run for {length:.2f} s" for what, _, length in side.stood()]
        lines = [line for line in self.sides["farm"].log.last if "watchdog expired" in line or "ar aborted" in line]
        return [*said, *lines[-4:]]

    def late(self) -> dict[float, float]:
        """How many ticks of the engine began at most so late, by seconds."""
        lines = self.ask("farm", "GET", "/metrics")[1].decode().splitlines()
        found = [line.rpartition(" ") for line in lines if line.startswith(LATENESS)]
        return {float(name.partition('le="')[2].partition('"')[0]): float(value) for name, _, value in found}

    def held(self) -> dict[str, dict[str, int]]:
        """Resident memory (kB), files and threads of farm and hub."""
        found = {}
        for name in PORTS:
            process = Path(f"/proc/{self.sides[name].process.pid}")
            status = dict(line.split(":", 1) for line in (process / "status").read_text().splitlines())
            files = len(list((process / "fd").iterdir()))
            threads, memory = int(status["Threads"]), int(status["VmRSS"].split()[0])
            found[name] = {"memory": memory, "files": files, "threads": threads}
        return found

    def ended(self) -> list[str]:
        """The programs that ended, which none should."""
        return [name for name, side in self.sides.items() if side.process.poll() is not None]

    def changes(self) -> list[str]:
        """Requests in the audit logs that were answered well and are not the honest client's, and what is wrong with
        a log."""
        found = []
        for name, file in self.audits.items():
            checked = check_audit(file)
            found += [f"{name}: {sentence}" for sentence in checked.wrong]
            records = [json.loads(line) for line in file.read_text().splitlines()]
            well = {one["of"] for one in records if one["record"] == "answer" and one["status"] < 300}
            found += [
                f"{name}: {one['method']} {one['path']} by {one['token']}"
                for one in records
                if one["record"] == "request" and one["sequence"] in well and one["query"] != Honest.QUERY
            ]
        return found

    def close(self) -> dict[str, int | None]:
        """End all; their exit codes."""
        codes = {name: side.stop() for name, side in reversed(self.sides.items())}
        self._stack.close()
        return codes


class Honest(threading.Thread):
    """Asks both servers each second, and tries a fault without carrying it out."""

    QUERY = "dry_run=true"

    def __init__(self, rig: Rig) -> None:
        super().__init__(daemon=True, name="honest")
        self._rig = rig
        self._ended = threading.Event()
        self.took: list[float] = []
        self.failed: list[str] = []

    def run(self) -> None:
        fault = {"kind": "silence", "on": "akd-01"}
        while not self._ended.wait(1.0):
            for server in PORTS:
                for method, path, body in (
                    ("GET", "/api/v1/drives", None),
                    ("POST", f"/api/v1/faults?{self.QUERY}", fault),
                ):
                    begun = time.monotonic()
                    try:
                        status, answer = self._rig.ask(server, method, path, body, "ci")
                    except (OSError, ssl.SSLError, http.client.HTTPException) as exc:
                        self.failed.append(f"{server} {method}: {type(exc).__name__}: {exc}")
                        continue
                    if status == 200:
                        self.took.append(time.monotonic() - begun)
                    else:
                        self.failed.append(f"{server} {method}: {status} {answer[:200]!r}")

    def stop(self) -> None:
        """End it."""
        self._ended.set()
        self.join(4 * ANSWER_SECONDS)
