"""How a run ends: by itself, interrupted, with its farm; what it leaves, and what its record says."""

from __future__ import annotations

import asyncio
import re
from itertools import pairwise
from operator import ge, gt, le, lt
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from pnfarm.cli.commands.run import bound
from pnfarm.controller.line import VirtualLine
from pnfarm.engine.lateness import note_late
from pnfarm.metrics import FarmCollector
from pnfarm.scenario.definition.file import parse_scenario
from pnfarm.scenario.definition.schema import scenario_schema
from pnfarm.scenario.definition.steps import STEPS
from pnfarm.scenario.lateness import FarmLateness
from pnfarm.scenario.run import ScenarioRun
from pnfarm.scenario.virtual import run_virtual
from pnfarm.station.events import ConnectionLost, StateChanged
from pnfarm.station.lateness import Lateness
from pnfarm.table.late import LATE_ROWS
from pnfarm.vocabulary.yaml_lines import parse_yaml

if TYPE_CHECKING:
    from pnfarm.scenario.run import FarmRunner

REPOSITORY = Path(__file__).resolve().parents[2]
LIBRARY = REPOSITORY / "configs" / "scenarios"
LINE = LIBRARY / "line.pnfarm.yml"


def run(steps: str, passing: FarmRunner | None = None) -> dict[str, Any]:
    scenario = parse_scenario(f"scenario: end\nfarm: {LINE}\nsteps:\n{steps}")
    scenario.overrides = {"drives[0].count": 2}
    record, _ = asyncio.run(run_virtual(*bound(scenario), passing=passing))
    return record


def test_a_run_in_virtual_time_ends_when_it_is_told_to() -> None:
    def after_two_seconds(run: ScenarioRun, now: int) -> str:
        return "interrupted by SIGINT" if now >= 1_002_000_000_000 else ""

    record = run(
        "  - fault: {kind: silence, on: axis-01}\n  - wait: 24h\n  - expect: {drive: all, that: connected}\n",
        after_two_seconds,
    )
    assert record["ended_early"] == "interrupted by SIGINT"
    assert record["verdict"] == "inconclusive"
    assert record["seconds"] < 20
    assert [case["verdict"] for case in record["cases"]] == ["not run"]
    assert record["faults"][0]["ended_seconds"] == record["seconds"]


def test_an_interrupted_run_that_had_failed_has_failed() -> None:
    def at_once(run: ScenarioRun, now: int) -> str:
        return "interrupted" if run.record.cases else ""

    record = run("  - expect: {drive: all, that: state == S3}\n  - wait: 24h\n", at_once)
    assert (record["verdict"], record["ended_early"]) == ("failed", "interrupted")


def test_faults_of_one_name_are_all_recorded_and_none_stays() -> None:
    record = run(
        "  - repeat:\n      times: 3\n      steps:\n"
        "        - fault: {kind: drive-warning, on: axis-01, params: {warning: 107}, as: again, for: 10ms}\n"
        "        - wait: 50ms\n"
    )
    assert [fault["name"] for fault in record["faults"]] == ["again"] * 3
    for fault in record["faults"]:
        assert fault["ended_seconds"] - fault["began_seconds"] == pytest.approx(0.01, abs=0.002)
        assert fault["evidence"]["activations"] == 1


def test_a_name_in_force_is_not_given_twice() -> None:
    record = run("  - fault: {kind: silence, on: axis-01, as: x}\n  - fault: {kind: silence, on: axis-02, as: x}\n")
    assert record["verdict"] == "error"
    assert "an injection named 'x' is in force" in record["ended_early"]
    assert len(record["faults"]) == 1


def test_more_faults_than_the_farm_remembers_end_without_an_error() -> None:
    record = run(
        "  - repeat:\n      times: 1100\n      steps:\n"
        "        - fault: {kind: drive-warning, on: axis-01, params: {warning: 107}, for: 1ms}\n        - wait: 2ms\n"
    )
    assert record["verdict"] == "passed"
    assert len(record["faults"]) == 1100
    assert all(fault["ended_seconds"] is not None for fault in record["faults"])


def test_a_fault_of_somebody_else_with_the_name_of_an_ended_one_is_not_cleared() -> None:
    async def main() -> None:
        scenario = parse_scenario(
            f"scenario: end\nfarm: {LINE}\nsteps:\n"
            "  - fault: {kind: drive-warning, on: axis-01, params: {warning: 107}, as: mine, for: 10ms}\n"
            "  - wait: 100ms\n"
        )
        binding, config = bound(scenario)
        line = await VirtualLine.create(config, epoch_ns=0)
        collector = FarmCollector(line.farm)
        own = ScenarioRun(binding, line.farm, collector, line.world.now)
        own.advance(line.world.now)
        line.world.run(0.05)
        others = line.farm.injections.inject({"kind": "silence", "on": "axis-02", "as": "mine"}, line.world.now)
        line.world.run(0.1)
        own.advance(line.world.now)
        assert own.finished
        assert others in line.farm.injections.of_drive("axis-02")
        collector.close()
        await line.close()

    asyncio.run(main())


@pytest.mark.parametrize(
    ("again_ms", "late_ms", "verdict", "said"),
    [
        # over before its begin
        (80, -5, "failed", "not true within 50ms"),
        (102, -5, "passed", "true after "),
        (102, 20, "inconclusive", "the farm, being late, began to look 20 ms after the moment"),
        # seen at once, but perhaps true for a while: counted from the moment
        (138, 40, "passed", "true after 40 ms"),
        (158, 60, "inconclusive", "began to look 60 ms after the moment"),
    ],
)
def test_a_run_that_begins_later_sees_what_lasts_two_milliseconds_or_that_it_looked_too_late(
    again_ms: int, late_ms: int, verdict: str, said: str
) -> None:

    async def main() -> dict[str, Any]:
        scenario = parse_scenario(
            f"scenario: later\nfarm: {LINE}\nsteps:\n"
            "  - expect: {drive: axis-01, that: warning == 107, within: 50ms}\n"
        )
        binding, config = bound(scenario)
        line = await VirtualLine.create(config, epoch_ns=0)
        collector = FarmCollector(line.farm)
        line.world.run(5.0)
        now, begin = line.world.now, line.world.now + 100_000_000
        warning = {"kind": "drive-warning", "on": "axis-01", "params": {"warning": 107}, "for": "2ms"}
        line.farm.injections.inject({**warning, "after": f"{again_ms}ms"}, now)
        own = ScenarioRun(binding, line.farm, collector, begin)
        assert own.advance(now) == begin - 5_000_000
        assert own.steps_begun == 0
        for until in (begin + late_ms * 1_000_000, begin + 100_000_000):
            line.world.run((until - line.world.now) / 1e9)
            own.advance(line.world.now)
        assert own.finished
        collector.close()
        await line.close()
        return own.record.as_dict()

    record = asyncio.run(main())
    case = record["cases"][0]
    assert (case["verdict"], said in case["message"], case["began_seconds"]) == (verdict, True, 0), case


def test_the_end_of_the_farm_is_an_error_with_what_was_found() -> None:
    async def main() -> dict[str, Any]:
        scenario = parse_scenario(
            f"scenario: end\nfarm: {LINE}\nsteps:\n  - expect: {{drive: all, that: powered}}\n  - wait: 1h\n"
            "  - expect: {drive: all, that: connected}\n"
        )
        binding, config = bound(scenario)
        line = await VirtualLine.create(config, epoch_ns=0)
        collector = FarmCollector(line.farm)
        own = ScenarioRun(binding, line.farm, collector, line.world.now)
        own.advance(line.world.now)
        own.cancel(line.world.now, "the farm stopped", broken=True)
        collector.close()
        await line.close()
        return own.record.as_dict()

    record = asyncio.run(main())
    assert (record["verdict"], record["farm_ended"]) == ("error", True)
    assert [case["verdict"] for case in record["cases"]] == ["passed", "not run"]


@pytest.mark.parametrize(
    ("back", "verdict", "told"),
    [
        (False, "inconclusive", "the farm itself, being late, lost the connection of axis-01 100 ms before"),
        (True, "failed", ""),
    ],
)
def test_an_axis_that_the_farm_lost_before_the_scenario_began_is_not_held_against_the_plc(back, verdict, told) -> None:
    async def main() -> dict[str, Any]:
        scenario = parse_scenario(
            f"scenario: end\nfarm: {LINE}\nsteps:\n  - expect: {{drive: axis-01, that: state == S4}}\n"
        )
        binding, config = bound(scenario)
        line = await VirtualLine.create(config, epoch_ns=0)
        collector = FarmCollector(line.farm)
        late = Lateness(budget_ns=16_000_000, engine_ns=90_000_000)
        if back:
            line.farm.log.record(line.world.now, "axis-01", ConnectionLost(lateness=late))
        line.world.run(3.0)
        assert line.farm.log.entries("axis-01")[-1].data == {"before": "S3", "after": "S4"}
        line.farm.injections.inject({"kind": "power-cycle", "on": "axis-01"}, line.world.now)
        if not back:
            line.farm.log.record(line.world.now, "axis-01", ConnectionLost(lateness=late))
        line.world.run(0.1)
        lateness = FarmLateness(line.farm, None, line.world.now)
        own = ScenarioRun(binding, line.farm, collector, line.world.now, lateness=lateness)
        own.advance(line.world.now)
        collector.close()
        await line.close()
        return own.record.as_dict()

    record = asyncio.run(main())
    assert record["verdict"] == verdict
    assert told in record["cases"][0]["message"]


def late_run(steps: str, during, *, axis: str = "axis-01", file: Path | None = None) -> dict[str, Any]:
    """The first case of a run in whose first step ``during`` happens while nobody looks; with the farm's lateness."""

    async def main() -> dict[str, Any]:
        scenario = parse_scenario(f"scenario: late\nfarm: {file or LINE}\nsteps:\n{steps}")
        binding, config = bound(scenario)
        line = await VirtualLine.create(config, epoch_ns=0)
        collector = FarmCollector(line.farm)
        core = line.farm
        line.world.run(6.0)
        assert core.axis(axis).handle.axis.drive.state == 4
        lateness = FarmLateness(core, None, line.world.now)
        # as in real time, with a heartbeat that is never late
        core.lateness.loop.due_ns = 1 << 62
        own = ScenarioRun(binding, core, collector, line.world.now, lateness=lateness)
        line.own = own
        own.advance(line.world.now)
        during(line)
        while not own.finished:
            line.world.run(0.001)
            own.advance(line.world.now)
        collector.close()
        await line.close()
        return own.record.as_dict()["cases"][0]

    return asyncio.run(main())


def stopped(line, seconds: float) -> None:
    """The drive is switched off and on while nobody looks; what has no event is not noticed."""
    line.own._unsubscribe()
    line.farm.injections.inject({"kind": "power-cycle", "on": "axis-01"}, line.world.now)
    line.world.run(seconds)


def stopped_in_a_stall(line, seconds: float) -> None:
    stopped(line, seconds)
    line.farm.lateness.loop.note(line.world.now, round(seconds * 1e9))


def stopped_before_our_eyes(line, seconds: float) -> None:
    stopped(line, 0.0)
    for _ in range(round(seconds * 1000)):
        line.world.run(0.001)
        line.own.advance(line.world.now)


@pytest.mark.parametrize(
    ("during", "verdict"),
    [(stopped_before_our_eyes, "failed"), (stopped, "inconclusive"), (stopped_in_a_stall, "inconclusive")],
)
def test_what_came_true_behind_its_time_is_not_passed_because_nobody_looked_in_time(during, verdict) -> None:
    steps = "  - expect: {drive: axis-01, that: velocity < 1 rpm, within: 10ms}\n"
    assert late_run(steps, lambda line: during(line, 2.0))["verdict"] == verdict


def test_what_must_hold_and_was_not_looked_at_for_long_is_not_known_to_have_held() -> None:
    def during(line):
        stopped_in_a_stall(line, 9.0)
        assert line.farm.axis("axis-01").handle.axis.motor.velocity > 0

    case = late_run("  - expect: {drive: axis-01, that: velocity > 1 rpm, for: 9s}\n", during)
    assert case["verdict"] == "inconclusive"
    assert "did not look for 9" in case["message"]


def test_a_loss_by_the_farm_is_that_of_each_axis_of_the_station(tmp_path) -> None:
    def during(line):
        late = Lateness(budget_ns=1_000_000, engine_ns=90_000_000)
        line.farm.log.record(line.world.now, "system", ConnectionLost(lateness=late))

    file = tmp_path / "system.pnfarm.yml"
    system = REPOSITORY / "configs" / "drive-system.pnfarm.yml"
    file.write_text(system.read_text().replace("state: ./state\n", ""))
    steps = "  - expect: {drive: system.x, that: state == S1, within: 10ms}\n"
    case = late_run(steps, during, axis="system.x", file=file)
    assert case["verdict"] == "inconclusive"
    assert "lost the connection of system.x" in case["message"]


def test_a_loss_that_did_not_take_the_drive_out_of_operation_excuses_nothing_later() -> None:
    def during(line):
        line.farm.log.record(line.world.now, "axis-01", ConnectionLost(lateness=Lateness(0, engine_ns=1)))

    steps = "  - wait: 1s\n  - expect: {drive: axis-01, that: state == S1}\n"
    assert late_run(steps, during)["verdict"] == "failed"


@pytest.mark.parametrize(("idle", "verdict"), [(2.0, "failed"), (0.0, "inconclusive")])
def test_a_loss_by_the_farm_excuses_an_axis_that_is_not_in_operation_until_it_is_connected_again(
    idle: float, verdict: str
) -> None:
    def during(line):
        # the PLC does not run this axis any more
        line.farm.injections.inject({"kind": "not-ready", "on": "axis-01"}, line.world.now)
        line.world.run(0.1 + idle)
        late = Lateness(budget_ns=1_000_000, engine_ns=90_000_000)
        line.farm.log.record(line.world.now, "axis-01", ConnectionLost(lateness=late))
        line.farm.injections.inject({"kind": "ar-abort", "on": "axis-01"}, line.world.now)
        line.world.run(5.0)
        assert line.farm.axis("axis-01").device.connected
        assert line.farm.axis("axis-01").handle.axis.drive.state < 4

    steps = "  - wait: 3s\n  - wait: 1s\n  - expect: {drive: axis-01, that: velocity > 5000 rpm}\n"
    assert late_run(steps, during)["verdict"] == verdict


def test_a_metric_that_a_loss_by_the_farm_changed_is_not_held_against_the_plc() -> None:
    def during(line):
        late = Lateness(budget_ns=1_000_000, engine_ns=90_000_000)
        line.farm.log.record(line.world.now, "axis-01", ConnectionLost(lateness=late))

    steps = "  - expect: {metric: 'pnfarm_axis_faults_total', increases: '> 0', for: 10ms}\n"
    assert late_run(steps, during)["verdict"] == "inconclusive"


def test_the_documents_name_every_key_of_the_record() -> None:
    record = run("  - expect: {drive: all, that: powered}\n")
    page = (REPOSITORY / "docs" / "scenarios.md").read_text()
    table = page[page.index("`--json FILE`, and") :]
    named = set(re.findall(r"`([a-z_]+)`", table))
    assert set(record) <= named
    assert set(record["cases"][0]) <= named


def test_the_schema_accepts_the_library_and_the_examples_and_names_every_key() -> None:
    schema = scenario_schema()
    page = (REPOSITORY / "docs" / "scenarios.md").read_text()
    texts = [path.read_text() for path in LIBRARY.glob("*.scenario.yml")]
    texts += re.findall(r"```yaml\n(scenario:.*?)```", page, re.DOTALL)
    assert len(texts) >= 8
    for kind, known in STEPS.items():
        for key in known.keys:
            if kind != "fault":
                assert key in str(schema["$defs"]["Step"]["properties"][kind])
        texts.append(f"scenario: example\nsteps:\n  - {known.example}\n")
    for text in texts:
        parse_scenario(text)
        assert fits(schema, parse_yaml(text).root.plain(), schema), text
    for wrong in (
        "weit: 1s", "wait: {for: 1s, until: connected}", "expect: {drive: all}", "power: {of: all}",
        "repeat: {steps: []}", "parallel: []", "wait: {for: 3}", "fault: {on: all}",
    ):  # fmt: skip
        assert not fits(schema, parse_yaml(f"scenario: x\nsteps:\n  - {wrong}\n").root.plain(), schema), wrong


_TYPES = {"object": dict, "array": list, "string": str, "integer": int, "number": (int, float), "boolean": bool}


def fits(schema: dict[str, Any], value: object, root: dict[str, Any]) -> bool:
    """JSON Schema (2020-12) as far as the scenario's schema goes; an unknown keyword fails the test."""
    for word, wanted in schema.items():
        match word:
            case "$ref":
                ok = fits(root["$defs"][wanted.removeprefix("#/$defs/")], value, root)
            case "type":
                kinds = wanted if isinstance(wanted, list) else [wanted]
                ok = any(
                    value is None if kind == "null" else isinstance(value, _TYPES[kind])
                    and (kind == "boolean") == isinstance(value, bool)
                    for kind in kinds
                )  # fmt: skip
            case "anyOf":
                ok = any(fits(one, value, root) for one in wanted)
            case "oneOf":
                ok = sum(fits(one, value, root) for one in wanted) == 1
            case "allOf":
                ok = all(fits(one, value, root) for one in wanted)
            case "enum":
                ok = value in wanted
            case "const":
                ok = value == wanted
            case "pattern":
                ok = not isinstance(value, str) or re.search(wanted, value) is not None
            case "minLength" | "maxLength" | "minItems" | "maxItems" | "minProperties" | "maxProperties":
                size = len(value) if isinstance(value, (str, list, dict)) else wanted
                ok = size >= wanted if word.startswith("min") else size <= wanted
            case "minimum" | "maximum" | "exclusiveMinimum" | "exclusiveMaximum":
                compared = {"minimum": ge, "maximum": le, "exclusiveMinimum": gt, "exclusiveMaximum": lt}[word]
                ok = not isinstance(value, (int, float)) or compared(value, wanted)
            case "required":
                ok = not isinstance(value, dict) or set(wanted) <= set(value)
            case "properties":
                ok = not isinstance(value, dict) or all(
                    fits(wanted[key], item, root) for key, item in value.items() if key in wanted
                )
            case "additionalProperties":
                extra = set(value) - set(schema.get("properties", ())) if isinstance(value, dict) else set()
                ok = not extra if wanted is False else True
            case "items":
                ok = not isinstance(value, list) or all(fits(wanted, item, root) for item in value)
            case "$schema" | "$defs" | "title" | "description" | "default" | "examples" | "uniqueItems" | "not" | "if":
                ok = True
            case _:
                raise AssertionError(word)
        if not ok:
            return False
    return True


def late_for(line, late_ms: float, every_ms: float, seconds: float) -> None:
    """Ticks are late by so much, again and again, and the run looks as often as one in real time does."""
    columns, world = line.farm.columns, line.world
    for number in range(round(seconds * 1e3 / every_ms)):
        world.run(every_ms / 1e3)
        note_late(columns.engine[0], columns.late, world.now - round(late_ms * 1e6), world.now, 0)
        if number % round(200 / every_ms) == 0:
            line.own.advance(world.now)


#: Of a state, whose changes are events: a run in real time looks each 200 ms.
NEVER = "  - expect: {drive: axis-01, that: state == S1, within: 20s}\n"


def test_small_delays_over_a_long_step_do_not_add_up_to_a_late_farm() -> None:
    """Together they are 100 ms late, and the budget is 16 ms."""
    case = late_run(NEVER, lambda line: late_for(line, 0.5, 100, 20))
    assert case["verdict"] == "failed"
    assert case["farm_late_seconds"] == pytest.approx(0.0005)


def test_delays_that_follow_each_other_add_up() -> None:
    case = late_run(NEVER, lambda line: late_for(line, 3, 6, 20))
    assert case["verdict"] == "inconclusive"


def test_a_stall_early_in_a_long_step_is_remembered_on_a_machine_that_is_late_all_the_time() -> None:
    """The record of delays is full with newer ones when the step fails."""

    def during(line) -> None:
        columns, world = line.farm.columns, line.world
        world.run(0.1)
        note_late(columns.engine[0], columns.late, world.now - 100_000_000, world.now, 0)
        line.own.advance(world.now)
        late_for(line, 0.3, 4, 19)
        assert int(columns.engine[0].late_head) > LATE_ROWS

    case = late_run(NEVER, during)
    assert (case["verdict"], case["farm_late_seconds"]) == ("inconclusive", 0.1)

    def behind_a_wait(line) -> None:
        line.world.run(1.0)
        line.own.advance(line.world.now)
        during(line)

    case = late_run("  - wait: 1s\n" + NEVER, behind_a_wait)
    assert (case["verdict"], case["farm_late_seconds"]) == ("inconclusive", 0.1)


@pytest.mark.parametrize(("before", "verdict"), [(0.5, "inconclusive"), (3.0, "failed")])
def test_an_expectation_that_takes_no_time_is_about_the_end_of_the_wait_before_it(before, verdict) -> None:
    def during(line) -> None:
        columns, world = line.farm.columns, line.world
        world.run(5.0 - before)
        line.own.advance(world.now)
        note_late(columns.engine[0], columns.late, world.now - 100_000_000, world.now, 0)
        world.run(before)

    steps = "  - wait: 5s\n  - expect: {drive: axis-01, that: velocity > 5000 rpm}\n"
    assert late_run(steps, during)["verdict"] == verdict


def noted_late(line, *states: int) -> None:
    """The event loop was busy: entries of what the engine saw before come only now."""
    for ago, (before, after) in zip((2_000_000, 1_000_000), pairwise(states), strict=True):
        line.farm.log.record(line.world.now - ago, "axis-01", StateChanged(before, after))


def test_what_happened_before_a_step_and_is_noted_in_it_does_not_break_what_must_hold() -> None:
    def during(line) -> None:
        line.world.run(0.1)
        line.own.advance(line.world.now)
        noted_late(line, 2, 3, 4)

    steps = "  - wait: 100ms\n  - expect: {drive: axis-01, that: state == S4, for: 200ms}\n"
    assert late_run(steps, during)["verdict"] == "passed"


def test_what_was_true_before_a_step_and_is_noted_in_it_does_not_pass() -> None:
    def during(line) -> None:
        line.world.run(0.1)
        line.own.advance(line.world.now)
        noted_late(line, 4, 2, 4)

    steps = "  - wait: 100ms\n  - expect: {drive: axis-01, that: state == S2, within: 200ms}\n"
    assert late_run(steps, during)["verdict"] == "failed"


def test_a_wait_sees_a_state_that_is_over_when_it_looks() -> None:
    def during(line) -> None:
        line.world.run(0.1)
        noted_late(line, 4, 2, 4)

    steps = (
        "  - wait: {until: state == S2, drive: axis-01, within: 1s}\n  - expect: {drive: axis-01, that: state == S4}\n"
    )
    assert late_run(steps, during)["verdict"] == "passed"


@pytest.mark.parametrize(("condition", "verdict"), [("fault == 702", "passed"), ("fault != 702", "failed")])
def test_a_second_fault_does_not_change_the_oldest_one(condition, verdict) -> None:
    def during(line) -> None:
        line.world.run(0.1)
        line.own.advance(line.world.now)
        line.farm.injections.inject({"kind": "drive-fault", "on": "axis-01", "params": {"fault": 439}}, line.world.now)
        line.world.run(0.05)

    limit = "for: 100ms" if verdict == "passed" else "within: 100ms"
    steps = (
        "  - fault: {kind: drive-fault, params: {fault: 702}, on: axis-01}\n  - wait: 100ms\n"
        f"  - expect: {{drive: axis-01, that: {condition}, {limit}}}\n"
    )
    assert late_run(steps, during)["verdict"] == verdict
