"""``pnfarm bench profibus-32``: 32 drives on one pty, polled at the cycle that 1.5 Mbit/s would permit, beside an echo.

``python -m pnfarm.bench.profibus poll`` is the master: it writes its telegrams octet by octet, and waits for each
answer.  ``... echo`` is the floor: a loop that answers every request with the same octets.  Both read one JSON line of
settings, and answer each line that follows: the master with what it measured meanwhile, the echo with its time.
"""

from __future__ import annotations

import json
import os
import select
import sys
import tempfile
import termios
import time
import tty
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pnfarm.bench.child import cpu_seconds, difference, say
from pnfarm.bench.line import FARM_CPU, PEER_CPU, begun, cores
from pnfarm.bench.result import WINDOWS, Result, Windows
from pnfarm.errors import InternalError

if TYPE_CHECKING:
    from pnfarm.bench.load import Load

__all__ = ["profibus_32"]

DRIVES, FIRST, BAUD = 32, 3, 1_500_000
MODEL, TELEGRAM = "moog-msd-dp", 1
MASTER = 2
#: Bits of an octet; from a request to its answer, and from an answer to the next request, at least.
OCTET_BITS, LEAST_TSDR_BITS, SYN_BITS = 11, 11, 33
#: A request that has no answer by then is sent again (the master's slot time), so often.
SLOT_SECONDS, REPEATS = 0.002, 3
#: Nothing is measured in a start-up: a machine that others use may take its time.
START_TRIES = 200
#: In the first cycles of a machine that has rested answers are late.
LEAST_CYCLES = 20
SRD_HIGH, FDL_STATUS, FCV, FCB = 0x4D, 0x49, 0x10, 0x20

FILE = """
farm: bench
link: {{kind: serial, pty: '{path}', baud: {baud}, latest_answer: {latest}}}
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

    def ask(self, request: bytes, octets: int) -> tuple[bytes | None, int]:
        """The answer of so many octets, and how often the request was repeated; None where none came.

        One octet: a short acknowledgement.
        """
        for repeats in range(REPEATS + 1):
            os.write(self._fd, request)
            found = b""
            while len(found) < octets:
                ready, _, _ = select.select([self._fd], [], [], SLOT_SECONDS)
                if not ready:
                    break
                found += os.read(self._fd, 255)
            if len(found) >= octets:
                return found, repeats
            self.forget()
        return None, REPEATS

    def forget(self) -> None:
        """What comes late is no answer to the next request."""
        termios.tcflush(self._fd, termios.TCIFLUSH)


def _start_up(line: _Line, address: int, parameters: bytes, identifiers: bytes) -> None:
    """Set_Prm and Chk_Cfg, again where an answer that came late was taken for the next one's."""
    steps = (61, SRD_HIGH | FCB | 0x40, parameters), (62, SRD_HIGH | FCV | 0x40, identifiers)
    for _ in range(START_TRIES):
        line.forget()
        answers = [line.ask(_telegram(address, code, data, bytes((sap, 62))), 1)[0] for sap, code, data in steps]
        if answers == [b"\xe5", b"\xe5"]:
            return
        time.sleep(0.01)  # an answer that is still on its way comes before the next try
    raise InternalError(f"slave {address} does not acknowledge Set_Prm and Chk_Cfg")


def _poll(settings: dict[str, Any]) -> None:
    line = _Line(settings["path"])
    addresses = range(FIRST, FIRST + DRIVES)
    identifiers, ident = bytes.fromhex(settings["identifiers"]), settings["ident"]
    request, answer = settings["request"], settings["answer"]
    if not settings["echo"]:
        # by the first telegram the slaves find the rate
        line.ask(_telegram(FIRST, FDL_STATUS, b""), 6)
        time.sleep(0.1)  # 32 slaves report it, one after the other
        line.forget()
        parameters = bytes((0x80, 1, 1, LEAST_TSDR_BITS)) + ident.to_bytes(2, "big") + bytes((0, 0x80, 0, 0))
        for address in addresses:
            _start_up(line, address, parameters, identifiers)
    polls = [[_telegram(a, SRD_HIGH | FCV | fcb, bytes(request)) for a in addresses] for fcb in (FCB, 0)]
    octets = answer + 9
    bits = (len(polls[0][0]) + octets) * OCTET_BITS + LEAST_TSDR_BITS + SYN_BITS
    slot_ns = bits * 1_000_000_000 // BAUD
    say({"ready": True})
    while sys.stdin.readline():
        times: list[int] = []
        missed = repeated = 0
        begin = time.monotonic_ns()
        end, due, cycles = begin + round(settings["seconds"] * 1e9), begin, 0
        while due < end or cycles < LEAST_CYCLES:
            for poll in polls[cycles & 1]:
                while (now := time.monotonic_ns()) < due:
                    pass
                found, repeats = line.ask(poll, octets)
                missed += found is None
                repeated += repeats
                if not repeats:
                    times.append(time.monotonic_ns() - now)
                due = max(due + slot_ns, time.monotonic_ns())
            cycles += 1
        took = time.monotonic_ns() - begin
        if not times:
            raise InternalError("no poll was answered")
        times.sort()
        p50, p99 = times[len(times) // 2] / 1000, times[len(times) * 99 // 100] / 1000
        cycle = {"cycle_ms": took / cycles / 1e6, "bus_cycle_ms": slot_ns * DRIVES / 1e6}
        counts = {"polls": cycles * len(addresses), "repeated": repeated, "missed": missed}
        say({"p50": p50, "p99": p99, **cycle, **counts})


def _echo(settings: dict[str, Any]) -> None:
    near, far = os.openpty()
    tty.setraw(far)
    Path(settings["path"]).symlink_to(os.ttyname(far))
    say({"ready": True})
    answer = _telegram(MASTER, 0x08, bytes(settings["answer"]))
    poller = select.poll()
    poller.register(near, select.POLLIN)
    poller.register(sys.stdin, select.POLLIN)
    while True:
        for fd, _ in poller.poll():
            if fd == near:
                os.read(near, 255)
                os.write(near, answer)
            elif sys.stdin.readline():
                say({"cpu": cpu_seconds(), "wall": time.monotonic()})
            else:
                return


def _telegram_of_model() -> dict[str, Any]:
    from pnfarm.drives.catalogue import model

    described = model(MODEL).profidrive
    telegram = described.telegrams[TELEGRAM]
    return {
        "identifiers": telegram.identifiers.hex(), "ident": described.identity.device_id,
        "request": 2 * len(telegram.output), "answer": 2 * len(telegram.input),
    }  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Seen:
    """What the poller saw in each window, and the cores of who answered."""

    polls: list[dict[str, Any]]
    used: list[dict[str, Any]]

    def each(self, key: str) -> Windows:
        return Windows(float(poll[key]) for poll in self.polls)

    def __add__(self, other: _Seen) -> _Seen:
        return _Seen(self.polls + other.polls, self.used + other.used)


def _floor(folder: Path, facts: dict[str, Any], seconds: float, load: Load) -> _Seen:
    """The poller at the echo."""
    windows = WINDOWS // 2
    path = str(folder / "echo")
    polls, used = [], []
    with ExitStack() as stack:
        echo = begun(stack, "echo", FARM_CPU, module=__name__, path=path, **facts)
        poller = begun(
            stack, "poll", PEER_CPU, module=__name__, path=path, echo=True, seconds=seconds / windows, **facts
        )
        for _ in range(windows):
            with load:
                before = echo.told("mark")
                polls.append(poller.told("go"))
                used.append(difference(before, echo.told("mark")))
    Path(path).unlink()
    return _Seen(polls, used)


def _farm(
    folder: Path, facts: dict[str, Any], seconds: float, load: Load, *, latest: str = "auto", windows: int = WINDOWS
) -> _Seen:
    """The poller at the drives."""
    path = str(folder / "line")
    polls, used = [], []
    with ExitStack() as stack:
        text = FILE.format(path=path, baud=BAUD, cpu=FARM_CPU, drives=DRIVES, model=MODEL, first=FIRST, latest=latest)
        farm = begun(stack, "farm", FARM_CPU, file=text)
        time.sleep(1.0)  # the drives boot
        poller = begun(
            stack, "poll", PEER_CPU, module=__name__, path=path, echo=False, seconds=seconds / windows, **facts
        )
        for _ in range(windows):
            with load:
                farm.ask(f"measure {seconds / windows}")
                polls.append(poller.told("go"))
                used.append(farm.answer())
    return _Seen(polls, used)


def profibus_32(seconds: float, load: Load) -> list[Result]:
    """32 drives on one PROFIBUS line over a pty, polled at the cycle of 1.5 Mbit/s, beside an echo."""
    facts = _telegram_of_model()
    with tempfile.TemporaryDirectory(prefix="pnfarm-bench-") as name:
        low = _floor(Path(name), facts, min(5.0, seconds), load)
        seen = _farm(Path(name), facts, seconds, load)
        strict = _farm(Path(name), facts, min(5.0, seconds), load, latest="tsdr", windows=1).polls[0]
        low += _floor(Path(name), facts, min(5.0, seconds), load)
    used, echo = cores(seen.used), cores(low.used)
    p50, p99, cycle = seen.each("p50"), seen.each("p99"), seen.each("cycle_ms")
    low_p50, low_p99 = low.each("p50"), low.each("p99")
    wanted, missed = seen.polls[0]["bus_cycle_ms"], sum(poll["missed"] for poll in seen.polls)
    repeated = strict["repeated"] / strict["polls"]
    late, worst = cycle.median / wanted, p99.median
    way = "us, there and back"
    return [
        used.row("profibus-32-cpu", "cores", used.over(echo), "< 0.3", used.median < 0.3),
        p50.row("profibus-32-reply-p50", way, p50.over(low_p50)),
        p99.row("profibus-32-reply-p99", way, p99.over(low_p99), "<= 1000", worst <= 1000),
        cycle.row("profibus-32-cycle", f"ms; the bus: {wanted:.3g}", None, "<= 1.1 of the bus", late <= 1.1),
        Result("profibus-32-missed", missed, f"answers in {seconds:g} s", None, "0", missed == 0),
        Result("profibus-32-repeated", repeated * 100, "% of polls, with `latest_answer: tsdr`", None, "none", True),
        low_p50.row("profibus-32-floor-p50", way, 1.0),
        low_p99.row("profibus-32-floor-p99", way, 1.0),
        echo.row("profibus-32-floor-cpu", "cores", 1.0),
    ]


def main() -> None:
    """See the module's head."""
    settings = json.loads(sys.stdin.readline())
    os.sched_setaffinity(0, {settings["cpu"]})
    _poll(settings) if sys.argv[1] == "poll" else _echo(settings)


if __name__ == "__main__":
    main()
