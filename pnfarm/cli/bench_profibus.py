"""``pnfarm bench profibus-32``: 32 drives on one pty, polled at the cycle that 1.5 Mbit/s would permit, beside an echo.

``python -m pnfarm.cli.bench_profibus poll`` is the master: it writes its telegrams octet by octet, and waits for each
answer.  ``... echo`` is the floor: a loop that answers every request with the same octets.  Both read one JSON line of
settings and answer with one.
"""

from __future__ import annotations

import json
import os
import resource
import select
import subprocess
import sys
import tempfile
import time
import tty
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from pnfarm.cli.bench_line import FARM_CPU, PEER_CPU, Child, Result
from pnfarm.errors import InternalError

__all__ = ["profibus_32"]

DRIVES, FIRST, BAUD = 32, 3, 1_500_000
MODEL, TELEGRAM = "moog-msd-dp", 1
MASTER = 2
#: Bits of an octet; from a request to its answer, and from an answer to the next request, at least.
OCTET_BITS, LEAST_TSDR_BITS, SYN_BITS = 11, 11, 33
#: An answer that has not come by then is missed.
PATIENCE_SECONDS = 0.1
SRD_HIGH, FCV, FCB = 0x4D, 0x10, 0x20

FILE = """
farm: bench
link: {{kind: serial, pty: '{path}', baud: {baud}}}
api: off
realtime: {{cpu: {cpu}}}
drives:
  - name: axis-{{n:02}}
    count: {drives}
    model: {model}
    address: {first}
"""


def _telegram(address: int, function: int, data: bytes, saps: bytes = b"") -> bytes:
    """SD1 or SD2."""
    extended = 0x80 if saps else 0
    body = bytes((address | extended, MASTER | extended, function)) + saps + data
    end = bytes((sum(body) & 0xFF, 0x16))
    if len(body) == 3:
        return b"\x10" + body + end
    return bytes((0x68, len(body), len(body), 0x68)) + body + end


class _Line:
    """The far end of a pty."""

    def __init__(self, path: str) -> None:
        self._fd = os.open(path, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self._fd)

    def ask(self, request: bytes, octets: int) -> bytes | None:
        """The answer of so many octets, None where it does not come; one octet: a short acknowledgement."""
        os.write(self._fd, request)
        found = b""
        while len(found) < octets:
            ready, _, _ = select.select([self._fd], [], [], PATIENCE_SECONDS)
            if not ready:
                return None
            found += os.read(self._fd, 255)
        return found


def _poll(settings: dict[str, Any]) -> dict[str, Any]:
    line = _Line(settings["path"])
    addresses = range(FIRST, FIRST + DRIVES)
    identifiers, ident = bytes.fromhex(settings["identifiers"]), settings["ident"]
    request, answer = settings["request"], settings["answer"]
    if not settings["echo"]:
        parameters = bytes((0x80, 1, 1, LEAST_TSDR_BITS)) + ident.to_bytes(2, "big") + bytes((0, 0x80, 0, 0))
        for address in addresses:
            for step, (sap, data) in enumerate(((61, parameters), (62, identifiers))):
                function = SRD_HIGH | FCB if step == 0 else SRD_HIGH | FCV
                if line.ask(_telegram(address, function | 0x40, data, bytes((sap, 62))), 1) != b"\xe5":
                    raise InternalError(f"slave {address} does not acknowledge SAP {sap}")
    polls = [[_telegram(a, SRD_HIGH | FCV | fcb, bytes(request)) for a in addresses] for fcb in (FCB, 0)]
    octets = answer + 9
    bits = (len(polls[0][0]) + octets) * OCTET_BITS + LEAST_TSDR_BITS + SYN_BITS
    slot_ns = bits * 1_000_000_000 // BAUD
    sys.stdout.write('{"ready": true}\n')
    sys.stdout.flush()
    sys.stdin.readline()
    times: list[int] = []
    missed = 0
    begin = time.monotonic_ns()
    end, due, cycles = begin + round(settings["seconds"] * 1e9), begin, 0
    while due < end:
        for poll in polls[cycles & 1]:
            while (now := time.monotonic_ns()) < due:
                pass
            if line.ask(poll, octets) is None:
                missed += 1
            times.append(time.monotonic_ns() - now)
            due = max(due + slot_ns, time.monotonic_ns())
        cycles += 1
    took = time.monotonic_ns() - begin
    times.sort()
    return {
        "p50": times[len(times) // 2] / 1000, "p99": times[len(times) * 99 // 100] / 1000, "missed": missed,
        "cycle_ms": took / cycles / 1e6, "bus_cycle_ms": slot_ns * DRIVES / 1e6,
    }  # fmt: skip


def _echo(settings: dict[str, Any]) -> dict[str, Any]:
    near, far = os.openpty()
    tty.setraw(far)
    Path(settings["path"]).symlink_to(os.ttyname(far))
    sys.stdout.write('{"ready": true}\n')
    sys.stdout.flush()
    answer = _telegram(MASTER, 0x08, bytes(settings["answer"]))
    poller = select.poll()
    poller.register(near, select.POLLIN)
    poller.register(sys.stdin, select.POLLIN)
    start, began = time.monotonic(), resource.getrusage(resource.RUSAGE_SELF)
    while all(fd == near for fd, _ in poller.poll()):
        os.read(near, 255)
        os.write(near, answer)
    used = resource.getrusage(resource.RUSAGE_SELF)
    cpu = used.ru_utime + used.ru_stime - began.ru_utime - began.ru_stime
    return {"cpu": cpu, "wall": time.monotonic() - start}


class _Role:
    """This module as a process."""

    def __init__(self, role: str, cpu: int, **settings: Any) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "pnfarm.cli.bench_profibus", role],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        self.say(json.dumps({"cpu": cpu, **settings}))
        self.answer()

    def say(self, line: str) -> None:
        if self._process.stdin is not None:
            self._process.stdin.write(line + "\n")
            self._process.stdin.flush()

    def answer(self) -> dict[str, Any]:
        line = self._process.stdout.readline() if self._process.stdout else ""
        if not line:
            raise InternalError(f"a benchmark's process ended with code {self._process.wait()}")
        found: dict[str, Any] = json.loads(line)
        return found

    def close(self) -> None:
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                stream.close()
        self._process.kill()
        self._process.wait()


def _telegram_of_model() -> dict[str, Any]:
    from pnfarm.drives.catalogue import model

    described = model(MODEL).profidrive
    telegram = described.telegrams[TELEGRAM]
    return {
        "identifiers": telegram.identifiers.hex(), "ident": described.identity.device_id,
        "request": 2 * len(telegram.output), "answer": 2 * len(telegram.input),
    }  # fmt: skip


def _floor(folder: Path, facts: dict[str, Any], seconds: float) -> tuple[dict[str, Any], float]:
    """What the poller saw of the echo, and the echo's cores."""
    path = str(folder / "echo")
    with ExitStack() as stack:
        echo = _Role("echo", FARM_CPU, path=path, **facts)
        stack.callback(echo.close)
        poller = _Role("poll", PEER_CPU, path=path, echo=True, seconds=seconds, **facts)
        stack.callback(poller.close)
        poller.say("go")
        seen = poller.answer()
        echo.say("enough")
        cost = echo.answer()
    return seen, cost["cpu"] / cost["wall"]


def _farm(folder: Path, facts: dict[str, Any], seconds: float) -> tuple[dict[str, Any], float]:
    """What the poller saw of the drives, and the farm's cores."""
    path = str(folder / "line")
    with ExitStack() as stack:
        text = FILE.format(path=path, baud=BAUD, cpu=FARM_CPU, drives=DRIVES, model=MODEL, first=FIRST)
        farm = Child("farm", FARM_CPU, file=text)
        stack.callback(farm.close)
        farm.answer()
        time.sleep(1.0)  # the drives boot
        poller = _Role("poll", PEER_CPU, path=path, echo=False, seconds=seconds, **facts)
        stack.callback(poller.close)
        farm.ask(f"measure {seconds}")
        poller.say("go")
        seen, cost = poller.answer(), farm.answer()
    return seen, cost["cpu"] / cost["wall"]


def profibus_32(seconds: float) -> list[Result]:
    """32 drives on one pty at the bus's own cycle for 1.5 Mbit/s."""
    facts = _telegram_of_model()
    with tempfile.TemporaryDirectory(prefix="pnfarm-bench-") as name:
        low, low_core = _floor(Path(name), facts, min(10.0, seconds))
        seen, core = _farm(Path(name), facts, seconds)
    p99, cycle, wanted = seen["p99"], seen["cycle_ms"], seen["bus_cycle_ms"]
    late = cycle / wanted
    return [
        Result("profibus-32-cpu", core, "cores", core / low_core, "< 0.3", core < 0.3),
        Result("profibus-32-reply-p50", seen["p50"], "us, there and back", seen["p50"] / low["p50"], "none", True),
        Result("profibus-32-reply-p99", p99, "us, there and back", p99 / low["p99"], "<= 1000", p99 <= 1000),
        Result("profibus-32-cycle", cycle, f"ms; the bus: {wanted:.3g}", None, "<= 1.1 of the bus", late <= 1.1),
        Result("profibus-32-missed", seen["missed"], f"answers in {seconds:g} s", None, "0", seen["missed"] == 0),
        Result("profibus-32-floor-p50", low["p50"], "us, there and back", 1.0, "none", True),
        Result("profibus-32-floor-p99", low["p99"], "us, there and back", 1.0, "none", True),
        Result("profibus-32-floor-cpu", low_core, "cores", 1.0, "none", True),
    ]


def main() -> None:
    """See the module's head."""
    settings = json.loads(sys.stdin.readline())
    os.sched_setaffinity(0, {settings["cpu"]})
    found = _poll(settings) if sys.argv[1] == "poll" else _echo(settings)
    sys.stdout.write(json.dumps(found) + "\n")


if __name__ == "__main__":
    main()
