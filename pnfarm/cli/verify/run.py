"""Runs the known farm and makes checks of the scenario's record."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pnfarm.cli.verify.report import Check, Fault, Part, Verdict, worst

if TYPE_CHECKING:
    from pnfarm.scenario.definition.binding import Binding
    from pnfarm.scenario.definition.steps import Step

__all__ = ["KNOWN", "in_memory", "on_wire"]

#: Farm files and scenarios: what is expected.
KNOWN = Path(__file__).with_name("known")
#: How often a part runs at most while the machine makes it inconclusive.
TRIES = 3


async def in_memory(folder: Path = KNOWN) -> Part:
    """The known farm in virtual time."""
    from pnfarm.cli.commands.run import bound
    from pnfarm.scenario.definition.file import load_scenario
    from pnfarm.scenario.virtual import run_virtual

    binding, config = bound(load_scenario(folder / "memory.scenario.yml"))
    record, _ = await run_virtual(binding, config)
    return _part("memory", binding, record, 1)


async def on_wire(folder: Path = KNOWN) -> Part:
    """The same in real time; the cable of its farm file must be there."""
    from pnfarm.cli.commands.run import bound
    from pnfarm.controller.runtime import Plc
    from pnfarm.farm.process.garbage import keep_what_is_loaded
    from pnfarm.scenario.definition.file import load_scenario
    from pnfarm.scenario.own_farm import run_started
    from pnfarm.station.event_log import EventLog

    for run in range(1, TRIES + 1):
        binding, config = bound(load_scenario(folder / "wire.scenario.yml"))
        async with Plc(config, log=EventLog(quiet=True)):
            outcome = await run_started(binding, config, opened=keep_what_is_loaded)
        if outcome.failure is not None:
            raise outcome.failure
        part = _part("wire", binding, outcome.record, run)
        if part.verdict is not Verdict.INCONCLUSIVE:
            break
    return part


def _part(name: Literal["memory", "wire"], binding: Binding, record: dict[str, Any], runs: int) -> Part:
    steps = list(binding.scenario.every_step())
    checks = [_check(steps[case["number"]], case) for case in record["cases"]]
    path, late = binding.scenario.path, record["lateness"]
    return Part(
        name=name,
        scenario=path.name if path is not None else binding.scenario.name,
        verdict=worst(check.verdict for check in checks),
        seconds=record["seconds"],
        runs=runs,
        late_seconds=None if late is None else late["farm_late_seconds"],
        stalls=None if late is None else late["overruns"],
        checks=checks,
        faults=_faults(steps, record["faults"]),
    )


def _check(step: Step, case: dict[str, Any]) -> Check:
    said = case["verdict"]
    # a step that could not be carried out is not what was expected
    verdict = Verdict.FAILED if said == "error" else Verdict(said)
    observed = case["measured"] or case["message"]
    if verdict is not Verdict.PASSED and case["message"] and observed != case["message"]:
        observed = f"{case['message']} ({observed})"
    return Check(name=case["name"], line=case["line"], expected=_expected(step), observed=observed, verdict=verdict)


def _expected(step: Step) -> str:
    metric = step.get("metric")
    if metric is not None:
        labels = ",".join(f'{key}="{value}"' for key, value in metric.labels.items())
        return f"{metric.name}{{{labels}}} {step.allowed}"
    on = " ".join(step.get("drive") or ())
    what = step.get("that") or step.get("until") or step.title
    return f"{on}{': ' if on else ''}{what}{', ' if step.allowed else ''}{step.allowed}"


def _faults(steps: list[Step], faults: list[dict[str, Any]]) -> list[Fault]:
    """Those that were injected; the steps have their seeds."""
    seeds = {step.values["spec"].get("as"): step.values["spec"].get("seed") for step in steps if step.kind == "fault"}
    return [
        Fault(
            kind=one["kind"], drives=one["drives"], seed=seeds.get(one["name"]), confirmed=one["evidence"]["confirmed"]
        )
        for one in faults
    ]
