"""Benchmarks of the cyclic frames of one farm and its controller: their CPU, lateness, and memory."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.bench.line import (
    cores,
    expirations,
    farm_and_plc,
    lateness,
    measure,
    memory_per_station,
    per_frame,
    settled_floor,
)
from pnfarm.bench.result import WINDOWS, Result

if TYPE_CHECKING:
    from pnfarm.bench.load import Load

__all__ = ["WAYS", "akd_1024", "flat", "frame_cost", "full_port", "memory", "ways"]

#: How often floor and farm take turns where a goal is near to the floor.
TURNS = 2


def frame_cost(seconds: float, load: Load) -> list[Result]:
    """CPU of one cyclic frame at 192 drives and 1 ms; floor, farm and a farm that sends by AF_XDP in turn, twice."""
    turn = seconds / TURNS
    low = settled_floor(192, 1, 1_000_000, turn, load)
    ours, theirs, xdp = [], [], []
    for _ in range(TURNS):
        with farm_and_plc(192, "1ms", 64) as (farm, plc):
            answers = measure(farm, plc, turn, load, WINDOWS // TURNS)
        ours += answers[0]
        theirs += answers[1]
        low += settled_floor(192, 1, 1_000_000, turn, load)
        with farm_and_plc(192, "1ms", 64, send="xdp") as (farm, plc):
            xdp += measure(farm, plc, turn, load, WINDOWS // TURNS)[0]
    value, floor = per_frame(ours), per_frame(low)
    ratio, unit = value.over(floor), "us of CPU per frame"
    return [
        value.row("frame-cost-192", unit, ratio, "ratio <= 0.95", ratio <= 0.95),
        per_frame(xdp).row("frame-cost-192-xdp", unit, per_frame(xdp).over(floor)),
        floor.row("frame-cost-192-floor", unit, 1.0),
        per_frame(theirs).row("frame-cost-192-controller", unit),
    ]


#: Ways of the loops of `ways`: whether frames are received from a ring, and sent through the parent.
WAYS = {"batch": (False, False), "ring": (True, False), "parent": (False, True), "ring-parent": (True, True)}


def ways(seconds: float, load: Load) -> list[Result]:
    """CPU of a frame in the minimal loop: received by system calls or from a ring, sent by macvlan or parent."""
    turn = seconds / TURNS
    answers: dict[str, list[dict[str, Any]]] = {name: [] for name in WAYS}
    for _ in range(TURNS):
        for name, (ring, parent) in WAYS.items():
            answers[name] += settled_floor(192, 1, 1_000_000, turn, load, ring=ring, parent=parent)
    floor = per_frame(answers["batch"])
    found = {name: per_frame(windows) for name, windows in answers.items()}
    return [windows.row(f"ways-{name}", "us of CPU per frame", windows.over(floor)) for name, windows in found.items()]


def full_port(seconds: float, load: Load) -> list[Result]:
    """148 drives at 1 ms, a full 100 Mbit/s port, for a minute."""
    low = settled_floor(148, 1, 1_000_000, min(10.0, seconds), load)
    with farm_and_plc(148, "1ms", 64) as (farm, plc):
        before = expirations(farm, plc)
        ours, _ = measure(farm, plc, seconds, load)
        lost = expirations(farm, plc) - before
    low += settled_floor(148, 1, 1_000_000, min(10.0, seconds), load)
    p50, p99 = lateness(ours, 0.5), lateness(ours, 0.99)
    used, ratio = cores(ours), p99.over(lateness(low, 0.99))
    return [
        Result("full-port-expirations", lost, f"in {seconds:g} s", None, "0", lost == 0),
        p50.row("full-port-lateness-p50", "us", p50.over(lateness(low, 0.5))),
        p99.row("full-port-lateness-p99", "us", ratio, "ratio <= 1.5", ratio <= 1.5),
        used.row("full-port-cpu", "cores", used.over(cores(low))),
    ]


def memory(seconds: float, load: Load) -> list[Result]:
    """Resident memory of one more drive, connected."""
    del seconds
    value = memory_per_station(16, 272, load, lambda drives: farm_and_plc(drives, "16ms", 16))
    return [Result("memory-per-drive", value, "kB", None, "<= 80", 0 < value <= 80)]


def flat(seconds: float, load: Load) -> list[Result]:
    """CPU of one more drive at 4 ms: from 16 to 256 drives, and from 256 to 512."""
    used = {}
    for drives in (16, 256, 512):
        with farm_and_plc(drives, "4ms", 64) as (farm, plc):
            used[drives] = cores(measure(farm, plc, seconds, load)[0])
    few, some, many = (used[drives].median for drives in (16, 256, 512))
    # the engine's ticks cost the same for one drive as for many: measured is what a drive adds
    lower, upper = (some - few) / 240 * 1e6, (many - some) / 256 * 1e6
    ratio = upper / lower
    unit = "us of CPU per drive and second"
    return [
        used[16].row("cpu-16-drives", "cores"),
        used[512].row("cpu-512-drives", "cores"),
        Result("added-drive-16-to-256", lower, unit, None, "none", True),
        Result("added-drive-256-to-512", upper, unit, None, "none", True),
        Result("added-drive-ratio", ratio, "upper over lower", None, "<= 1.2", 0 < ratio <= 1.2),
    ]


def akd_1024(seconds: float, load: Load) -> list[Result]:
    """1,024 AKDs at the 16 ms of their manual on one core."""
    low = settled_floor(1024, 16, 1_000_000, min(5.0, seconds), load)
    with farm_and_plc(1024, "16ms", 16) as (farm, plc):
        before = expirations(farm, plc)
        used = cores(measure(farm, plc, seconds, load)[0])
        lost = expirations(farm, plc) - before
    floor = cores(low + settled_floor(1024, 16, 1_000_000, min(5.0, seconds), load))
    ratio = used.over(floor)
    return [
        used.row("akd-1024-cpu", "cores", ratio, "ratio <= 1.4", ratio <= 1.4),
        floor.row("akd-1024-floor", "cores", 1.0),
        Result("akd-1024-expirations", lost, f"in {seconds:g} s", None, "0", lost == 0),
    ]
