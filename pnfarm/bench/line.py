"""Test bench of the benchmarks: farms, controllers and minimal loops as processes of their own, on a veth pair.

One end carries macvlans, in a network namespace; the other end is a single interface in another namespace.  The farm
is pinned to one CPU, its peer to another.
"""

from __future__ import annotations

import json
import subprocess
import sys
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Any

from pnfarm.bench.result import WINDOWS, Windows
from pnfarm.errors import InternalError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from contextlib import AbstractContextManager

    from pnfarm.bench.load import Load

__all__ = [
    "DRIVES",
    "FARM_CPU",
    "PARENT",
    "PEER",
    "PEER_CPU",
    "Child",
    "begun",
    "both_ends",
    "cores",
    "expirations",
    "farm_and_plc",
    "farm_file",
    "floor_ends",
    "lateness",
    "measure",
    "memory_per_station",
    "per_frame",
    "percentile",
    "settled_floor",
    "wire",
]

FARM_CPU, PEER_CPU = 0, 1
PARENT, PEER = "pnbench0", "pnbench1"


#: After which all of a start is over: addresses, parameters, neighbours, and what the drives report of it.
SETTLED_SECONDS = 30

FILE = """
farm: bench
link: {link}
api: {api}
realtime: {{cpu: {cpu}}}
{stations}
controller:
  name: plc
  ip: 10.64.255.250/16
  interface: {peer}
  cycle: {cycle}
  watchdog_factor: {watchdog}
  program: {{kind: sine, speed_rpm: 600, period: 4s, acknowledge_after: 100ms}}
"""

DRIVES = """
drives:
  - name: axis-{{n:04}}
    count: {count}
    model: akd-profinet
    ip: 10.64.0.11/16
    limits: lax
"""


def farm_file(
    count: int,
    cycle: str,
    watchdog: int,
    cpu: int,
    api: str = "off",
    send: str = "auto",
    *,
    in_memory: bool = False,
    stations: str = DRIVES,
) -> str:
    """The drives of a benchmark, or other ``stations``, and their controller, on the benchmarks' line or in memory."""
    text = FILE.replace("  interface: {peer}\n", "") if in_memory else FILE
    link = "{kind: memory}" if in_memory else f"{{kind: macvlan, parent: {PARENT}, send: {send}}}"
    said = stations.strip().format(count=count)
    return text.format(link=link, peer=PEER, stations=said, cycle=cycle, watchdog=watchdog, cpu=cpu, api=api)


class Child:
    """A process of :mod:`pnfarm.bench.child`, or of another module that is driven alike."""

    def __init__(self, role: str, cpu: int, *, module: str = "pnfarm.bench.child", **settings: Any) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", module, role],
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

    def told(self, command: str) -> dict[str, Any]:
        """The answer to a command."""
        self.ask(command)
        return self.answer()

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


def begun(stack: ExitStack, role: str, cpu: int, **settings: Any) -> Child:
    """A process that answers already; it ends with the stack."""
    child = Child(role, cpu, **settings)
    stack.callback(child.close)
    child.answer()
    return child


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
def farm_and_plc(
    count: int, cycle: str, watchdog: int, api: str = "off", send: str = "auto", stations: str = DRIVES
) -> Iterator[tuple[Child, Child]]:
    """A farm, with its API at ``api``, and the built-in controller, connected."""
    ours = farm_file(count, cycle, watchdog, FARM_CPU, api, send, stations=stations)
    with both_ends(count, ours, farm_file(count, cycle, watchdog, PEER_CPU, stations=stations)) as children:
        yield children


@contextmanager
def both_ends(count: int, ours: str, theirs: str) -> Iterator[tuple[Child, Child]]:
    """A farm and its controller, by the farm file of each, connected."""
    with wire(), ExitStack() as stack:
        farm = begun(stack, "farm", FARM_CPU, file=ours)
        plc = begun(stack, "plc", PEER_CPU, file=theirs, interface_from_outside=PEER)
        if not plc.told("connected 120")["connected"]:
            raise InternalError(f"{count} stations did not connect within 120 s")
        # let the start-up (DCP, ARP, records, neighbours) finish before measuring
        farm.told(f"settled {SETTLED_SECONDS}")
        yield farm, plc


def measure(
    farm: Child, peer: Child, seconds: float, load: Load, windows: int = WINDOWS
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """What both counted in each of so many windows, together of so many seconds."""
    ours, theirs = [], []
    for _ in range(windows):
        with load:
            farm.ask(f"measure {seconds / windows}")
            peer.ask(f"measure {seconds / windows}")
            ours.append(farm.answer())
            theirs.append(peer.answer())
    return ours, theirs


def expirations(*children: Child) -> int:
    """Connections of both ends that were lost since their start; between two windows as well."""
    for child in children:
        child.ask("mark")
    return sum(int(child.answer()["expirations"]) for child in children)


def memory_per_station(
    few: int, many: int, load: Load, ends: Callable[[int], AbstractContextManager[tuple[Child, Child]]]
) -> float:
    """Resident memory of one more connected station, kB; ``ends`` makes a farm with so many and its controller."""
    sizes = {}
    for count in (few, many):
        # the watch lasts as long as the question: others' work does not change what is resident
        with ends(count) as (farm, _), load:
            sizes[count] = farm.told("rss")["rss"]
    return float(sizes[many] - sizes[few]) / (many - few) / 1000


def cores(answers: list[dict[str, Any]]) -> Windows:
    return Windows(float(answer["cpu"]) / float(answer["wall"]) for answer in answers)


def per_frame(answers: list[dict[str, Any]]) -> Windows:
    """Microseconds of CPU."""
    return Windows(float(answer["cpu"]) / max(1, int(answer["frames"])) * 1e6 for answer in answers)


def lateness(answers: list[dict[str, Any]], share: float) -> Windows:
    """Microseconds that this share of the ticks stays below."""
    return Windows(percentile(answer["lateness"], share) for answer in answers)


@contextmanager
def floor_ends(
    drives: int,
    groups: int,
    period_ns: int,
    packet: bytes = b"",
    *,
    ring: bool = False,
    parent: bool = False,
    far: str = PEER,
    scheduled: Mapping[str, int] | None = None,
) -> Iterator[tuple[Child, Child]]:
    """Two minimal loops on a wire: macvlans on one side, the interface ``far`` on the other.

    They send RT frames, or ``packet`` from its EtherType on.  With ``ring`` both receive as the engine does, with
    ``parent`` the side with the macvlans sends through their parent.
    ``scheduled``: what they ask the kernel for, if not what engines do.
    """
    with ExitStack() as stack:
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
        peer_mac = bytes.fromhex(links[far]["address"].replace(":", ""))
        common = {"groups": groups, "period": period_ns, "packet": packet.hex(), "ring": ring}
        common["scheduled"] = dict(scheduled or {})
        exits = [index[PARENT if parent else f"pnfl{i}"] for i in range(drives)]
        ours = [(out, mac.hex(), peer_mac.hex()) for out, mac in zip(exits, macs, strict=True)]
        # an interface keeps its index when it moves into an empty namespace
        theirs = [(index[far], peer_mac.hex(), mac.hex()) for mac in macs]
        farm = begun(stack, "floor", FARM_CPU, addresses=ours, interface="", **common)
        peer = begun(stack, "floor", PEER_CPU, addresses=theirs, interface=far, interface_from_outside=far, **common)
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


def settled_floor(
    drives: int,
    groups: int,
    period_ns: int,
    seconds: float,
    load: Load,
    *,
    packet: bytes = b"",
    windows: int = WINDOWS // 2,
    ring: bool = False,
    parent: bool = False,
) -> list[dict[str, Any]]:
    """What the loop in the farm's place counted in each window.  Usually it runs before the farm and after it."""
    with wire(), floor_ends(drives, groups, period_ns, packet, ring=ring, parent=parent) as (farm, peer):
        return measure(farm, peer, seconds, load, windows)[0]
