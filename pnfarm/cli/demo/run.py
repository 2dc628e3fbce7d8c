"""The steps of the demo: connect, run, inject faults, recover, carry out a scenario, report."""

from __future__ import annotations

import asyncio
import contextlib
import io
import re
import sys
import time
from collections.abc import Awaitable, Callable
from contextlib import AsyncExitStack
from typing import TYPE_CHECKING, Any

import anyio
from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from pnfarm.bench.line import percentile
from pnfarm.cli.demo.faults import FAULTS
from pnfarm.cli.demo.scenario import demo_binding, write_report
from pnfarm.cli.farm_file import counted
from pnfarm.controller.line import VirtualLine
from pnfarm.controller.runtime import Plc
from pnfarm.drives.profiles.profidrive.parameter_channel import LOCAL
from pnfarm.errors import ConfigError
from pnfarm.farm.capture import CaptureSettings, prepare
from pnfarm.farm.farm import Farm
from pnfarm.farm.file.reading import parse_farm
from pnfarm.farm.views.snapshot import drive_snapshot
from pnfarm.faults.manager import RunState
from pnfarm.metrics import FarmCollector
from pnfarm.scenario.lateness import FarmLateness
from pnfarm.scenario.realtime import carry_out
from pnfarm.scenario.run import ScenarioRun
from pnfarm.scenario.virtual import carry_on
from pnfarm.station.event_log import EventLog
from pnfarm.terminal.output import print_next

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from pnfarm.cli.demo.faults import DemoFault
    from pnfarm.controller.group import Controllers
    from pnfarm.farm.core import FarmCore
    from pnfarm.farm.virtual import VirtualWorld
    from pnfarm.faults.manager import Injection, InjectionManager
    from pnfarm.scenario.definition.steps import Step
    from pnfarm.scenario.report.record import Case
    from pnfarm.station.event_log import LogEntry

__all__ = ["Demo"]

#: Wall time between two checks of a condition.
POLL_SECONDS = 0.02
#: Time limit of each stage, after which the demo has failed.
STAGE_SECONDS = 20.0
LOG_LINES = 8
#: How often the scenario is carried out at most, where the machine stalls.
SCENARIO_TRIES = 3
#: In memory, the stretches of time in which the scenario runs and the display stands.
STRETCH_NS = 50_000_000
#: The controllers' event, on every bus.
CONNECTION_LOST = "connection lost"
#: Of the live table; those with > are to the right.
_COLUMNS = ("drive", "model", "state", ">set point", ">speed", ">current", ">cycle", ">sent", ">received", "fault")


class Demo:
    """``text`` is the farm file; ``begin`` is when the command started, for the time to the first connection."""

    def __init__(
        self,
        text: str,
        *,
        in_memory: bool,
        seconds: float,
        begin: float,
        picture: Path | None = None,
        pcap: Path | None = None,
        report: Path | None = None,
    ) -> None:
        self._pcap = pcap
        self._report_file = report
        self._scenario: dict[str, Any] | None = None
        self._picture_file = picture
        self._config = parse_farm(text)
        self._in_memory = in_memory
        self._seconds = seconds
        self._begin = begin
        self._log_lines: list[str] = []
        self._injected: dict[str, list[str]] = {}
        self._recovered: dict[str, bool] = {}
        # a pipe has no width, and 80 columns would truncate the table
        self._console = Console(emoji=False, width=None if sys.stdout.isatty() else 132)
        self._live: Live | None = None
        self._line: VirtualLine | None = None
        #: End, with its exception, when the farm or the controller has failed.
        self._watched: list[asyncio.Future[None]] = []
        self._farm: FarmCore
        self._plc: Controllers
        self._injections: InjectionManager
        self._now: Callable[[], int] = time.monotonic_ns
        self._poke: Callable[[], None] = lambda: None

    # -- stages ------------------------------------------------------------------------------------------------------

    async def run(self) -> dict[str, Any]:
        """Run the whole demo and return its summary."""
        async with AsyncExitStack() as stack:
            release = await self._open(stack)
            if self._console.is_terminal:
                self._live = stack.enter_context(Live(console=self._console, refresh_per_second=8, transient=True))
            ok = await self._stages() and await self._carry_out()
            summary = self._summary(ok)
            if self._picture_file is not None:
                self._draw(self._picture_file)
            self._live = None
            await release()
        self._report(summary)
        return summary

    async def _open(self, stack: AsyncExitStack) -> Callable[[], Awaitable[object]]:
        quiet, plc_log = EventLog(quiet=True), EventLog(quiet=True)
        stack.callback(plc_log.subscribe(self._happened))
        if self._in_memory:
            line = await VirtualLine.create(self._config, log=quiet, plc_log=plc_log, pcap=self._pcap)
            stack.push_async_callback(line.close)
            self._line, self._farm, self._plc = line, line.farm, line.controllers
            self._injections = line.farm.injections
            self._now = line.world.clock

            async def release_in_memory() -> None:
                self._plc.release(self._now())
                line.world.run(1.0, until=lambda: self._plc.all_stopped)

            return release_in_memory
        capture = None
        if self._pcap is not None:
            capture = CaptureSettings(self._pcap)
            prepare()
        farm = await stack.enter_async_context(Farm(self._config, log=quiet, capture=capture))
        plc = await stack.enter_async_context(Plc(self._config, log=plc_log))
        self._farm, self._plc, self._injections = farm.core, plc.controllers, farm.injections

        def poke() -> None:
            farm.driver.poke()
            plc.driver.poke()

        self._poke = poke
        for waiting in (farm.wait(), plc.wait()):
            watched = asyncio.ensure_future(waiting)
            self._watched.append(watched)
            stack.callback(watched.cancel)
        return plc.release

    async def _stages(self) -> bool:
        names = [row["name"] for row in self._plc.snapshot()]
        first = await self._until(lambda: any(row["connects"] for row in self._plc.snapshot()))
        self._log(f"first drive connected {time.monotonic() - self._begin:.1f} s after the start")
        connected = first and await self._until(lambda: self._plc.all_connected)
        if not connected:
            self._log("not every drive connected")
            return False
        self._log(f"{len(names)} drives exchange data, each in a cycle that its manual allows")
        if not await self._until(lambda: self._plc.all_running):
            self._log("not every axis was enabled")
            return False
        self._log("the controller enabled every axis (S4, operation) and runs a sine of 600 rpm")
        end = self._now() + round(self._seconds * 1e9)
        await self._pass(1.5)
        ok = True
        for fault in FAULTS:
            ok = await self._break(fault, names) and ok
        while self._now() < end:
            await self._pass(min(0.25, (end - self._now()) / 1e9))
        return ok

    async def _carry_out(self) -> bool:
        """Carry out the scenario and write its report; True unless it failed.

        It is repeated where the machine itself made it inconclusive.
        """
        verdict = "inconclusive"
        for left in reversed(range(SCENARIO_TRIES)):
            # a machine that stalled may have cost a connection meanwhile
            if not await self._until(lambda: self._plc.all_running):
                self._log("not every axis is in operation")
                self._tell_missing()
                return False
            verdict = await self._scenario_once()
            if verdict != "inconclusive":
                break
            if left:
                self._log("this machine stalled meanwhile: the scenario once more")
        return verdict in {"passed", "inconclusive"} and await self._until(lambda: self._plc.all_running)

    def _tell_missing(self) -> None:
        """Which axes do not run, as the controller and the drive see it."""
        for row in self._plc.snapshot():
            if row["phase"] == "running":
                continue
            station = self._farm.axis(row["name"])
            seen = drive_snapshot(self._farm, station, self._now(), injected={})
            why = f", {row['last_reason']}" if row["last_reason"] else ""
            fault = f", F{seen['fault']['number']}" if seen["fault"] else ""
            self._log(
                f"{row['name']}: the controller is {row['state']}, {row['phase']}{why}; the drive {seen['ar_state']}, "
                f"{seen['state']}{fault}"
            )

    async def _scenario_once(self) -> str:
        """Its verdict."""
        names = [row["name"] for row in self._plc.snapshot()]
        binding = demo_binding(self._farm, names[min(1, len(names) - 1)], names)
        self._log(f"scenario {binding.scenario.name}: {binding.scenario.description}")
        collector = FarmCollector(self._farm)
        try:
            lateness = None if self._in_memory else FarmLateness(self._farm, None, self._now())
            run = ScenarioRun(
                binding, self._farm, collector, self._now(), lateness=lateness, traced=True, tell=self._told
            )
            if self._line is None:
                await carry_out(run, self._farm, self._poke, passing=self._passing)
            else:
                while not run.finished:
                    self._refresh()
                    await self._pace(self._line.world, lambda world: carry_on(run, world, STRETCH_NS))
        finally:
            collector.close()
        record = run.record.as_dict()
        verdict, counts = record["verdict"], ", ".join(f"{n} {word}" for word, n in record["counts"].items() if n)
        self._log(f"verdict on the PLC program: {verdict} ({counts})")
        try:
            report: str | None = str(write_report(record, self._report_file))
        except OSError as exc:
            report = None
            self._log(f"the report cannot be written: {exc}")
        self._scenario = {
            "name": record["scenario"],
            "verdict": verdict,
            "expectations": [{key: case[key] for key in ("name", "verdict", "measured")} for case in record["cases"]],
            "report": report,
        }
        return str(verdict)

    def _told(self, step: Step, case: Case | None) -> None:
        if case is not None:
            self._log(f"{case.verdict.value}: {step.title}" + (f", {case.measured}" if case.measured else ""))

    def _happened(self, entry: LogEntry) -> None:
        """A connection that the controller lost, with its reason: what was injected, or this machine's own doing."""
        if entry.event == CONNECTION_LOST:
            self._log(f"the controller lost {entry.drive}: {entry.data['reason']}")

    def _refresh(self) -> None:
        if self._live is not None:
            self._live.update(self._picture())

    def _passing(self, run: ScenarioRun, now: int) -> str:
        del run, now
        self._refresh()
        return ""

    async def _break(self, fault: DemoFault, names: Sequence[str]) -> bool:
        """Inject one fault, wait for its end, and check that the drive is back in operation."""
        start, family = self._now(), self._injections.catalogue[fault.kind].family
        injection = self._inject(fault, names, start)
        if injection is None:
            self._log(f"{fault.kind} ({family}): no drive of this farm can have it")
            return True
        (name,) = injection.drives
        station = self._farm.axis(name)
        before, faults_before = station.device.connects, dict(station.fault_counts)
        self._injected.setdefault(name, []).append(fault.kind)
        self._recovered[name] = False
        self._log(f"injecting {fault.kind} ({family}) on {name} ({station.model.name})")
        record = self._plc.access_record(name, LOCAL, None, start) if fault.reads else None
        self._poke()
        if not await self._until(lambda: injection.state is RunState.ENDED and (record is None or record.done)):
            self._log(f"{fault.kind} on {name} did not end")
            return False
        acted = injection.evidence().activations
        if not acted:
            self._log(f"{fault.kind} had no effect on {name}")
            return False

        def back() -> bool:
            return (
                station.device.connects >= before + fault.disconnects
                and int(station.handle.axis.drive.state) == 4
                and int(station.handle.axis.faults.code[0]) == 0
                and self._plc.exchanging(name)
            )

        recovered = await self._until(back)
        seen = [f"F{n}" for n, count in station.fault_counts.items() if count > faults_before.get(n, 0)]
        seen += ["its connection ended"] * fault.disconnects + ([record.failure] if record is not None else [])
        what = ", ".join(seen) or f"acted {counted(acted, 'time')}"
        if not recovered:
            self._log(f"{name}: {what}; it did not recover")
            return False
        self._recovered[name] = True
        self._log(f"{name}: {what}; back in operation {(self._now() - start) / 1e9:.2f} s after the fault")
        return True

    def _inject(self, fault: DemoFault, names: Sequence[str], now: int) -> Injection | None:
        """On the first drive that can have it; None: on none."""
        for name in fault.turn(names):
            with contextlib.suppress(ConfigError):  # the next one may have what it needs
                return self._injections.inject({**fault.fields, "on": name}, now)
        return None

    # -- time --------------------------------------------------------------------------------------------------------

    async def _until(self, condition: Callable[[], bool], seconds: float = STAGE_SECONDS) -> bool:
        end = self._now() + round(seconds * 1e9)
        while not condition():
            if self._now() >= end:
                return False
            await self._pass(POLL_SECONDS)
        return True

    async def _pass(self, seconds: float) -> None:
        """Let time pass and refresh the display; in memory, virtual time advances with the wall clock."""
        self._refresh()
        for watched in self._watched:
            if watched.done():
                watched.result()
        if self._line is None:
            await anyio.sleep(seconds)
        else:
            await self._pace(self._line.world, lambda world: world.run(seconds))

    async def _pace(self, world: VirtualWorld, run: Callable[[VirtualWorld], object]) -> None:
        """In memory: let virtual time pass, and then as much real time as is left of it."""
        start, begin = time.monotonic(), world.now
        run(world)
        await anyio.sleep(max(0.0, (world.now - begin) / 1e9 - (time.monotonic() - start)))

    # -- output -----------------------------------------------------------------------------------------------------

    def _log(self, sentence: str) -> None:
        stamped = f"{time.monotonic() - self._begin:6.2f} s  {sentence}"
        self._log_lines.append(stamped)
        if self._live is None:
            self._console.print(stamped, highlight=False)

    def _picture(self) -> Group:
        table = Table(title="pnfarm demo", title_justify="left", expand=False)
        for column in _COLUMNS:
            table.add_column(column.lstrip(">"), justify="right" if column[0] == ">" else "left", no_wrap=True)
        now = self._now()
        for station in self._farm.axes[:24]:
            seen = drive_snapshot(self._farm, station, now, injected={})
            fault = f"F{seen['fault']['number']}" if seen["fault"] else ""
            style = "red" if fault else ("yellow" if seen["cycle_seconds"] is None else "")
            cycle = "" if seen["cycle_seconds"] is None else f"{seen['cycle_seconds'] * 1000:.3g} ms"
            table.add_row(
                seen["name"], seen["model"], seen["state"], f"{seen['setpoint_rpm']:.0f} rpm",
                f"{seen['velocity_rpm']:.0f} rpm", f"{seen['current_amperes']:.2f} A", cycle, str(seen["frames_sent"]),
                str(seen["frames_received"]), fault, style=style,
            )  # fmt: skip
        if len(self._farm.axes) > 24:
            table.add_row(f"... {len(self._farm.axes) - 24} more")
        return Group(table, Text("\n".join(self._log_lines[-LOG_LINES:])))

    def _draw(self, file: Path) -> None:
        """Write the live table as an SVG that loads no external fonts."""
        console = Console(emoji=False, record=True, width=104, file=io.StringIO())
        console.print(self._picture())
        svg = console.export_svg(title="pnfarm demo")
        file.write_text(re.sub(r"@font-face \{.*?\}\n?", "", svg, flags=re.DOTALL), encoding="utf-8")

    def _summary(self, ok: bool) -> dict[str, Any]:
        now = self._now()
        drives = []
        for station in self._farm.axes:
            seen = drive_snapshot(self._farm, station, now, injected={})
            exchanging = seen["frames_sent"] > 0 and seen["frames_received"] > 0
            connected = exchanging and self._plc.exchanging(station.configured_name)
            recovered = self._recovered.get(station.configured_name, connected)
            drives.append(
                {
                    "name": station.configured_name,
                    "model": seen["model"],
                    "mac": seen["mac"],
                    "ip": seen["ip"].partition("/")[0] if seen["ip"] else None,
                    "station_address": seen.get("station_address"),
                    "connected": connected,
                    "frames_sent": seen["frames_sent"],
                    "frames_received": seen["frames_received"],
                    "cycle_seconds": seen["cycle_seconds"],
                    "faults": self._injected.get(station.configured_name, []),
                    "recovered": recovered,
                }
            )
        engine = self._farm.columns.engine[0]
        lateness = [int(n) for n in engine.lateness]
        return {
            "ok": ok and all(d["connected"] and d["recovered"] for d in drives),
            "drives": drives,
            "scenario": self._scenario,
            "engine": {
                "cycles": int(engine.cycles),
                "overruns": int(engine.overruns),
                "lateness_p50_seconds": _late_seconds(lateness, 0.50),
                "lateness_p99_seconds": _late_seconds(lateness, 0.99),
            },
        }

    def _report(self, summary: dict[str, Any]) -> None:
        if self._console.is_terminal:
            for sentence in self._log_lines:
                self._console.print(sentence, highlight=False)
        table = Table(title="Summary", title_justify="left")
        for column in ("drive", "MAC", "address", "connected", "sent", "received", "cycle", "faults", "recovered"):
            table.add_column(column)
        for d in summary["drives"]:
            cycle = "" if d["cycle_seconds"] is None else f"{d['cycle_seconds'] * 1000:.3g} ms"
            place = d["ip"] or f"station {d['station_address']}"
            table.add_row(
                d["name"], d["mac"] or "", place, "yes" if d["connected"] else "NO", str(d["frames_sent"]),
                str(d["frames_received"]), cycle, ", ".join(d["faults"]), "yes" if d["recovered"] else "NO",
            )  # fmt: skip
        self._console.print(table)
        engine = summary["engine"]
        self._console.print(
            f"engine: {engine['cycles']} ticks, {engine['overruns']} overruns, "
            f"late by {engine['lateness_p50_seconds'] * 1e6:.0f} us (p50), "
            f"{engine['lateness_p99_seconds'] * 1e6:.0f} us (p99)",
            highlight=False,
        )
        scenario = summary["scenario"]
        if scenario is not None:
            where = f"; report: {scenario['report']}" if scenario["report"] else ""
            self._console.print(
                f"scenario {scenario['name']}: {scenario['verdict']}{where}", highlight=False, soft_wrap=True
            )
        verdict = "every drive exchanged data and recovered" if summary["ok"] else "the demo FAILED"
        self._console.print(verdict, highlight=False)
        sys.stdout.flush()
        print_next("docs/tutorial.md: ten minutes from nothing to a red verdict on a wrong PLC program")


def _late_seconds(lateness: list[int], share: float) -> float:
    """How late this share of the engine's ticks is at most; 0 without ticks."""
    return percentile(lateness, share) / 1e6 if any(lateness) else 0.0
