"""The same in virtual time: farm and controller in this process; a seed makes the same run again, entry for entry.

What is kept of what is over (ended faults, the event log) is bounded, but by numbers that only hours fill: each rest
empties them, so that minutes show whether anything else grows.
"""

# ruff: noqa: T201 - what it prints is its answer

from __future__ import annotations

import argparse
import asyncio
import gc
import json
import os
import signal
import sys
import time
import tracemalloc
import zlib
from array import array
from collections import Counter, deque
from dataclasses import dataclass
from functools import cache, partial
from random import Random
from typing import Any

from storm import left_behind

from pnfarm.buses.registry import fault_kinds
from pnfarm.controller import line as controller_line
from pnfarm.errors import ConfigError, PnfarmError
from pnfarm.farm.file.reading import parse_farm
from pnfarm.farm.views.controller_view import controller_view
from pnfarm.farm.views.snapshot import drive_snapshot, engine_snapshot
from pnfarm.faults.effects.connection import CONNECTION
from pnfarm.metrics import FarmCollector
from pnfarm.scenario.definition.binding import bind_scenario
from pnfarm.scenario.definition.file import parse_scenario
from pnfarm.scenario.run import ScenarioRun
from pnfarm.station.event_log import EventLog
from tests.soak.asked import ask, asked_check
from tests.soak.cell import DEVICES, IDLE, cell_text
from tests.soak.choices import Action, Choices
from tests.soak.holdings import of_controllers, of_farm, rows
from tests.soak.judge import MOST_GROWTH, Check, Stream, same_as_before, shown
from tests.soak.losses import Losses

__all__ = ["Rest", "VirtualRun", "grown", "main"]

#: Between two rests; a rest lets everything end that is due some time.
ROUND_SECONDS, CALM_SECONDS, BACK_SECONDS = 20.0, 30.0, 60.0
#: A fault without an end of its own is cleared after this time, on average.
HELD_SECONDS = 8.0
#: What may be less at a rest than at the start, where some of the start-up was left.
SLACK = {"searches": 0, "calls": 0, "replies kept": 0}
#: The log is read so often that a storm of alarms does not overrun it.
READ_NS = 100_000_000
#: Scenarios at work at once.
MOST_SCENARIOS = 2
#: Rests before memory is compared: the first ones fill what is bounded.
WARM_RESTS = 3
#: What one kind of object, or its number in the second half, may differ by without being a leak.
OBJECT_SLACK, OBJECT_SHARE = 40, 0.02
#: The same for memory: octets if it is traced, otherwise blocks of the interpreter.
OCTETS_SLACK, BLOCKS_SLACK = 64 * 1024, 3000


#: Place of each class in the numbers of a rest.
_PLACES: dict[str, int] = {}


@dataclass(frozen=True, slots=True)
class Rest:
    """What is held when nothing is in force: memory (octets if ``traced``, otherwise blocks), objects, tables.

    It is part of what is measured, and so kept small: ``numbers`` of objects stand in the order of :data:`_PLACES`.
    """

    seconds: float
    memory: int
    traced: bool
    numbers: array[int]
    holds: dict[str, Any]
    #: Of the interpreter.
    blocks: int = 0

    @classmethod
    def of(cls, seconds: float, memory: int, *, traced: bool, objects: Counter[str], holds: dict[str, Any]) -> Rest:
        for name in objects:
            _PLACES.setdefault(name, len(_PLACES))
        return cls(
            seconds, memory, traced, array("l", (objects[name] for name in _PLACES)), holds, sys.getallocatedblocks()
        )

    @property
    def objects(self) -> Counter[str]:
        return Counter({name: self.numbers[place] for name, place in _PLACES.items() if place < len(self.numbers)})


def grown(rests: list[Rest]) -> list[Check]:
    """Memory and objects at the last rest against those at the middle one; not judged with fewer than six rests."""
    if len(rests) < WARM_RESTS + 3:
        told = f"{len(rests)} rests: too few to judge"
        return [Check("memory flat", ok=None, told=told), Check("objects flat", ok=None, told=told)]
    half = rests[max(WARM_RESTS, len(rests) // 2) :]
    # one rest may hold a frame that another does not: only what all of the later ones have more of is growth
    third = max(1, len(half) // 3)
    before = max(rest.memory for rest in half[:third])
    after = min(rest.memory for rest in half[-third:])
    allowed = max(OCTETS_SLACK if half[0].traced else BLOCKS_SLACK, int(before * MOST_GROWTH))
    unit = "octets" if half[0].traced else "blocks"
    memory = Check(
        "memory flat",
        ok=after - before <= allowed,
        told=f"{before:,} to {after:,} {unit} from {half[0].seconds:.0f} to {half[-1].seconds:.0f} s",
    )
    first, later = [[rest.objects for rest in part] for part in (half[:third], half[-third:])]
    more = []
    for kind in later[-1]:
        old, new = max(seen[kind] for seen in first), min(seen[kind] for seen in later)
        if new > old + max(OBJECT_SLACK, int(old * OBJECT_SHARE)):
            more.append(f"{kind} {old} -> {new}")
    counted = sum(later[-1].values())
    return [memory, Check("objects flat", ok=not more, told=", ".join(more[:6]) or f"{counted:,} objects")]


@cache
def _counted(kind: type) -> str:
    """The name under which a class is counted, "" if it is not; names are made once, so that rests cost little."""
    # the module of some metaclasses' classes is no text
    if str(kind.__module__).startswith("pnfarm.") or kind in {dict, list, set, deque, tuple, partial}:
        return f"{kind.__module__}.{kind.__qualname__}"
    return ""


def _objects() -> Counter[str]:
    found: Counter[str] = Counter()
    for kind, count in Counter(map(type, gc.get_objects())).items():
        if name := _counted(kind):
            found[name] += count
    return found


class _Line:
    """A farm of all models and its controller, as :mod:`storm` looks at one."""

    def __init__(self, drives: int) -> None:
        self.log, self.plc_log = EventLog(quiet=True), EventLog(quiet=True)
        config = parse_farm(cell_text(drives, "memory", "off"))
        made = asyncio.run(controller_line.VirtualLine.create(config, log=self.log, plc_log=self.plc_log))
        self.world, self.farm, self.plc = made.world, made.farm, made.plc
        self.controllers = made.controllers
        assert self.controllers is not None
        self.faults = self.farm.injections

    def forget(self) -> None:
        """Empty what is kept of what is over."""
        self.faults._ended.clear()
        for log in (self.log, self.plc_log):
            for entries in (log._farm, *log._drives.values()):
                entries.clear()
        for name in self.names:
            # each keeps the state machines that it saw last: one earlier life of a drive that has booted
            drive = self.faults.drive(name)
            drive.refresh(self.world.now)
            drive.part(CONNECTION).now()

    @property
    def names(self) -> dict[str, str]:
        return {station.configured_name: station.model.name for station in self.farm.axes}

    @property
    def devices(self) -> list[str]:
        return [station.configured_name for station in self.farm.stations if not station.axes]

    def away(self) -> list[str]:
        """Drives that are not in operation or exchange no data, and devices that exchange none."""
        return [name for name in self.names if self._is_away(name)] + [
            station.configured_name
            for station in self.farm.stations
            if not station.axes and not (station.device.connected and self._exchanging(station.configured_name))
        ]

    def _exchanging(self, name: str) -> bool:
        return bool(self.controllers.of(name).exchanging(name))

    def _is_away(self, name: str) -> bool:
        axis = self.farm.axis(name)
        record = axis.handle.axis
        return bool(
            (int(record.drive.state) != 4 and name not in IDLE)
            or record.faults.code[0]
            or not axis.device.connected
            or not self._exchanging(name)
        )


class VirtualRun:
    """``options``: hours, seed, drives, rate."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.options = options
        self.line = _Line(options.drives)
        self.stream = Stream()
        self.losses = Losses("farm_seconds")
        self.choices = Choices(options.seed, self.line.names, options.rate, devices=self.line.devices)
        self.rng = Random(f"times/{options.seed}")
        self.collector = FarmCollector(self.line.farm)
        self.done: Counter[str] = Counter()
        self.kinds: Counter[str] = Counter()
        self.wrong: list[str] = []
        self.rests: list[Rest] = []
        self.scenarios: list[ScenarioRun] = []
        self.due: list[tuple[int, str]] = []
        self.before: dict[tuple[str, str], int] = {}
        self.held: tuple[dict[str, Any], dict[str, Any]] | None = None
        self.digest = 0
        self.began = self.line.world.now

    @property
    def seconds(self) -> float:
        return (self.line.world.now - self.began) / 1e9

    def go(self, *, tell: bool = True) -> list[Check]:
        self._bring_back(BACK_SECONDS)
        self._read()
        self.held = self._holds()
        end = self.options.hours * 3600
        while self.seconds < end:
            until = min(end, self.seconds + ROUND_SECONDS)
            while self.seconds < until:
                self._act(self.choices.next())
                self._pass(self.choices.pause())
            checks = self._rest()
            bad = [check for check in checks if check.ok is False]
            if tell:
                rest = self.rests[-1]
                print(
                    f"{rest.seconds / 60:6.1f} min  {rest.memory >> 10:,} KiB, {sum(rest.objects.values()):,} objects,"
                    f" {sum(self.kinds.values())} faults, {self.stream.entries:,} events, {len(self.wrong)} wrong",
                    flush=True,
                )
            if bad:
                return [*checks, *self._always()]
        return [*checks, *grown(self.rests), *self._always()]

    def _always(self) -> list[Check]:
        told = f"{sum(self.kinds.values()):,} faults of {len(self.kinds)} kinds; digest {self.digest:08x}"
        return [
            *self.stream.checks(self.line.log.newest),
            *self.losses.checks(),
            Check("each request answered as it should", ok=not self.wrong, told="; ".join(self.wrong[:5]) or told),
        ]

    def report(self, checks: list[Check]) -> dict[str, Any]:
        """As that of a run in real time."""
        return {
            "options": vars(self.options),
            "seconds": self.seconds,
            "checks": [{"name": check.name, "ok": check.ok, "told": check.told} for check in checks],
            "actions": dict(self.done.most_common()),
            "kinds": dict(self.kinds.most_common()),
            "events": dict(self.stream.kinds.most_common()),
            "wrong": self.wrong,
            **self.losses.report(),
            "samples": [
                {
                    "seconds": rest.seconds,
                    "process pid": os.getpid(),
                    "process blocks": rest.blocks,
                    "process objects": sum(rest.objects.values()),
                    "process rows": sum(map(rows, rest.holds.values())),
                }
                for rest in self.rests
            ],
        }

    # -- time --------------------------------------------------------------------------------------------------------

    def _pass(self, seconds: float) -> None:
        """Let time pass, with what is due in it."""
        world = self.line.world
        end = world.now + round(seconds * 1e9)
        while True:
            now = world.now
            for at, name in [entry for entry in self.due if entry[0] <= now]:
                self.due.remove((at, name))
                self._clear(name)
            looks = [run.advance(now) for run in self.scenarios]
            self.scenarios = [run for run in self.scenarios if not run.finished]
            # a scenario that watches a condition looks each millisecond; here twenty are enough
            looks = [max(at, now + 20_000_000) for at, run in zip(looks, self.scenarios, strict=False)]
            self._read()
            if now >= end:
                return
            following = min([end, now + READ_NS, *(at for at, _ in self.due), *looks])
            world.run(max(following - now, 1) / 1e9)

    def _read(self) -> None:
        """What the event stream would send."""
        log = self.line.log
        while entries := log.entries(after=self.stream.last, most=64):
            lost = entries[0].sequence - self.stream.last - 1
            if lost > 0:
                self.stream.message("gap", "", str(lost))
                self.stream.last += lost
            for entry in entries:
                shown_as = entry.as_dict()
                text = json.dumps(shown_as, default=str)
                self.stream.message("", str(entry.sequence), text)
                self.losses.entry(shown_as)
                del shown_as["time"]
                self.digest = zlib.crc32(json.dumps(shown_as, default=str).encode(), self.digest)

    # -- harm --------------------------------------------------------------------------------------------------------

    def _act(self, action: Action) -> None:
        self.done[action.what] += 1
        try:
            self._carry_out(action)
        except PnfarmError as exc:
            self.done[f"{action.what} refused"] += 1
            if action.refused is False:
                self.wrong.append(f"{action} was refused: {exc}")
        else:
            if action.refused:
                self.wrong.append(f"{action} was not refused")

    def _carry_out(self, action: Action) -> None:
        line, now, fields = self.line, self.line.world.now, action.fields
        farm = line.farm
        match action.what:
            case "fault":
                injection = line.faults.inject(fields, now)
                self.kinds[injection.spec.kind.name] += 1
                if injection.state.value != "ended":
                    self.due.append((now + round(self.rng.expovariate(1 / HELD_SECONDS) * 1e9), injection.id))
            case "invalid":
                if not isinstance(fields, dict):
                    raise ConfigError("the API takes an object")
                line.faults.inject(fields, now)
            case "dry-run":
                line.faults.reach(fields)
            case "clear":
                if self.due:
                    self._clear(self.due.pop(self.rng.randrange(len(self.due)))[1])
            case "reset":
                self.due.clear()
                line.faults.clear(None, now)
            case "force":
                owner, signals = farm.with_signals(action.drive)
                signals.force(fields)
                farm.settle_owner(owner, now)
            case "power-cycle":
                station = farm.axis(action.drive)
                station.station.power_cycle(now)
                farm.settle(station.station, now)
            case "write":
                self._write(action.drive, fields["pnu"])
            case "wrong-write":
                if not isinstance(fields["value"], int):
                    raise ConfigError("the API takes a whole number")
                farm.axis(action.drive).store.set(fields["pnu"], fields["value"])
            case "trace":
                self._trace(fields)
            case "scenario":
                self._scenario(fields["text"])
            case "scrape":
                self.collector.gather().text()
            case "look":
                station = farm.axis(action.drive)
                json.dumps(drive_snapshot(farm, station, now))
                json.dumps(controller_view(farm, station, now))
                json.dumps([injection.as_dict() for injection in line.faults.list()])
                json.dumps([engine_snapshot(farm), line.controllers.snapshot()])

    def _clear(self, name: str) -> None:
        try:
            self.line.faults.clear(name, self.line.world.now)
        except ConfigError:
            self.done["clear of one that ended"] += 1

    def _write(self, drive: str, pnu: str) -> None:
        station = self.line.farm.axis(drive)
        if not station.powered:
            return
        parameter, subindex = station.model.resolve(pnu)
        if (drive, pnu) in self.before and self.rng.random() < 0.5:
            value = self.before.pop((drive, pnu))
        else:
            self.before.setdefault((drive, pnu), station.store.read(parameter.pnu, subindex)[0])
            value = self.choices.value(parameter.minimum, parameter.maximum)
        station.store.set(pnu, value)
        self.line.farm.settle(station.station, self.line.world.now)

    def _trace(self, fields: Any) -> None:
        traces, now = self.line.farm.traces, self.line.world.now
        for trace in traces.kept()[:-4]:
            trace.recording().csv()
            traces.delete(trace.id, now)
        traces.start(fields, now, keep_ns=600_000_000_000)

    def _scenario(self, text: str) -> None:
        if len(self.scenarios) >= MOST_SCENARIOS:
            return
        farm = self.line.farm
        models = {station.configured_name: station.model for station in farm.axes}
        binding = bind_scenario(parse_scenario(text), models, fault_kinds())
        self.scenarios.append(ScenarioRun(binding, farm, self.collector, self.line.world.now))

    # -- rests -------------------------------------------------------------------------------------------------------

    def _bring_back(self, seconds: float) -> bool:
        world = self.line.world
        end = world.now + round(seconds * 1e9)
        while self.line.away() and world.now < end:
            world.run(0.1)
            self._read()
        return not self.line.away()

    def _ask_all(self) -> Check:
        """Calm, in whose first half the PLC asks each drive for something, at a moment of its own."""
        jobs = {}
        for name in self.line.names:
            jobs[name] = ask(self.line.controllers.of(name), name, self.line.world.now)
            self._pass(self.rng.uniform(0.0, CALM_SECONDS / len(self.line.names)))
        self._pass(CALM_SECONDS / 2)
        return asked_check(jobs)

    def _holds(self) -> tuple[dict[str, Any], dict[str, Any]]:
        return of_farm(self.line.farm), of_controllers(self.line.controllers)

    def _rest(self) -> list[Check]:
        """Take everything back; then every drive is back and nothing is left."""
        line = self.line
        self.due.clear()
        for run in self.scenarios:
            run.cancel(line.world.now)
        self.scenarios.clear()
        for trace in line.farm.traces.kept():
            line.farm.traces.delete(trace.id, line.world.now)
        line.faults.clear(None, line.world.now)
        for name in DEVICES.keys() & set(line.devices):
            line.farm.with_signals(name)[1].force(dict.fromkeys(DEVICES[name]))
        self._bring_back(BACK_SECONDS)
        for (drive, pnu), value in self.before.items():
            station = line.farm.axis(drive)
            station.store.set(pnu, value)
            line.farm.settle(station.station, line.world.now)
        self.before.clear()
        # a minute passes in it: a second station with a drive's address is gone, and still in the PLC's ARP table
        line.plc.ip._neighbours.clear()
        back = self._bring_back(BACK_SECONDS)
        asked = self._ask_all()
        away = line.away()
        told = [f"{name} {[entry.event for entry in line.log.entries(name)][-6:]}" for name in away[:3]]
        checks = [Check("every drive in operation", ok=back and not away, told="; ".join(told) or f"{len(line.names)}")]
        left = {name: value for name, value in left_behind(line).items() if "awaits" not in name}
        checks.append(asked)
        checks.append(Check("nothing of the faults left", ok=not left, told=str(left) if left else "nothing"))
        assert self.held is not None
        for name, before, after in zip(("farm", "controller"), self.held, self._holds(), strict=True):
            checks.append(same_as_before(name, before, after, SLACK))
        self._read()
        line.forget()
        gc.collect()
        traced = tracemalloc.is_tracing()
        memory = tracemalloc.get_traced_memory()[0] if traced else sys.getallocatedblocks()
        held = {**dict(zip(("farm", "controllers"), self._holds(), strict=True))}
        self.rests.append(Rest.of(self.seconds, memory, traced=traced, objects=_objects(), holds=held))
        return checks


def main(options: argparse.Namespace) -> int:
    """0: everything held; 1: something did not; 130: a signal ended it."""
    began = time.process_time()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    tracemalloc.start()
    run = VirtualRun(options)
    interrupted = False
    try:
        checks = run.go()
    except KeyboardInterrupt:
        checks, interrupted = [Check("the run", ok=None, told="interrupted")], True
    finally:
        tracemalloc.stop()
    print(f"\n{shown(checks)}")
    print(f"{run.seconds:.0f} s of virtual time in {time.process_time() - began:.0f} s of the processor's")
    options.out.write_text(json.dumps(run.report(checks), indent=1, default=str) + "\n")
    return 130 if interrupted else int(any(check.ok is False for check in checks))
