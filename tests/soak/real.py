"""The run in real time: a farm and a controller as processes in a network namespace, and a client that does harm."""

# ruff: noqa: T201 - what it prints is its answer

from __future__ import annotations

import argparse
import json
import os
import signal
import tempfile
import threading
import time
from collections import Counter
from contextlib import ExitStack
from pathlib import Path
from random import Random
from typing import Any
from urllib.parse import quote

from tests.soak.choices import Action, Choices, farm_text
from tests.soak.client import Answer, Api, EventReader
from tests.soak.judge import Check, Stream, answered, memory_checks, same_as_before, shown
from tests.soak.side import NOTE_SECONDS, SAMPLE_SECONDS, Side, SoakError, StarvedError

__all__ = ["RealRun", "main"]

PORT = 8702
V1 = "/api/v1"
STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM)
#: Between two lines on the terminal, two rests.
TOLD_SECONDS, REST_SECONDS = 60.0, 600.0
#: A start may compile; after a rest's reset every drive is back within this time, on a machine that others use.
START_SECONDS, BACK_SECONDS = 300.0, 90.0
#: The longest that a rest waits on a machine that does not let the farm keep its cycles.
STARVED_SECONDS = 900.0
#: The number of blocks rises until the collection of garbage: its lowest value in so much time counts.
BLOCKS_SECONDS = 120.0
#: A fault without an end of its own is cleared after this time, on average; a written parameter is put back.
HELD_SECONDS = 15.0
#: What a side may hold more of at the end: connections of HTTP and workers of a pool come and go.
SLACK = {"threads": 8, "files": 12, "garbage": 0, "replies kept": 1 << 30, "calls": 0, "searches": 0, "traces": 0,
         "fault timers": 0}  # fmt: skip
#: Tasks that serve requests and streams: they come and go.
PASSING_TASKS = (
    "RequestResponseCycle",
    "Throttle",
    "event_stream",
    "StreamingResponse",
    "listen_for_disconnect",
    "wrap",
)


class RealRun:
    """``options``: hours, seed, drives, link, rate."""

    def __init__(self, options: argparse.Namespace, folder: Path) -> None:
        self.options = options
        self.folder = folder
        self.api = Api(PORT)
        self.lock = threading.Lock()
        self.stream = Stream()
        self.samples: list[dict[str, Any]] = []
        self.done: Counter[str] = Counter()
        self.kinds: Counter[str] = Counter()
        self.wrong: list[str] = []
        self.rests: list[dict[str, Any]] = []
        self.closer: list[dict[str, Any]] = []
        self.due: list[tuple[float, str]] = []  # faults without an end: when they are cleared
        self.before: dict[tuple[str, str], int] = {}  # parameters that were written: their values
        self.began = time.monotonic()
        self.farm: Side
        self.plc: Side
        self.reader: EventReader
        self.checks: list[Check] = []

    # -- the run -----------------------------------------------------------------------------------------------------

    def go(self) -> list[Check]:
        text = farm_text(self.options.drives, self.options.link, f"127.0.0.1:{PORT}")
        file = self.folder / "soak.pnfarm.yml"
        file.write_text(text)
        interfaces = _interfaces()
        with ExitStack() as stack:
            self.farm = Side("farm", self.folder, "up", file)
            stack.callback(self.farm.stop)
            self._until("the farm is up", START_SECONDS, lambda: bool(self._ready()))
            self.plc = Side("controller", self.folder, "plc", file, "--format", "json")
            stack.callback(self.plc.stop)
            self.reader = EventReader(PORT, self.options.seed, self.lock, self.stream)
            self.reader.start()
            self._until("every drive is in operation", START_SECONDS, lambda: not self._away())
            time.sleep(5.0)
            self._settled(first=True)
            self._harm()
            self._finish()
            stack.pop_all()
        codes = [(side.name, side.stop()) for side in (self.plc, self.farm)]
        bad = [f"{name} {code}" for name, code in codes if code != 0]
        self.checks.append(Check("both ended by Ctrl-C with code 0", ok=not bad, told=", ".join(bad) or "yes"))
        left = sorted(_interfaces() - interfaces)
        self.checks.append(Check("interfaces gone", ok=not left, told=" ".join(left[:8]) or "yes"))
        self.checks += [side.log.check(side.name) for side in (self.farm, self.plc)]
        return self.checks

    def close(self) -> None:
        """Whatever happened, nothing stays."""
        for name in ("reader", "plc", "farm"):
            if hasattr(self, name):
                getattr(self, name).stop()
        self.api.close()

    def _ready(self) -> bool:
        self._alive()
        if self.farm.newest() is None:
            return False
        return self.api("GET", f"{V1}/readyz", starting=True).done

    def _alive(self) -> None:
        for name in ("farm", "plc"):
            side = getattr(self, name, None)
            if side is not None and side.process.poll() is not None:
                last = "\n  ".join(list(side.log.last)[-20:])
                raise SoakError(f"the {side.name} ended with code {side.process.returncode}; its last lines:\n  {last}")

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
            lines = [line for line in self.plc.log.last if f'"{name}"' in line] if hasattr(self, "plc") else []
            view = self.api("GET", f"{V1}/drives/{name}")
            self.closer.append({"drive": view.json() if view.done else drive, "controller": lines[-40:]})
        for side in (getattr(self, "farm", None), getattr(self, "plc", None)):
            if side is not None:
                self.closer.append({"side": side.name, "noted": side.newest(), "log": list(side.log.last)[-100:]})

    def _drives(self) -> list[dict[str, Any]]:
        answer = self.api("GET", f"{V1}/drives")
        return answer.json()["drives"] if answer.done else []

    def _away(self) -> list[dict[str, Any]]:
        """Drives that do not exchange data in operation (S4)."""
        drives = self._drives()
        away = [d for d in drives if d["state"] != "S4" or d["cycle_seconds"] is None or d["fault"] is not None]
        return away or ([{"name": "all"}] if len(drives) != self.options.drives else [])

    def _described(self) -> str:
        away = self._away()
        told = [
            f"{d['name']} {d.get('model')} {d.get('state')} {d.get('ar_state')} fault {d.get('fault')}"
            f" injected {d.get('faults_injected')} stw1 {d.get('stw1')} zsw1 {d.get('zsw1')}"
            for d in away[:6]
        ]
        return f"{len(away)} drives are away: " + "; ".join(told)

    # -- harm --------------------------------------------------------------------------------------------------------

    def _harm(self) -> None:
        options = self.options
        models = {drive["name"]: drive["model"] for drive in self._drives()}
        self.choices = Choices(options.seed, models, options.rate)
        self.rng = Random(f"times/{options.seed}")
        self.began = time.monotonic()
        end = self.began + options.hours * 3600
        sample = told = self.began
        rest = self.began + REST_SECONDS
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
            self._clear_due(now)
            self._act(self.choices.next())
            time.sleep(min(self.choices.pause(), max(0.0, end - time.monotonic())))

    def _act(self, action: Action) -> None:
        answer: Answer | None = None
        fields = action.fields
        match action.what:
            case "fault" | "invalid":
                answer = self.api("POST", f"{V1}/faults", fields)
                if action.what == "fault" and answer.done:
                    self._injected(answer.json(), fields)
            case "dry-run":
                answer = self.api("POST", f"{V1}/faults?dry_run=true", fields)
            case "clear":
                if self.due:
                    _, name = self.due.pop(self.rng.randrange(len(self.due)))
                    self._clear(name)
            case "reset":
                self.due.clear()
                answer = self.api("POST", f"{V1}/reset")
            case "power-cycle":
                answer = self.api("POST", f"{V1}/drives/{action.drive}/power-cycle")
            case "write":
                answer = self._write(action.drive, fields["pnu"])
            case "wrong-write":
                path = f"{V1}/drives/{action.drive}/params/{quote(fields['pnu'], safe='')}"
                answer = self.api("PUT", path, {"value": fields["value"]})
            case "trace":
                answer = self._trace(fields)
            case "scenario":
                answer = self.api("POST", f"{V1}/scenarios", fields)
                if answer.done and self.rng.random() < 0.2:
                    self.api("DELETE", f"{V1}/scenarios/{answer.json()['id']}")
            case "scrape":
                answer = self.api("GET", "/metrics")
                if not answer.text.startswith("#"):
                    self._note(f"/metrics: {answer.status} {answer.text[:200]}")
            case "look":
                paths = (f"{V1}/drives/{action.drive}", f"{V1}/drives/{action.drive}/controller", f"{V1}/faults",
                         f"{V1}/traces", f"{V1}/scenarios", "/")  # fmt: skip
                answer = self.api("GET", self.rng.choice(paths))
        self.done[action.what] += 1
        if answer is not None:
            self.done[f"{action.what} {answer.status}"] += 1
            if action.refused and answer.status and not answer.refused:
                self._note(f"{action} was not refused: {answer.status} {answer.text[:300]}")

    def _injected(self, view: dict[str, Any], fields: Any) -> None:
        self.kinds[view["kind"]] += 1
        with self.lock:
            self.stream.acknowledged(view["id"])
        if view["state"] != "ended":
            self.due.append((time.monotonic() + self.rng.expovariate(1 / HELD_SECONDS), view["id"]))

    def _clear(self, name: str) -> None:
        """One fault; it may have ended by itself, which the farm answers with 404."""
        answer = self.api("DELETE", f"{V1}/faults/{name}")
        self.done[f"clear {answer.status}"] += 1
        if answer.status not in {0, 200, 404}:
            self._note(f"clearing {name}: {answer.status} {answer.text[:300]}")

    def _clear_due(self, now: float) -> None:
        for at, name in [entry for entry in self.due if entry[0] <= now]:
            self.due.remove((at, name))
            self._clear(name)

    def _write(self, drive: str, pnu: str) -> Answer:
        path = f"{V1}/drives/{drive}/params/{pnu}"
        answer = self.api("GET", path)
        if not answer.done:
            return answer
        seen = answer.json()
        if (drive, pnu) in self.before and self.rng.random() < 0.5:
            answer = self.api("PUT", path, {"value": self.before[drive, pnu]})
            if answer.done:
                del self.before[drive, pnu]
            return answer
        answer = self.api("PUT", path, {"value": self.choices.value(seen["minimum"], seen["maximum"])})
        if answer.done:
            self.before.setdefault((drive, pnu), seen["value"])
        return answer

    def _trace(self, fields: Any) -> Answer:
        answer = self.api("POST", f"{V1}/traces", fields)
        if answer.refused:
            kept = self.api("GET", f"{V1}/traces").json()["traces"]
            if len(kept) > 8:
                for trace in kept[:4]:
                    self.api("GET", f"{V1}/traces/{trace['id']}?format=csv")
                    self.api("DELETE", f"{V1}/traces/{trace['id']}")
        return answer

    def _note(self, what: str) -> None:
        if len(self.wrong) < 100:
            self.wrong.append(what)
            print(f"  wrong: {what}", flush=True)

    # -- rests -------------------------------------------------------------------------------------------------------

    def _settled(self, *, first: bool = False, last: bool = False) -> None:
        """Everything is taken back; every drive is to be in operation again, and nothing of a fault left."""
        if not first:
            self.due.clear()
            for scenario in self.api("GET", f"{V1}/scenarios").json()["scenarios"]:
                # one whose task died is answered by 500
                self.api("GET", f"{V1}/scenarios/{scenario['id']}")
                self.api("DELETE", f"{V1}/scenarios/{scenario['id']}")
            for trace in self.api("GET", f"{V1}/traces").json()["traces"]:
                self.api("DELETE", f"{V1}/traces/{trace['id']}")
            self.api("POST", f"{V1}/reset")
            for (drive, pnu), value in list(self.before.items()):
                self._until(f"{drive} takes {pnu} back", 30.0, lambda d=drive, p=pnu, v=value: self._put_back(d, p, v))
                del self.before[drive, pnu]
        seconds = self._back()
        faults = self.api("GET", f"{V1}/faults").json()["faults"]
        if faults:
            self._note(f"faults are left after a reset: {faults[:3]}")
        held = self._held_at_rest()
        for side in (self.farm, self.plc):
            calm = _calm(held[side.name])
            if side.before is None:
                side.before = calm
                continue
            check = same_as_before(side.name, side.before, calm, SLACK)
            if last:
                self.checks.append(check)
            elif not check.ok:
                self._note(f"at rest, the {side.name}: {check.told}")
        self.rests.append({"seconds": time.monotonic() - self.began, "back_seconds": seconds, "held": held})
        if not first:
            print(f"  at rest: every drive back after {seconds:.1f} s", flush=True)

    def _held_at_rest(self) -> dict[str, Any]:
        """What both sides hold while every drive keeps its connection: one that is set up anew holds something else."""
        end = time.monotonic() + STARVED_SECONDS
        while True:
            before = {drive["name"]: drive["connects"] for drive in self._drives()}
            time.sleep(3.0)  # connections are set up to their last phase
            at = time.time()
            held = {side.name: side.noted_after(at) for side in (self.farm, self.plc)}
            if not self._away() and {drive["name"]: drive["connects"] for drive in self._drives()} == before:
                return held
            if time.monotonic() > end:
                raise StarvedError(f"the drives do not keep their connections at rest; {self._described()}")
            self._back()

    def _back(self) -> float:
        """Wait until every drive is back; the time that it took.

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
                raise SoakError(f"not within {BACK_SECONDS:g} s: every drive is back; {self._described()}")
            time.sleep(0.25)
        return time.monotonic() - began

    def _put_back(self, drive: str, pnu: str, value: int) -> bool:
        """False while the drive is off or boots."""
        return self.api("PUT", f"{V1}/drives/{drive}/params/{pnu}", {"value": value}).done

    def _finish(self) -> None:
        self._sample()
        self._settled(last=True)
        away = self._away()
        self.checks.append(
            Check("every drive in operation", ok=not away, told=self._described() if away else f"{self.options.drives}")
        )
        faults = self.api("GET", f"{V1}/faults").json()["faults"]
        self.checks.append(Check("no fault left", ok=not faults, told=", ".join(f["id"] for f in faults[:5]) or "none"))
        sides = (self.farm.name, self.plc.name)
        self.checks += memory_checks(self.samples, [f"{name} rss" for name in sides])
        self.checks += memory_checks(self.samples, [f"{name} blocks" for name in sides], stretch=BLOCKS_SECONDS)
        newest = self._newest()
        self._until("the stream has caught up", 30.0, lambda: self.stream.last >= newest)
        with self.lock:
            self.checks += self.stream.checks(newest)
        self.reader.stop()
        told = f"{self.api.requests:,} requests, {sum(self.kinds.values()):,} faults of {len(self.kinds)} kinds"
        pauses = [(what, self.farm.paused(since, until)) for since, until, what in self.api.timeouts]
        self.checks += answered([*self.api.failures, *self.wrong], pauses, 2 * NOTE_SECONDS, told)

    def _newest(self) -> int:
        text = self.api("GET", f"{V1}/events?follow=false&after={max(0, self.stream.last - 1)}").text
        numbers = [int(line[4:]) for line in text.split("\n") if line.startswith("id: ")]
        return max(numbers, default=self.stream.last)

    # -- samples -----------------------------------------------------------------------------------------------------

    def _sample(self) -> None:
        sample: dict[str, Any] = {"seconds": time.monotonic() - self.began}
        for side in (self.farm, self.plc):
            noted = side.newest()
            if noted is not None:
                sample.update({f"{side.name} {key}": value for key, value in noted["process"].items()})
                sample[f"{side.name} holds"] = noted["holds"]
            sample[f"{side.name} cpu"] = _processor_seconds(side.process.pid)
        self.samples.append(sample)

    def _tell(self) -> None:
        newest = self.samples[-1]
        first = self.samples[0]
        spent = newest["seconds"] - first["seconds"]
        cpu = [
            (newest[f"{side.name} cpu"] - first[f"{side.name} cpu"]) / spent if spent else 0.0
            for side in (self.farm, self.plc)
        ]
        sides = ", ".join(
            f"{side.name} {newest[f'{side.name} rss'] >> 10:,} KiB {newest[f'{side.name} blocks']:,} blocks"
            for side in (self.farm, self.plc)
        )
        print(
            f"{newest['seconds'] / 60:6.1f} min  {sides}, {sum(self.kinds.values())} faults,"
            f" {newest['farm holds']['faults']} in force, {self.stream.entries:,} events,"
            f" cpu {cpu[0]:.0%} + {cpu[1]:.0%}, {len(self.api.failures) + len(self.wrong)} wrong",
            flush=True,
        )

    def report(self) -> dict[str, Any]:
        return {
            "options": vars(self.options),
            "checks": [{"name": c.name, "ok": c.ok, "told": c.told} for c in self.checks],
            "actions": dict(self.done.most_common()),
            "kinds": dict(self.kinds.most_common()),
            "events": dict(self.stream.kinds.most_common()),
            "wrong": self.wrong,
            "failures": self.api.failures[:100],
            "rests": self.rests,
            "closer": self.closer,
            "samples": self.samples,
            "logs": {
                side.name: {"levels": dict(side.log.levels), "suspicious": side.log.suspicious}
                for side in (getattr(self, "farm", None), getattr(self, "plc", None))
                if side is not None
            },
        }


def _calm(noted: dict[str, Any]) -> dict[str, Any]:
    """What is to be the same whenever the farm is quiet."""
    process = noted["process"]
    tasks = {name: count for name, count in process["tasks"].items() if not any(word in name for word in PASSING_TASKS)}
    return {**noted["holds"], "tasks": tasks, **{key: process[key] for key in ("threads", "files", "garbage")}}


def _interfaces() -> set[str]:
    lines = Path("/proc/self/net/dev").read_text("ascii").split("\n")[2:]
    return {line.partition(":")[0].strip() for line in lines if line}


def _processor_seconds(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text("ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


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
            if options.out is not None:
                options.out.write_text(json.dumps(run.report(), indent=1, default=str) + "\n")
        print(f"\n{shown(run.checks)}", flush=True)
    return code
