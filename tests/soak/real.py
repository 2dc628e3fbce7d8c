"""The run in real time: farms, controllers and a hub as processes in a network namespace, and clients that do harm."""

# ruff: noqa: T201 - what it prints is its answer

from __future__ import annotations

import argparse
import json
import signal
import tempfile
import threading
import time
from collections import deque
from contextlib import ExitStack, contextmanager
from pathlib import Path
from random import Random
from typing import Any

from tests.soak.asked import ask_station
from tests.soak.cell import IDLE, LINE_DRIVES, STATIONS, on_serial_line
from tests.soak.choices import Choices
from tests.soak.client import Api, EventReader, HubReader
from tests.soak.harm import V1, Harm
from tests.soak.holdings import rows
from tests.soak.judge import Check, Stream, answered, same_as_before, shown
from tests.soak.losses import Losses
from tests.soak.programs import HUB_PORT, PORT, WAYS, Programs
from tests.soak.side import NOTE_SECONDS, SAMPLE_SECONDS, Side, SoakError, StarvedError

__all__ = ["RealRun", "main"]

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM)
#: Between two lines on the terminal, two rests.
TOLD_SECONDS, REST_SECONDS = 60.0, 600.0
#: A start may compile; after a rest's reset every drive is back within this time, on a machine that others use.
START_SECONDS, BACK_SECONDS = 300.0, 90.0
#: The longest that a rest waits on a machine that does not let the farm keep its cycles.
STARVED_SECONDS = 900.0
#: Programs are started anew in this part of a piece; what is left shows whether they grow.
DISTURBED_SHARE = 0.25
#: Between two programs that are disturbed, and between two requests to the hub, on average.
DISTURB_SECONDS, HUB_SECONDS = 40.0, 8.0
#: A stream whose other end went while the cable was pulled: its drive ends it after 120 s (TCP/IP object, no. 13).
LINGER_SECONDS = 130.0
#: What a side may hold more of at the end: connections of HTTP and workers of a pool come and go.
SLACK = {"threads": 8, "files": 12, "garbage": 0, "replies kept": 1 << 30, "calls": 0, "searches": 0, "traces": 0,
         "fault timers": 0, "log subscribers": 8, "faults known": 1 << 30, "streams": 0}  # fmt: skip
#: A little less than the shortest watchdog of the cell, that of the HIWIN E1: 60 cycles of 4 ms.
EXPIRES_SECONDS = 0.2
#: Losses without a reason whose controller is asked.
MOST_KEPT = 50
#: What is kept of the log around a loss without a reason.
AROUND_SECONDS = 4.0
#: Tasks that serve requests and streams: they come and go.
PASSING_TASKS = (
    "RequestResponseCycle",
    "Throttle",
    "event_stream",
    "StreamingResponse",
    "listen_for_disconnect",
    "wrap",
)
#: Faults of the line, through the hub; each ends by itself.
HUB_FAULTS = ("silence", "not-ready", "f702", "link-down", "ar-abort")


class RealRun:
    """``options``: hours, seed, drives, link, rate."""

    def __init__(self, options: argparse.Namespace, folder: Path) -> None:
        self.options = options
        self.programs = Programs(folder, options.drives, options.link)
        self.api, self.hub = Api(PORT), Api(HUB_PORT)
        self.lock = threading.Lock()
        self.stream = Stream()
        self.losses, self.line_losses = Losses("time", on_serial_line), Losses("time")
        #: The longest time until a program that was disturbed was back: what was done, seconds, which.
        self.returns: dict[str, tuple[float, str]] = {}
        self.samples: list[dict[str, Any]] = []
        self.rests: list[dict[str, Any]] = []
        self.closer: list[dict[str, Any]] = []
        #: When a controller did not run: its name, what of it, since when, how long.
        self._paused: deque[tuple[str, str, float, float]] = deque(maxlen=1000)
        self.checks: list[Check] = []
        self.expected = 0
        self.devices: list[str] = []
        self.began = time.monotonic()
        self.rng = Random(f"programs/{options.seed}")
        self.harm: Harm
        self.readers: list[Any] = []

    @property
    def sides(self) -> dict[str, Side]:
        return self.programs.sides

    @property
    def seconds(self) -> float:
        """Since harm began."""
        return time.monotonic() - self.began if hasattr(self, "harm") else 0.0

    # -- the run -----------------------------------------------------------------------------------------------------

    def go(self) -> list[Check]:
        interfaces = _interfaces()
        with ExitStack() as stack:
            stack.callback(self.programs.stop)
            self.programs.start_farms()
            interfaces |= {name for name in _interfaces() if name == "soak-line"}
            self._until("the farms are up", START_SECONDS, self._ready)
            self.programs.start_controllers()
            self.expected = len(self._drives())
            self.devices = [device["name"] for device in self._devices()]
            self._read_streams()
            self._until("every drive is in operation", START_SECONDS, lambda: not self._away())
            time.sleep(5.0)
            self._settled(first=True)
            self._do_harm()
            self._finish()
            stack.pop_all()
        codes = self.programs.stop()
        bad = [f"{name} {code}" for name, code in codes if code != 0]
        self.checks.append(Check("all programs ended by Ctrl-C with code 0", ok=not bad, told=", ".join(bad) or "yes"))
        left = sorted(_interfaces() - interfaces)
        self.checks.append(Check("interfaces gone", ok=not left, told=" ".join(left[:8]) or "yes"))
        self.checks += [side.log.check(name) for name, side in self.sides.items()]
        return self.checks

    def close(self) -> None:
        """Whatever happened, nothing stays."""
        for reader in self.readers:
            reader.stop()
        self.programs.stop()
        self.api.close()
        self.hub.close()

    def _read_streams(self) -> None:
        seed = self.options.seed
        self.readers.append(EventReader(PORT, seed, self.lock, self.stream, self.losses))
        if self.programs.hub:
            self.readers.append(HubReader(HUB_PORT, seed, self.lock, self.line_losses, "line-"))
        for reader in self.readers:
            reader.start()

    def _ready(self) -> bool:
        self._alive()
        if any(side.newest() is None for side in self.sides.values()):
            return False
        ready = self.api("GET", f"{V1}/readyz", starting=True).done
        return ready and (not self.programs.hub or self._hub_ready())

    def _hub_ready(self) -> bool:
        return self.hub("GET", f"{V1}/readyz", starting=True).done

    def _alive(self) -> None:
        for name, side in self.sides.items():
            if side.process.poll() is not None:
                last = "\n  ".join(list(side.log.last)[-20:])
                raise SoakError(f"the {name} ended with code {side.process.returncode}; its last lines:\n  {last}")

    def _until(self, what: str, seconds: float, condition: Any) -> float:
        began = time.monotonic()
        while not condition():
            self._alive()
            if time.monotonic() - began > seconds:
                self._look_closer()
                raise SoakError(f"not within {seconds:g} s: {what}; {self._described()}")
            time.sleep(0.25)
        return time.monotonic() - began

    def _look_closer(self) -> None:
        """Keep for the report what the drives that are away, and their controller, have to say."""
        for drive in self._away()[:5]:
            name = drive["name"]
            controller = self.sides.get("controller")
            lines = [line for line in controller.log.last if f'"{name}"' in line] if controller else []
            view = self.api("GET", f"{V1}/drives/{name}")
            self.closer.append({"drive": view.json() if view.done else drive, "controller": lines[-40:]})
        for side in self.sides.values():
            self.closer.append({"side": side.name, "noted": side.newest(), "log": list(side.log.last)[-100:]})

    def _drives(self) -> list[dict[str, Any]]:
        answer = self.api("GET", f"{V1}/drives")
        return answer.json()["drives"] if answer.done else []

    def _devices(self) -> list[dict[str, Any]]:
        answer = self.api("GET", f"{V1}/devices")
        return answer.json()["devices"] if answer.done else []

    def _away(self) -> list[dict[str, Any]]:
        """Drives that do not exchange data in operation (S4), and devices that exchange none."""
        drives = self._drives()
        away = [d for d in drives if (d["state"] != "S4" and d["name"] not in IDLE) or _unconnected(d)]
        away += [device for device in self._devices() if not device["connected"]]
        if self.programs.hub:
            away += self._away_from_line()
        return away or ([{"name": "all"}] if len(drives) != self.expected else [])

    def _away_from_line(self) -> list[dict[str, Any]]:
        """The same of the line, as the hub tells it."""
        answer = self.hub("GET", f"{V1}/drives")
        if not answer.done:
            return [{"name": "hub"}]
        drives = [d for d in answer.json()["drives"] if d["name"].startswith("line-")]
        away = [d for d in drives if d["state"] != "S4" or _unconnected(d)]
        return away or ([{"name": "line"}] if len(drives) != LINE_DRIVES else [])

    def _described(self) -> str:
        away = self._away()
        told = [
            f"{d['name']} {d.get('model')} {d.get('state')} {d.get('ar_state')} fault {d.get('fault')}"
            f" injected {d.get('faults_injected')} stw1 {d.get('stw1')} zsw1 {d.get('zsw1')}"
            for d in away[:6]
        ]
        return f"{len(away)} stations are away: " + "; ".join(told)

    # -- harm --------------------------------------------------------------------------------------------------------

    def _do_harm(self) -> None:
        options = self.options
        models = {drive["name"]: drive["model"] for drive in self._drives()}
        choices = Choices(options.seed, models, options.rate, devices=self.devices, pages=True)
        ports = [PORT, *([HUB_PORT] if self.programs.hub else [])]
        self.harm = Harm(self.api, choices, options.seed, self.lock, self.stream, ports)
        self.began = time.monotonic()
        end = self.began + options.hours * 3600
        calm = self.began + DISTURBED_SHARE * options.hours * 3600
        sample = told = self.began
        rest = self.began + REST_SECONDS
        disturb = self.began + self.rng.expovariate(1 / DISTURB_SECONDS)
        ask = self.began
        while (now := time.monotonic()) < end:
            self._alive()
            if now >= sample:
                sample += SAMPLE_SECONDS
                self._sample()
            if now >= told:
                told += TOLD_SECONDS
                self._tell()
            if now >= rest:
                self._settled()
                rest = time.monotonic() + REST_SECONDS
            if disturb <= now < calm:
                self._disturb()
                disturb = time.monotonic() + self.rng.expovariate(1 / DISTURB_SECONDS)
            if self.programs.hub and now >= ask:
                self._ask_hub()
                ask = now + self.rng.expovariate(1 / HUB_SECONDS)
            self.harm.close_pages(now)
            self.harm.clear_due(now)
            self.harm.act(choices.next())
            time.sleep(min(choices.pause(), max(0.0, end - time.monotonic())))

    def _disturb(self) -> None:
        """Stop, kill or pause a program other than the cell's farm, and have it back."""
        name = self.rng.choice([name for name in self.sides if name != "farm"])
        way = self.rng.choice(WAYS)
        what = f"{name.rstrip(' 12')}: {way}"
        if way != "pause":
            # a new process holds something else until it is settled
            self.sides[name].before = None
        with self._expected_losses(name, what):
            code = self.programs.disturb(name, way, self.rng)
            began = time.monotonic()
            if code != 0:
                self.harm.note(f"{what}: ended with code {code}")
            self._until(f"the {name} is up", START_SECONDS, lambda: self.sides[name].newest() is not None)
            if self.programs.hub:
                self._until("the hub is ready", START_SECONDS, self._hub_ready)
                self._until("the line is back", BACK_SECONDS, lambda: not self._away_from_line())
        self.harm.done[what] += 1
        seconds = time.monotonic() - began
        self.returns[f"{what}, program"] = max(self.returns.get(f"{what}, program", (0.0, "")), (seconds, name))

    @contextmanager
    def _expected_losses(self, name: str, what: str) -> Any:
        if name == "hub":
            yield
            return
        losses = self.losses if name == "controller" else self.line_losses
        with self.lock:
            outage = losses.begin(what, time.time())
        yield
        with self.lock:
            outage.end = time.time()

    def _ask_hub(self) -> None:
        """Look at all farms at once, or disturb the line through the hub."""
        rng = self.rng
        if rng.random() < 0.5:
            self.hub("GET", f"{V1}/{rng.choice(('drives', 'health', 'faults', 'devices', 'reactions', 'stations'))}")
            self.harm.done["look at the hub"] += 1
            return
        kind = rng.choice(HUB_FAULTS)
        fields: dict[str, Any] = {"kind": kind, "on": "line-*", "share": f"{rng.randint(10, 100)}%"}
        fields["seed"] = rng.randrange(1 << 30)
        if kind != "ar-abort":
            fields["for"] = f"{rng.randint(100, 2000)}ms"
        answer = self.hub("POST", f"{V1}/faults", fields)
        self.harm.done[f"fault through the hub {answer.status}"] += 1

    # -- rests -------------------------------------------------------------------------------------------------------

    def _settled(self, *, first: bool = False, last: bool = False) -> None:
        """Everything is taken back; every drive is to be in operation again, and nothing of a fault left."""
        if not first:
            self.harm.take_back(self.devices)
            if self.programs.hub:
                self.hub("POST", f"{V1}/reset")
            for drive, pnu in list(self.harm.before):
                self._until(f"{drive} takes {pnu} back", 30.0, lambda d=drive, p=pnu: self.harm.put_back(d, p))
        seconds = self._back()
        if self.programs.hub and not first:
            self._ask_stations()
        faults = self.api("GET", f"{V1}/faults").json()["faults"]
        if faults:
            self.harm.note(f"faults are left after a reset: {faults[:3]}")
        held = self._held_at_rest()
        for name, side in self.sides.items():
            calm = _calm(held[name])
            if side.before is None:
                side.before = calm
                continue
            check = same_as_before(name, side.before, calm, SLACK)
            if last:
                self.checks.append(check)
            elif not check.ok:
                self.harm.note(f"at rest, the {name}: {check.told}")
        self.rests.append({"seconds": self.seconds, "back_seconds": seconds, "held": held})
        if not first:
            print(f"  at rest: every station back after {seconds:.1f} s", flush=True)

    def _ask_stations(self) -> None:
        """As `pnfarm param` does, at moments that differ."""
        for station in STATIONS:
            time.sleep(self.rng.uniform(0.0, 1.0))  # an Idle telegram, due each half second, is under way now and then
            if why := ask_station(str(self.programs.profibus), station):
                self.harm.note(f"at rest, parameter of station {station}: {why}")

    def _held_at_rest(self) -> dict[str, Any]:
        """What all sides hold while every drive keeps its connection: one that is set up anew holds something else."""
        began = time.monotonic()
        while True:
            before = {drive["name"]: drive["connects"] for drive in self._drives()}
            time.sleep(3.0)  # connections are set up to their last phase
            at = time.time()
            held = {name: side.noted_after(at) for name, side in self.sides.items()}
            took = time.monotonic() - began
            is_calm = not self._away() and {drive["name"]: drive["connects"] for drive in self._drives()} == before
            if is_calm and (took > LINGER_SECONDS or not self._has_more_streams(held)):
                return held
            if took > STARVED_SECONDS:
                raise StarvedError(f"the drives do not keep their connections at rest; {self._described()}")
            self._back()

    def _has_more_streams(self, held: dict[str, Any]) -> bool:
        return any(
            _calm(held[name]).get("streams", 0) > side.before.get("streams", 0)
            for name, side in self.sides.items()
            if side.before is not None
        )

    def _back(self) -> float:
        """Wait until every station is back; the time that it took.

        It begins anew while the farm says that its own lateness breaks connections: the machine has no time for it.
        """
        began = until = time.monotonic()
        by_farm = -1
        while self._away():
            self._alive()
            drives = self._drives()
            lost = sum(drive["aborts_by_farm"] + drive["watchdog_expirations_by_farm"] for drive in drives)
            if lost > by_farm:
                by_farm, until = lost, time.monotonic() + BACK_SECONDS
            if time.monotonic() > min(until, began + STARVED_SECONDS):
                self._look_closer()
                starved = time.monotonic() > began + STARVED_SECONDS
                if starved:
                    raise StarvedError(f"the machine has no time for the farm; {self._described()}")
                raise SoakError(f"not within {BACK_SECONDS:g} s: every station is back; {self._described()}")
            time.sleep(0.25)
        return time.monotonic() - began

    def _finish(self) -> None:
        self._sample()
        self._settled(last=True)
        if self._away():
            # a busy machine may have lost one since
            self._back()
        away = self._away()
        self.checks.append(
            Check("every drive in operation", ok=not away, told=self._described() if away else f"{self.expected}")
        )
        faults = self.api("GET", f"{V1}/faults").json()["faults"]
        self.checks.append(Check("no fault left", ok=not faults, told=", ".join(f["id"] for f in faults[:5]) or "none"))
        plant = self.api("GET", f"{V1}/plant").json()["models"]
        stopped = [f"{model['name']}: {model['failure']}" for model in plant if model["failure"]]
        self.checks.append(Check("the plant runs", ok=not stopped, told="; ".join(stopped) or f"{len(plant)} models"))
        newest = self._newest()
        self._until("the stream has caught up", 30.0, lambda: self.stream.last >= newest)
        self._until("every station is back in the stream", 30.0, lambda: not self.losses.away)
        self._take_pauses()
        with self.lock:
            self.stream.resumed = self.readers[0].resumed
            self.stream.wrong += self.readers[0].broken
            self.checks += self.stream.checks(newest)
            self.checks += self.losses.checks()
            if self.programs.hub:
                self.checks += [self.readers[1].order.check(), *self.line_losses.checks("of the line")]
        for reader in self.readers:
            reader.stop()
        kinds = self.harm.kinds
        requests = self.api.requests + self.hub.requests
        told = f"{requests:,} requests, {sum(kinds.values()):,} faults of {len(kinds)} kinds"
        pauses = [(what, self.sides["farm"].paused(since, until)) for since, until, what in self.api.timeouts]
        pauses += [(f"hub: {what}", self.sides["hub"].paused(since, until)) for since, until, what in self.hub.timeouts]
        wrong = [*self.api.failures, *(f"hub: {what}" for what in self.hub.failures), *self.harm.wrong]
        self.checks += answered(wrong, pauses, 2 * NOTE_SECONDS, told)

    def _newest(self) -> int:
        text = self.api("GET", f"{V1}/events?follow=false&after={max(0, self.stream.last - 1)}").text
        numbers = [int(line.rpartition("-")[2]) for line in text.split("\n") if line.startswith("id: ")]
        return max(numbers, default=self.stream.last)

    # -- samples -----------------------------------------------------------------------------------------------------

    def _sample(self) -> None:
        sample: dict[str, Any] = {"seconds": self.seconds}
        for name, side in self.sides.items():
            sample[f"{name} cpu"] = side.processor_seconds
            if (noted := side.newest()) is None:
                continue
            process = noted["process"]
            sample[f"{name} pid"] = side.process.pid
            sample |= {
                f"{name} {key}": process[key]
                for key in ("rss", "own", "heap", "heap free", "blocks", "threads", "files")
            }
            sample[f"{name} tasks"] = sum(_lasting(process["tasks"]).values())
            sample[f"{name} rows"] = rows(noted["holds"])
        self.samples.append(sample)
        self._take_pauses()

    def _take_pauses(self) -> None:
        """When a controller's process did not run: a reason for what it lost."""
        with self.lock:
            for name, losses in (("controller", self.losses), ("line controller", self.line_losses)):
                for what, begin, seconds in self.sides[name].stood() if name in self.sides else ():
                    self._paused.append((name, what, begin, seconds))
                    if seconds >= EXPIRES_SECONDS:
                        losses.stood(f"the {name}'s {what} did not run", begin, seconds)

    def _keep_unexplained(self) -> None:
        """What the controller has to say to losses without a reason."""
        lines = list(self.sides["controller"].log.last)
        kept = [one["at"] for one in self.closer if "at" in one]
        for lost, at in self.losses.unexplained_at.items():
            # several at one moment have one reason
            if len(self.closer) >= MOST_KEPT or any(abs(at - other) < AROUND_SECONDS for other in kept):
                continue
            kept.append(at)
            stood = [one for one in self._paused if abs(at - one[2]) < 2 * AROUND_SECONDS]
            around = self.losses.around(at, AROUND_SECONDS)
            self.closer.append({"lost": lost, "at": at, "around": around, "stood": stood, "controller": lines[-40:]})

    def _tell(self) -> None:
        self._keep_unexplained()
        newest, first = self.samples[-1], self.samples[0]
        spent = newest["seconds"] - first["seconds"]
        used = sum(newest[f"{name} cpu"] - first[f"{name} cpu"] for name in self.sides)
        sides = ", ".join(f"{name} {newest.get(f'{name} rss', 0) >> 20} MiB" for name in self.sides)
        wrong = len(self.api.failures) + len(self.hub.failures) + len(self.harm.wrong)
        print(
            f"{newest['seconds'] / 60:6.1f} min  {sides}, {sum(self.harm.kinds.values())} faults,"
            f" {self.stream.entries:,} events, {sum(self.losses.by_reason.values())} losses,"
            f" {used / spent if spent else 0.0:.2f} cores, {wrong} wrong",
            flush=True,
        )

    def report(self) -> dict[str, Any]:
        """What a piece is kept as."""
        harm = getattr(self, "harm", None)
        losses, line = self.losses.report(), self.line_losses.report()
        return {
            # places of files are this machine's
            "options": {key: value for key, value in vars(self.options).items() if not isinstance(value, Path)},
            "seconds": self.samples[-1]["seconds"] if self.samples else 0.0,
            "checks": [{"name": c.name, "ok": c.ok, "told": c.told} for c in self.checks],
            "actions": dict(harm.done.most_common()) if harm else {},
            "kinds": dict(harm.kinds.most_common()) if harm else {},
            "events": dict(self.stream.kinds.most_common()),
            "wrong": harm.wrong if harm else [],
            "failures": self.api.failures[:100] + self.hub.failures[:100],
            "losses": {**losses["losses"], **{f"line: {why}": count for why, count in line["losses"].items()}},
            "unexplained": losses["unexplained"] + line["unexplained"],
            "returns": {
                **self.returns,
                **losses["returns"],
                **{f"line: {why}": value for why, value in line["returns"].items()},
            },
            "rests": self.rests,
            "closer": self.closer,
            "samples": self.samples,
            "objects": {name: side.objects() for name, side in self.sides.items()},
            "logs": {
                name: {"levels": dict(side.log.levels), "suspicious": side.log.suspicious}
                for name, side in self.sides.items()
            },
        }


def _unconnected(drive: dict[str, Any]) -> bool:
    return drive["cycle_seconds"] is None or drive["fault"] is not None


def _lasting(tasks: dict[str, int]) -> dict[str, int]:
    return {name: count for name, count in tasks.items() if not any(word in name for word in PASSING_TASKS)}


def _calm(noted: dict[str, Any]) -> dict[str, Any]:
    """What is to be the same whenever the farm is quiet."""
    process = noted["process"]
    return {
        **noted["holds"],
        "tasks": _lasting(process["tasks"]),
        **{key: process[key] for key in ("threads", "files", "garbage")},
    }


def _interfaces() -> set[str]:
    lines = Path("/proc/self/net/dev").read_text("ascii").split("\n")[2:]
    return {line.partition(":")[0].strip() for line in lines if line}


def _interrupt(number: int, frame: object) -> None:
    del frame
    # once: what follows is the clean-up
    for each in STOP_SIGNALS:
        signal.signal(each, signal.SIG_IGN)
    raise KeyboardInterrupt(signal.Signals(number).name)


def main(options: argparse.Namespace) -> int:
    """0: everything held; 1: something did not; 3: the machine let the farm not run; 130: a signal ended it."""
    for number in STOP_SIGNALS:
        # also where a shell had it ignored, as behind an &
        signal.signal(number, _interrupt)
    with tempfile.TemporaryDirectory(prefix="pnfarm-soak-") as name:
        run = RealRun(options, Path(name))
        code = 1
        try:
            checks = run.go()
            starved = any(check.name == "the machine let the farm run" for check in checks)
            code = 1 if any(check.ok is False for check in checks) else 3 if starved else 0
        except StarvedError as exc:
            run.checks.append(Check("the machine let the farm run", ok=None, told=str(exc)))
            code = 3
        except SoakError as exc:
            run.checks.append(Check("the run", ok=False, told=str(exc)))
        except KeyboardInterrupt:
            run.checks.append(Check("the run", ok=None, told="interrupted"))
            code = 130
        finally:
            run.close()
            options.out.write_text(json.dumps(run.report(), indent=1, default=str) + "\n")
        print(f"\n{shown(run.checks)}", flush=True)
    return code
