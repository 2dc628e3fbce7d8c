"""A scenario over the drives of several shards, carried out by the hub.

The course of the steps is the farm's own (:class:`pnfarm.scenario.flow.Flow`); what a step does goes to the shards:
a fault as :class:`~pnfarm.hub.hosts.faults.HubFaults` injects it, each wait and each expectation as a scenario of one
step on each shard that has drives of it.  So conditions are watched where the drives are, each millisecond, what lasted
only a moment counts, and a shard that was itself late says so.  One that follows a fault is sent with the fault, and
begins at the same moment.
"""

from __future__ import annotations

import asyncio
import json
from contextlib import suppress
from itertools import pairwise
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, TypeVar, cast
from urllib.parse import quote

import anyio
import anyio.to_thread
from prometheus_client.parser import text_string_to_metric_families

from pnfarm.errors import ConfigError, PnfarmError
from pnfarm.hub.hosts.devices import HubDevices
from pnfarm.hub.hosts.drives import HubDrives
from pnfarm.hub.hosts.states import HubStates
from pnfarm.hub.hub import read, refusal
from pnfarm.hub.shards import AwayError, understood
from pnfarm.scenario.definition.steps import ALL_CONNECTED, DEFAULT_WITHIN_NS, MEASURES, POWER
from pnfarm.scenario.flow import EndedError, Flow, Life
from pnfarm.scenario.measures import measured, reading_of, show_comparison
from pnfarm.scenario.report.record import Verdict, worst
from pnfarm.signals.device_signal import note_forces, releases
from pnfarm.station import events
from pnfarm.station.event import texts_of
from pnfarm.vocabulary.durations import format_duration
from pnfarm.vocabulary.quoting import shortened

if TYPE_CHECKING:
    from collections.abc import Callable, Coroutine, Generator, Iterator, Mapping, Sequence

    from pnfarm.hub.hosts.faults import HubFaults
    from pnfarm.hub.hub import Hub
    from pnfarm.hub.log import HubEntry
    from pnfarm.hub.shards import Shard
    from pnfarm.scenario.definition.binding import Binding
    from pnfarm.scenario.definition.steps import MetricName, Step
    from pnfarm.scenario.measures import Reading

__all__ = ["HubRun"]

#: Between two questions how far a part is: at first, and after a second.
ASK_SECONDS, LATER_SECONDS = 0.02, 0.05
#: A shard that does not answer for so long is lost to the step.
LOST_SECONDS = 5.0
#: Requests of one step at once.
AT_ONCE = 16
#: The next check while a request is under way; its end wakes the run before.
LOOK_NS = 1_000_000_000

_T = TypeVar("_T")
#: Events of the timeline, with what buses make of them.
_TOLD = (
    events.StateChanged, events.FaultRaised, events.FaultsCleared, events.WarningChanged, events.PowerLost,
    events.PowerReturned, events.ConnectionEstablished, events.ConnectionLost, events.ConnectionReleased,
    events.WatchdogExpired,
)  # fmt: skip


class _Injected:
    """A fault of the hub as the record takes it."""

    def __init__(self, fault: Mapping[str, Any]) -> None:
        self.fault = fault
        self.id = str(fault["id"])
        kind = SimpleNamespace(name=fault["kind"])
        self.spec = SimpleNamespace(kind=kind, when=fault["spec"].get("when"))
        self.drives = tuple(fault["drives"])

    @property
    def runs(self) -> dict[str, Any]:
        return {
            name: SimpleNamespace(started_ns=_ns(run["started_seconds"]), ended_ns=_ns(run["ended_seconds"]))
            for name, run in self.fault["drives"].items()
        }

    def as_dict(self) -> Mapping[str, Any]:
        return self.fault


def _used(record: Mapping[str, Any]) -> dict[str, Any]:
    """What is used of a shard's record, with the types that are used; ``late``: whether the shard was itself late."""
    lateness = record["lateness"]
    late = lateness is None or float(lateness["farm_late_seconds"]) > float(lateness["farm_budget_seconds"])
    return {"verdict": str(record["verdict"]), "cases": [_case(one) for one in record["cases"]], "late": late}


def _case(case: Mapping[str, Any]) -> dict[str, Any]:
    verdict, late = Verdict(case["verdict"]), case["farm_late_seconds"]
    return {
        # what did not run was cut short there, and nothing is known of it
        "verdict": Verdict.INCONCLUSIVE if verdict is Verdict.NOT_RUN else verdict,
        "message": str(case["message"]),
        "measured": str(case["measured"]),
        "drives": [str(name) for name in case["drives"]],
        "held_after_seconds": {name: float(seconds) for name, seconds in case["held_after_seconds"].items()},
        "values": {name: {**values} for name, values in case["values"].items()},
        "shown": {name: {**texts} for name, texts in case["shown"].items()},
        "farm_late_seconds": None if late is None else float(late),
    }


def _of_all(step: Step) -> bool:
    """Whether it waits for all drives and devices, which each shard knows itself."""
    return step.get("until") == ALL_CONNECTED and not step.get("drive")


def _ns(seconds: float | None) -> int | None:
    return None if seconds is None else round(seconds * 1e9)


def _followers(steps: Sequence[Step]) -> Iterator[tuple[int, list[Step]]]:
    """Each fault, by identity, with the steps directly after it that watch conditions."""
    for step, following in pairwise(steps):
        if step.kind == "fault":
            first = [branch[0] for branch in following.branches] if following.kind == "parallel" else [following]
            yield id(step), [one for one in first if one.watches]
    for step in steps:
        for branch in step.branches:
            yield from _followers(branch)


class HubRun(Flow):
    """``wake`` is set when something is to be checked."""

    def __init__(self, binding: Binding, hub: Hub, faults: HubFaults, begin: int) -> None:
        super().__init__(binding, hub.shards.farm, begin)
        self.wake = asyncio.Event()
        self._hub = hub
        self._faults = faults
        self._devices = HubDevices(hub)
        self._own: dict[str, _Injected] = {}
        self._off: dict[str, None] = {}
        self._forced: dict[str, set[str]] = {}
        #: When shards lost drives by their own lateness last, and when these were in operation again: the hub's clock.
        self._own_losses: dict[str, int] = {}
        self._back: dict[str, int] = {}
        #: The axes of each drive system, by its name of station.
        self._axes: dict[str, list[str]] = {}
        for name, view in hub.shards.views.items():
            if (station := view.get("station_name")) not in hub.shards.views:
                self._axes.setdefault(str(station), []).append(name)
        self._followers = dict(_followers(binding.scenario.steps))
        #: Steps whose requests are under way before their turn, by identity, with their begin.
        self._ahead: dict[int, tuple[int, asyncio.Task[list[dict[str, Any]]]]] = {}
        self._told_texts = texts_of(_TOLD)
        self._ending: asyncio.Task[None] | None = None
        self._unsubscribe = hub.log.subscribe(self._note)

    def advance(self, now: int) -> int:
        if self._ending is not None:
            self._now = now
            return now + LOOK_NS
        return super().advance(now)

    def _note(self, entry: HubEntry) -> None:
        if entry.data.get("cause") == "farm":
            self._own_losses |= dict.fromkeys(self._axes.get(entry.drive, [entry.drive]), entry.at_ns)
        if entry.drive in self.binding.drives and entry.data["event"] in self._told_texts:
            state = entry.data.get("after") if entry.data["event"] == events.StateChanged.TEXT else None
            if state == "S4":
                self._back[entry.drive] = entry.at_ns
            self.record.note_told(entry.at_ns, entry.drive, str(entry.data["event"]), state)

    def _is_own_loss(self, name: str, begin: int) -> bool:
        """Whether a shard, being late, lost this drive's connection since ``begin``, or it is not back since."""
        lost = self._own_losses.get(name, -1)
        return lost >= 0 and (lost >= begin or self._back.get(name, -1) < lost)

    # -- requests

    def _await(self, work: Coroutine[Any, Any, _T] | asyncio.Task[_T]) -> Generator[int, None, _T]:
        """Let requests run while other branches go on."""
        task = asyncio.ensure_future(work)
        task.add_done_callback(lambda _: self.wake.set())
        try:
            while not task.done():
                yield self._now + LOOK_NS
            return task.result()
        finally:
            task.cancel()

    async def _each(self, work: Sequence[Coroutine[Any, Any, None]]) -> None:
        """Some at once; the first error after all of them are over."""
        limit = anyio.CapacityLimiter(AT_ONCE)
        failed: list[PnfarmError] = []

        async def one(coroutine: Coroutine[Any, Any, None]) -> None:
            async with limit:
                try:
                    await coroutine
                except PnfarmError as exc:
                    failed.append(exc)

        async with anyio.create_task_group() as tasks:
            for coroutine in work:
                tasks.start_soon(one, coroutine)
        if failed:
            raise failed[0]

    async def _drive(self, method: str, name: str, path: str, body: Mapping[str, Any] | None = None) -> None:
        shard = self._hub.shards.owner(name)
        answer = await self._hub.ask(shard, method, f"drives/{quote(name, safe='')}/{path}", body=body)
        if not answer.good:
            raise ConfigError(f"{name}, {path}: {refusal(answer)}")

    # -- steps that change something

    def _act(self, step: Step) -> Life:
        match step.kind:
            case "fault":
                inject = self._faults.inject(step.values["spec"], begins=lambda at_ns: self._send_ahead(step, at_ns))
                fault, whole = yield from self._await(inject)
                injected = _Injected(fault)
                self._own[injected.id] = injected
                if step.part == "trial":
                    self._by_step[id(step)] = injected.id
                self.record.fault_began(cast("Any", injected), self._now)
                if not whole:
                    first = fault["not_hit"][0]
                    raise AwayError(
                        f"{len(fault['not_hit'])} drives were not hit, such as {first['drive']}: {first['why']}"
                    )
            case "clear":
                wanted = step.values["fault"]
                for name in list(self._own) if wanted == "all" else [wanted]:
                    yield from self._end_fault(name)
            case "power":
                word = step.one_of(POWER)
                names = self.binding.chosen(step, word)
                for on in POWER[word]:
                    yield from self._await(self._power(names, on=on))
            case "set":
                written = [self._write(name, values, "value") for name, values in step.values["signals"].items()]
                yield from self._await(self._each(written))
            case "force":
                forced = [self._write(name, values, "force") for name, values in step.values["signals"].items()]
                yield from self._await(self._each(forced))
            case "release":
                found = releases(step.values["signals"], self._hub.shards.with_signals)
                yield from self._await(self._each([self._write(name, one, "force") for name, one in found.items()]))
            case "restore":
                answer = yield from self._await(HubStates(self._hub).restore(step.values["state"], check=False))
                for note in answer["notes"]:
                    self.record.note_told(self._now, "", note, None)
            case "param":
                writes = [
                    self._drive("PUT", name, f"params/{quote(str(parameter), safe='')}", {"value": value})
                    for name in self.binding.chosen(step)
                    for parameter, value in step.values["set"].items()
                ]
                yield from self._await(self._each(writes))

    async def _write(self, name: str, values: Mapping[str, Any], how: str) -> None:
        for signal, owner in (await self._devices.write(name, values, how=how)).items():
            self.record.note_told(self._now, name, f"{signal} waits: a {owner} has it", None)
        if how == "force":
            note_forces(self._forced, name, values)

    async def _power(self, names: Sequence[str], *, on: bool) -> None:
        for name in names:
            if on:
                self._off.pop(name, None)
            else:
                self._off[name] = None
        await self._each([self._drive("POST", name, "power-on" if on else "power-off") for name in names])

    def _end_fault(self, name: str) -> Life:
        injected = self._own.get(name)
        if injected is None:
            return
        yield from self._await(self._clear(injected))
        self._own.pop(name, None)

    async def _clear(self, injected: _Injected) -> None:
        found = await self._faults.get(injected.id)
        whole = True
        if found["state"] != "ended":
            found, whole = await self._faults.clear(injected.id)
        injected.fault = found
        self.record.fault_ended(cast("Any", injected))
        if not whole:
            raise AwayError(
                f"{injected.id} is cleared, but for drives whose shards do not answer: {found['unreachable']}"
            )

    def _powered(self) -> Generator[int, None, Callable[[str], bool]]:
        view = yield from self._await(HubDrives(self._hub).listed())
        return {drive["name"]: bool(drive["powered"]) for drive in view["drives"]}.__getitem__

    def _switch(self, name: str, *, on: bool) -> Life:
        yield from self._await(self._power([name], on=on))

    # -- steps that look

    def _parts(self, step: Step) -> dict[Shard, list[str]]:
        """The drives of a step by shard, also by one that is away; the devices of one about these alone, or about all.

        Raises :class:`ConfigError` for devices of several shards: none could see all of their signals.
        """
        found: dict[Shard, list[str]] = {}
        for name in self.binding.condition_of(step)[1]:
            found.setdefault(self._hub.shards.device_owner(name), []).append(name)
        if len(found) > 1:
            several = ", ".join(name for names in found.values() for name in names)
            raise ConfigError(f"{several} are devices of several shards, and a condition is of one")
        if found:
            return found
        devices = self._hub.shards.devices if _of_all(step) else ()
        for name in (*(self.binding.chosen(step) if self.binding.drives else ()), *devices):
            found.setdefault(self._hub.shards.known_station(name), []).append(name)
        return found

    def _send_ahead(self, fault: Step, at_ns: int) -> None:
        """The steps after a fault that begins at this moment see what is over soon, too."""
        loop = asyncio.get_running_loop()
        for step in self._followers.get(id(fault), ()):
            work = loop.create_task(self._look(step, at_ns))
            # of a fault that is refused nobody asks for it
            work.add_done_callback(lambda done: done.cancelled() or done.exception())
            self._ahead[id(step)] = at_ns, work

    def _looked(self, step: Step) -> Generator[int, None, tuple[int, list[dict[str, Any]]]]:
        """When the step began, and its records."""
        begin, work = self._ahead.pop(id(step), None) or (self._now, self._look(step))
        return begin, (yield from self._await(work))

    async def _look(self, step: Step, at_ns: int = 0) -> list[dict[str, Any]]:
        """The records of one step on each shard that has drives of it; of a lost one, a record that says so."""
        keys: dict[str, Any] = {key: format_duration(step.values[key]) for key in ("within", "for") if step.get(key)}
        keys |= {key: step.values[key] for key in ("until", "that") if key in step.values}
        if keys.get("until") == ALL_CONNECTED and not _of_all(step):
            keys["until"] = "connected"
        named = not (self.binding.condition_of(step)[1] or _of_all(step))
        parts = self._parts(step)
        length = step.get("within", DEFAULT_WITHIN_NS if step.kind == "wait" else 0) + step.get("for", 0)
        texts = {shard: {step.kind: {**keys, "drive": names} if named else keys} for shard, names in parts.items()}
        return await self._all_parts(texts, length, parts, at_ns)

    async def _all_parts(
        self, steps: Mapping[Shard, Mapping[str, Any]], length_ns: int, parts: Mapping[Shard, list[str]], at_ns: int = 0
    ) -> list[dict[str, Any]]:
        answers = await self._hub.each(steps, lambda shard: self._part(shard, steps[shard], length_ns, at_ns))
        found = list(answers.good.values())
        for shard, why in answers.away.items():
            drives = parts.get(shard, [])
            found.append({"verdict": "lost", "cases": [], "lost": str(why), "drives": drives, "late": True})
        return found

    async def _part(self, shard: Shard, step: Mapping[str, Any], length_ns: int, at_ns: int) -> dict[str, Any]:
        """One step on one shard, from a moment on or at once (0), until it is over.  Raises :class:`AwayError`."""
        hub = self._hub
        # JSON is YAML
        budget = self.binding.scenario.budget_ns
        limit = {} if budget is None else {"budget": format_duration(budget)}
        body = {"text": json.dumps({"scenario": "part", **limit, "steps": [step]}), "part": True}
        query = {"at": repr(shard.clock.to_shard(at_ns))} if at_ns else {}
        begun = read(shard, await hub.ask(shard, "POST", "scenarios", body=body, query=query), "id")
        path = f"scenarios/{quote(str(begun['id']), safe='')}"
        answered = hub.now()
        start = max(answered, at_ns)
        try:
            while True:
                try:
                    found = read(shard, await hub.ask(shard, "GET", path, query={"cases_from": 0}), "state")
                    answered = hub.now()
                    if found["state"] == "ended":
                        record = read(shard, await hub.ask(shard, "GET", path))
                        with understood(shard):
                            return _used(record)
                except AwayError as exc:
                    # what no farm answers gets no better
                    if exc.slug == "garbage" or hub.now() - answered > LOST_SECONDS * 1e9:
                        raise
                passed = hub.now() - start
                if passed > length_ns + LOST_SECONDS * 1e9:
                    raise AwayError(f"{shard.label} did not end a step in {passed / 1e9:.1f} s")
                await hub.sleep(ASK_SECONDS if passed < 1_000_000_000 else LATER_SECONDS)
        except asyncio.CancelledError:
            with anyio.CancelScope(shield=True), suppress(AwayError):
                await hub.ask(shard, "DELETE", path)
            raise

    def _wait_until(self, step: Step) -> Life:
        begin, records = yield from self._looked(step)
        if all(one["verdict"] == "passed" for one in records):
            return
        message = self._judge(step, begin, records)
        raise EndedError(f"{step.title}: {message}")

    def _expect(self, step: Step) -> Life:
        begin, records = yield from self._looked(step)
        self._judge(step, begin, records)

    def _judge(self, step: Step, begin: int, records: Sequence[Mapping[str, Any]]) -> str:
        """One case of the shards' cases: the worst verdict decides; returns its message."""
        cases = [case for one in records for case in one["cases"]]
        lost = [one for one in records if one["verdict"] == "lost"]
        verdicts = {case["verdict"] for case in cases} | ({Verdict.INCONCLUSIVE} if lost else set())
        verdict = worst(verdicts) if verdicts else Verdict.INCONCLUSIVE
        told = [case for case in cases if case["verdict"] is verdict]
        if verdict is Verdict.PASSED:
            # the slowest one decides
            told = sorted(told, key=lambda case: -max(case["held_after_seconds"].values(), default=0.0))[:1]
        messages = [case["message"] for case in told] + [f"not known: {one['lost']}" for one in lost]
        message = "; ".join(dict.fromkeys(messages)) or "the shards did not carry it out"
        late = [case["farm_late_seconds"] for case in cases if case["farm_late_seconds"] is not None]
        self._case(
            step,
            verdict,
            begin,
            message,
            measured="; ".join(case["measured"] for case in told if case["measured"]),
            drives=[name for case in cases for name in case["drives"]] + [n for one in lost for n in one["drives"]],
            took={name: round(s * 1e9) for case in cases for name, s in case["held_after_seconds"].items()},
            values={name: values for case in cases for name, values in case["values"].items()},
            shown={name: texts for case in cases for name, texts in case["shown"].items()},
            late_ns=round(max(late) * 1e9) if late else None,
        )
        return message

    def _read_metric(self, metric: MetricName) -> Generator[int, None, Reading]:
        return (yield from self._await(self._metric(metric)))

    async def _metric(self, metric: MetricName) -> Reading:
        """The samples of all shards, added up; raises where one is missing: its part could be anything."""
        hub = self._hub
        for shard in hub.shards.unreachable:
            raise shard.away()
        found: dict[tuple[str, str], float] = {}

        async def one(shard: Shard) -> None:
            answer = await hub.client(shard).ask("GET", "/metrics", seconds=LOST_SECONDS)
            if not answer.good:
                raise AwayError(f"{shard.label} has no metrics: status {answer.status}", slug="refusal")
            text = answer.body.decode("utf-8", "replace")
            # a thousand drives have megabytes
            with understood(shard):
                part = await anyio.to_thread.run_sync(lambda: reading_of(text_string_to_metric_families(text), metric))
            for key, value in part.items():
                found[key] = found.get(key, 0.0) + value

        await self._each([one(shard) for shard in hub.shards.reachable])
        if not found:
            raise ConfigError(f"no shard has a metric {metric.name} with these labels")
        return found

    def _expect_metric(self, step: Step) -> Life:
        begin = self._now
        metric, asked = step.values["metric"], step.one_of(MEASURES)
        before = yield from self._read_metric(metric)
        # meanwhile each shard watches its own lateness
        length = max(1_000_000, step.get("for", 0))
        waits = {shard: {"wait": {"for": format_duration(length)}} for shard in self._hub.shards.reachable}
        records = yield from self._await(self._all_parts(waits, length, {}))
        value = measured(asked, before, (yield from self._read_metric(metric)))
        bound = step.values[asked]
        shown, wanted = show_comparison(metric.name, value, bound)
        message = f"{asked} {shown}, wanted {wanted}"
        verdict = Verdict.PASSED if bound.holds(value) else Verdict.FAILED
        named = [metric.labels["drive"]] if "drive" in metric.labels else list(self.binding.drives)
        if verdict is Verdict.FAILED and any(one["late"] for one in records):
            verdict = Verdict.INCONCLUSIVE
            message += "; a shard was itself late, or lost"
        elif verdict is Verdict.FAILED and (lost := [name for name in named if self._is_own_loss(name, begin)]):
            verdict = Verdict.INCONCLUSIVE
            message += f"; a shard, being late, lost the connection of {shortened(lost)}"
        self._case(step, verdict, begin, message, value=value, measured=shown)

    # -- the end

    def _finish(self, why: str, *, broken: bool = False) -> None:
        if self._ending is None:
            self._life.close()
            for _, work in self._ahead.values():
                work.cancel()
            self._ending = asyncio.get_running_loop().create_task(self._undo(why, broken=broken))
            self._hub.undoing.add(self._ending)
            self._ending.add_done_callback(self._hub.undoing.discard)

    async def _undo(self, why: str, *, broken: bool) -> None:
        """End its faults and switch its drives on; what cannot be undone now is reported."""
        left: list[str] = []
        for injected in list(self._own.values()):
            try:
                await self._clear(injected)
            except PnfarmError as exc:
                left.append(f"{injected.id} could not be cleared: {exc}")
        for name, signals in self._forced.items():
            try:
                await self._devices.write(name, dict.fromkeys(signals), how="force")
            except PnfarmError as exc:
                left.append(f"{name} could not be released: {exc}")
        if self._off:
            try:
                await self._power(list(self._off), on=True)
            except PnfarmError as exc:
                left.append(f"not all drives could be switched on: {exc}")
        self._unsubscribe()
        self._now = self._hub.now()
        why = "; ".join(part for part in (why, *left) if part)
        self._not_reached(why)
        self.record.end(self._now, why, None, broken=broken)
        self.finished = True
        self.wake.set()
