"""``pnfarm bench``: what the farm costs, beside the floor of this machine, in one run.

Farms, controllers and the floor run as processes of their own: macvlans on one end of a veth pair in a private
network namespace, the other side's one interface in another.  The farm is pinned to one CPU, its peer to another.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from pnfarm.errors import ConfigError, InternalError

__all__ = ["BENCHMARKS", "FARM_CPU", "PARENT", "PEER", "PEER_CPU", "Child", "Result", "command", "percentile", "wire"]

FARM_CPU, PEER_CPU = 0, 1
PARENT, PEER = "pnbench0", "pnbench1"


@dataclass(frozen=True, slots=True)
class Result:
    """One figure.  ``ratio_to_floor`` is None where there is no floor; ``goal`` says what ``ok`` was held against."""

    name: str
    value: float
    unit: str
    ratio_to_floor: float | None
    goal: str
    ok: bool


FILE = """
farm: bench
link: {{kind: macvlan, parent: {parent}}}
api: off
realtime: {{cpu: {cpu}}}
drives:
  - name: axis-{{n:04}}
    count: {drives}
    model: akd-profinet
    ip: 10.64.0.11/16
    limits: lax
controller:
  name: plc
  ip: 10.64.255.250/16
  interface: {peer}
  cycle: {cycle}
  watchdog_factor: {watchdog}
  program: {{kind: sine, speed_rpm: 600, period: 4s, acknowledge_after: 100ms}}
"""


def _file(drives: int, cycle: str, watchdog: int, cpu: int) -> str:
    return FILE.format(parent=PARENT, peer=PEER, drives=drives, cycle=cycle, watchdog=watchdog, cpu=cpu)


class Child:
    """A process of :mod:`pnfarm.cli.bench_child`."""

    def __init__(self, role: str, cpu: int, **settings: Any) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "pnfarm.cli.bench_child", role],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self._write(json.dumps({"cpu": cpu, **settings}))
        interface = settings.get("interface_from_outside")
        if interface:
            pid = self.answer()["pid"]
            subprocess.run(["ip", "link", "set", str(interface), "netns", str(pid)], check=True)
            self._write("go")

    def _write(self, line: str) -> None:
        if self._process.stdin is None:
            raise InternalError("the benchmark's process has no standard input")
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()

    def ask(self, command: str) -> None:
        """Give a command; the answer is read later."""
        self._write(command)

    def answer(self) -> dict[str, Any]:
        line = self._process.stdout.readline() if self._process.stdout else ""
        if not line:
            raise InternalError(f"a benchmark's process ended with code {self._process.wait()}")
        answer: dict[str, Any] = json.loads(line)
        return answer

    def close(self) -> None:
        if self._process.stdin is not None:
            self._process.stdin.close()
        try:
            self._process.wait(timeout=20)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()


@contextmanager
def wire() -> Iterator[None]:
    """A veth pair in this namespace."""
    subprocess.run(["ip", "link", "add", "name", PARENT, "type", "veth", "peer", "name", PEER], check=True)
    try:
        for name in (PARENT, PEER):
            subprocess.run(["ip", "link", "set", name, "up"], check=True)
        yield
    finally:
        # the pair is gone already when its other end went with a peer's namespace
        subprocess.run(["ip", "link", "del", PARENT], check=False, stderr=subprocess.DEVNULL)


@contextmanager
def _line(drives: int, cycle: str, watchdog: int) -> Iterator[tuple[Child, Child]]:
    """A farm and the built-in controller, connected."""
    with wire(), ExitStack() as stack:
        farm = Child("farm", FARM_CPU, file=_file(drives, cycle, watchdog, FARM_CPU))
        stack.callback(farm.close)
        farm.answer()
        plc = Child("plc", PEER_CPU, file=_file(drives, cycle, watchdog, PEER_CPU), interface_from_outside=PEER)
        stack.callback(plc.close)
        plc.answer()
        plc.ask("connected 120")
        if not plc.answer()["connected"]:
            raise InternalError(f"{drives} drives did not connect within 120 s")
        # the start-up's own work (DCP, ARP, records) shall be over before anything is measured
        time.sleep(1.0)
        yield farm, plc


def _measure(farm: Child, peer: Child, seconds: float) -> tuple[dict[str, Any], dict[str, Any]]:
    farm.ask(f"measure {seconds}")
    peer.ask(f"measure {seconds}")
    return farm.answer(), peer.answer()


@contextmanager
def _floor(drives: int, groups: int, period_ns: int) -> Iterator[tuple[Child, Child]]:
    """Two minimal loops over the same kind of interfaces: macvlans on one side, one interface on the other."""
    with wire(), ExitStack() as stack:
        lines, macs = [], []
        for i in range(drives):
            mac = bytes((0x02, 0xF1, 0, 0, i >> 8, i & 0xFF))
            macs.append(mac)
            name = f"pnfl{i}"
            lines.append(f"link add link {PARENT} name {name} address {mac.hex(':')} type macvlan mode bridge")
            lines.append(f"link set {name} up")
        subprocess.run(["ip", "-batch", "-"], input="\n".join(lines), text=True, check=True)
        listed = subprocess.run(["ip", "-json", "link"], check=True, capture_output=True, text=True).stdout
        links = {entry["ifname"]: entry for entry in json.loads(listed)}
        index = {name: entry["ifindex"] for name, entry in links.items()}
        peer_mac = bytes.fromhex(links[PEER]["address"].replace(":", ""))
        common = {"groups": groups, "period": period_ns}
        ours = [(index[f"pnfl{i}"], mac.hex(), peer_mac.hex()) for i, mac in enumerate(macs)]
        # an interface keeps its index when it moves into an empty namespace
        theirs = [(index[PEER], peer_mac.hex(), mac.hex()) for mac in macs]
        farm = Child("floor", FARM_CPU, addresses=ours, interface="", **common)
        stack.callback(farm.close)
        farm.answer()
        peer = Child("floor", PEER_CPU, addresses=theirs, interface=PEER, interface_from_outside=PEER, **common)
        stack.callback(peer.close)
        peer.answer()
        yield farm, peer


def percentile(histogram: list[int], share: float) -> float:
    """Microseconds, interpolated inside the bucket."""
    from pnfarm.table.engine_row import LATENESS_EDGES_NS

    wanted = sum(histogram) * share
    seen = 0.0
    lower = 0
    for count, upper in zip(histogram, (*LATENESS_EDGES_NS, 2 * LATENESS_EDGES_NS[-1]), strict=True):
        if count and seen + count >= wanted:
            return float(lower + (upper - lower) * (wanted - seen) / count) / 1000
        seen += count
        lower = upper
    return lower / 1000


def _per_frame(answer: dict[str, Any]) -> float:
    """Microseconds of CPU."""
    return float(answer["cpu"]) / max(1, int(answer["frames"])) * 1e6


def _settled_floor(drives: int, groups: int, period_ns: int, seconds: float) -> dict[str, Any]:
    with _floor(drives, groups, period_ns) as (farm, peer):
        return _measure(farm, peer, seconds)[0]


def frame_cost(seconds: float) -> list[Result]:
    """CPU of one cyclic frame at 192 drives and 1 ms."""
    floor = _per_frame(_settled_floor(192, 1, 1_000_000, seconds))
    with _line(192, "1ms", 64) as (farm, plc):
        answer, other = _measure(farm, plc, seconds)
    value = _per_frame(answer)
    again = _per_frame(_settled_floor(192, 1, 1_000_000, seconds))
    floor = (floor + again) / 2
    ratio = value / floor
    return [
        Result("frame-cost-192", value, "us of CPU per frame", ratio, "ratio <= 1.2", ratio <= 1.2),
        Result("frame-cost-192-floor", floor, "us of CPU per frame", 1.0, "none", True),
        Result("frame-cost-192-controller", _per_frame(other), "us of CPU per frame", None, "none", True),
    ]


def full_port(seconds: float) -> list[Result]:
    """148 drives at 1 ms, a full 100 Mbit/s port, for a minute."""
    floor = _settled_floor(148, 1, 1_000_000, min(20.0, seconds))
    floor_p99 = percentile(floor["lateness"], 0.99)
    with _line(148, "1ms", 64) as (farm, plc):
        answer, other = _measure(farm, plc, seconds)
    p99 = percentile(answer["lateness"], 0.99)
    expirations = answer["expirations"] + other["expirations"]
    core = answer["cpu"] / answer["wall"]
    ratio = p99 / floor_p99
    return [
        Result("full-port-expirations", expirations, f"in {seconds:g} s", None, "0", expirations == 0),
        Result("full-port-lateness-p50", percentile(answer["lateness"], 0.5), "us", None, "none", True),
        Result("full-port-lateness-p99", p99, "us", ratio, "ratio <= 1.5", ratio <= 1.5),
        Result("full-port-cpu", core, "cores", None, "none", True),
    ]


def memory(seconds: float) -> list[Result]:
    """Resident memory of one more drive, connected."""
    del seconds
    sizes = {}
    for drives in (16, 272):
        with _line(drives, "16ms", 16) as (farm, _):
            farm.ask("rss")
            sizes[drives] = farm.answer()["rss"]
    value = (sizes[272] - sizes[16]) / 256 / 1000
    return [Result("memory-per-drive", value, "kB", None, "<= 200", 0 < value <= 200)]


def flat(seconds: float) -> list[Result]:
    """CPU of one more drive at 4 ms: from 16 to 256 drives, and from 256 to 512."""
    cores = {}
    for drives in (16, 256, 512):
        with _line(drives, "4ms", 64) as (farm, plc):
            answer, _ = _measure(farm, plc, seconds)
        cores[drives] = answer["cpu"] / answer["wall"]
    # the ticks of the engine cost the same with one drive and with many: what counts is what a drive adds
    lower = (cores[256] - cores[16]) / 240 * 1e6
    upper = (cores[512] - cores[256]) / 256 * 1e6
    ratio = upper / lower
    unit = "us of CPU per drive and second"
    return [
        Result("cpu-16-drives", cores[16], "cores", None, "none", True),
        Result("cpu-512-drives", cores[512], "cores", None, "none", True),
        Result("added-drive-16-to-256", lower, unit, None, "none", True),
        Result("added-drive-256-to-512", upper, unit, None, "none", True),
        Result("added-drive-ratio", ratio, "upper over lower", None, "0.8 to 1.2", abs(ratio - 1) <= 0.2),
    ]


def start(seconds: float) -> list[Result]:
    """64 drives, from nothing to all exchanging data."""
    del seconds
    with wire(), ExitStack() as stack:
        begin = time.monotonic()
        plc = Child("plc", PEER_CPU, file=_file(64, "16ms", 16, PEER_CPU), interface_from_outside=PEER)
        stack.callback(plc.close)
        farm = Child("farm", FARM_CPU, file=_file(64, "16ms", 16, FARM_CPU))
        stack.callback(farm.close)
        farm.answer()
        plc.answer()
        plc.ask("connected 60")
        connected = plc.answer()["connected"]
        value = time.monotonic() - begin
    return [Result("start-64", value, "s", None, "<= 5", connected and value <= 5)]


def connect_storm(seconds: float) -> list[Result]:
    """256 drives, from nothing to data both ways, both ends on one core, while 64 others run at 4 ms."""
    from pnfarm.cli.bench_storm import storm

    return storm(seconds)


def akd_1024(seconds: float) -> list[Result]:
    """1,024 AKDs at the 16 ms of their manual on one core."""
    with _line(1024, "16ms", 16) as (farm, plc):
        answer, other = _measure(farm, plc, seconds)
    core = answer["cpu"] / answer["wall"]
    lost = answer["expirations"] + other["expirations"]
    floor = _settled_floor(1024, 16, 1_000_000, min(10.0, seconds))
    ratio = core / (floor["cpu"] / floor["wall"])
    return [
        Result("akd-1024-cpu", core, "cores", ratio, "< 0.35", core < 0.35),
        Result("akd-1024-expirations", lost, f"in {seconds:g} s", None, "0", lost == 0),
    ]


def virtual_64(seconds: float) -> list[Result]:
    """64 drives and their controller at 1 ms in memory: farm time over real time."""
    del seconds
    import anyio

    from pnfarm.controller.line import VirtualLine
    from pnfarm.farm.config import parse_farm

    text = _file(64, "1ms", 3, FARM_CPU).replace(f"kind: macvlan, parent: {PARENT}", "kind: memory")
    line = anyio.run(VirtualLine.create, parse_farm(text.replace(f"  interface: {PEER}\n", "")))
    if not line.world.run(30.0, until=lambda: line.plc.all_connected and line.plc.all_running):
        raise InternalError("64 drives did not connect in virtual time")
    begin = time.perf_counter()
    line.world.run(20.0)
    value = 20.0 / (time.perf_counter() - begin)
    return [Result("virtual-64", value, "times faster than real time", None, ">= 30", value >= 30)]


def firmware(seconds: float) -> list[Result]:
    """One drive's own firmware in a step of 1 ms: all models mixed, moving."""
    del seconds
    from pnfarm.cli.bench_firmware import POSITION, SPEED, cost_of_a_step

    results = []
    for name, text in (("speed", SPEED), ("position", POSITION)):
        value = cost_of_a_step(text)
        results.append(Result(f"firmware-{name}", value, "ns per drive and step", None, "< 500", value < 500))
    value = cost_of_a_step(POSITION, motor_step_ns=62_500)
    results.append(Result("firmware-position-16-khz", value, "ns per drive and step", None, "none", True))
    return results


#: Name on the command line -> (benchmark, seconds of one measurement).
BENCHMARKS: dict[str, tuple[Callable[[float], list[Result]], float]] = {
    "frame-cost": (frame_cost, 10.0),
    "full-port": (full_port, 60.0),
    "memory": (memory, 0.0),
    "flat": (flat, 10.0),
    "start": (start, 0.0),
    "connect-storm": (connect_storm, 5.0),
    "akd-1024": (akd_1024, 10.0),
    "virtual": (virtual_64, 0.0),
    "firmware": (firmware, 0.0),
}


def _table(results: list[Result]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title=f"pnfarm bench, {os.cpu_count()} CPUs")
    for column in ("benchmark", "value", "unit", "to floor", "goal", ""):
        table.add_column(column)
    for r in results:
        ratio = "" if r.ratio_to_floor is None else f"{r.ratio_to_floor:.2f}"
        verdict = "" if r.goal == "none" else ("[green]ok" if r.ok else "[red]missed")
        table.add_row(r.name, f"{r.value:.4g}", r.unit, ratio, "" if r.goal == "none" else r.goal, verdict)
    Console(emoji=False).print(table)


def _markdown(results: list[Result]) -> str:
    lines = [
        "# Figures",
        "",
        f"What `pnfarm bench --markdown docs/bench.md` printed on a machine with {os.cpu_count()} CPUs",
        f"({platform.machine()}, Linux {platform.release()}, Python {platform.python_version()}). The farm and the",
        "floor run in the same call, in turn; `to floor` is the ratio of the two. Other machines give other figures.",
        "",
        "| benchmark | value | unit | to floor | goal | |",
        "|---|---|---|---|---|---|",
    ]
    for r in results:
        ratio = "" if r.ratio_to_floor is None else f"{r.ratio_to_floor:.2f}"
        goal, verdict = ("", "") if r.goal == "none" else (r.goal, "ok" if r.ok else "missed")
        lines.append(f"| {r.name} | {r.value:.4g} | {r.unit} | {ratio} | {goal} | {verdict} |")
    return "\n".join([*lines, *_reading(results)]) + "\n"


def _reading(results: list[Result]) -> list[str]:
    """What the figures do and do not say, with the ones that follow from others."""
    values = {r.name: r.value for r in results}
    lines = ["", "## How to read them", ""]
    few, many = values.get("cpu-16-drives"), values.get("cpu-512-drives")
    if few is not None and many is not None:
        lines += [
            f"- All CPU time divided by all drives is not flat: {few / 16 * 1e6:.0f} us per drive and second with 16",
            f"  drives, {many / 512 * 1e6:.0f} us with 512, because the ticks cost the same with one drive.",
            "  `added-drive-ratio` is what one more drive costs among many over what it costs among few; 0.8 to 1.2",
            "  means that the farm scales.",
        ]
    lines += [
        "- Above 128 drives the kernel's time stamps are off unless the farm file says",
        "  `realtime: {timestamps: true}`: they cost about a tenth of a frame. `frame-cost-192` and `full-port-*` are",
        "  therefore without them.",
        "- `connect-storm-*` measures twice, with `realtime: {fifo: 20}` and with the ordinary scheduler and the",
        "  niceness that engines ask for. The controller that connects is busy on the same CPU with an even share of",
        "  it; how much it delays the farm's ticks then, `connect-storm-ordinary-*` says.",
    ]
    return lines


def command(
    names: Annotated[list[str] | None, typer.Argument(metavar="[NAME]...", help="Which; all when left out.")] = None,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write the figures as JSON.")] = None,
    markdown_file: Annotated[
        Path | None, typer.Option("--markdown", help="Write the figures as a page of documentation.")
    ] = None,
    seconds: Annotated[
        float | None,
        typer.Option(min=0.1, max=3600, help="Length of each measurement; left out, each one's own."),
    ] = None,
) -> None:
    """Run the benchmarks: the farm's figures beside the floor of this machine."""
    unknown = [name for name in names or [] if name not in BENCHMARKS]
    if unknown:
        raise ConfigError(f"there is no benchmark {unknown[0]!r}; there are {', '.join(BENCHMARKS)}")
    from pnfarm.links.sandbox import enter_sandbox

    # compiled beforehand, in a process of its own: a benchmark that compiles measures the compiler
    subprocess.run([sys.executable, "-m", "pnfarm.engine.warm"], check=True, stdout=subprocess.DEVNULL)
    enter_sandbox()
    results: list[Result] = []
    for name in names or BENCHMARKS:
        function, usual = BENCHMARKS[name]
        typer.echo(f"{name}: {(function.__doc__ or '').splitlines()[0]}", err=True)
        results += function(usual if seconds is None else seconds)
    _table(results)
    if json_file is not None:
        json_file.write_text(json.dumps([asdict(r) for r in results], indent=1) + "\n", encoding="utf-8")
    if markdown_file is not None:
        markdown_file.write_text(_markdown(results), encoding="utf-8")
    if not all(r.ok for r in results):
        raise typer.Exit(1)
