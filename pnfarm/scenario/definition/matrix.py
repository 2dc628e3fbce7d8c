"""The runs of a scenario's matrix: their records together, and those of runs that did not begin."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.scenario.report.record import Case, Record, Verdict, worst

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pnfarm.scenario.definition.binding import Binding
    from pnfarm.scenario.definition.file import Scenario

__all__ = ["not_begun", "runs_of", "together"]


def not_begun(binding: Binding, farm: str, why: str, *, broken: bool = False) -> dict[str, Any]:
    """The record of a run that did not begin: its expectations are `not run`."""
    record = Record(binding.scenario, farm, list(binding.drives), 0)
    for number, step in binding.scenario.expectations():
        record.add(Case(number, step, Verdict.NOT_RUN, 0, 0, message=why))
    record.end(0, why, None, broken=broken)
    return record.as_dict()


def together(scenario: Scenario, records: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """One record of all runs, in their order; ``runs`` has each."""
    return {
        "scenario": scenario.name,
        "state": "ended",
        "verdict": worst(record["verdict"] for record in records).value,
        "ended_early": next((record["ended_early"] for record in records if record["ended_early"]), ""),
        "seconds": sum(record["seconds"] for record in records),
        "counts": {verdict.value: sum(record["counts"][verdict.value] for record in records) for verdict in Verdict},
        "description": scenario.description,
        "file": str(scenario.path) if scenario.path is not None else "",
        "farm": records[0]["farm"],
        "farm_ended": any(record["farm_ended"] for record in records),
        "runs": list(records),
    }


def runs_of(record: Mapping[str, Any]) -> Sequence[Mapping[str, Any]]:
    """The runs of a record: those of its matrix, or itself."""
    found: Sequence[Mapping[str, Any]] = record.get("runs") or [record]
    return found
