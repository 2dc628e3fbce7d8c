"""``pnfarm validate`` and ``pnfarm schema``."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

from pnfarm.cli.farm_file import (
    check_impairments,
    check_program,
    counted,
    described,
    known_names,
    read,
    shard_option,
    summary,
)
from pnfarm.terminal.output import print_json, print_line, print_next
from pnfarm.terminal.settings import FarmFile, ShardOption  # noqa: TC001 - the command line is made from the annotations

if TYPE_CHECKING:
    from pathlib import Path

    from pnfarm.farm.file.reading import FarmConfig
    from pnfarm.farm.shard import Shard

__all__ = ["SchemaOf", "schema", "validate"]


class SchemaOf(StrEnum):
    """Files that have a schema."""

    FARM = "farm"
    SCENARIO = "scenario"
    VERIFY = "verify"


def validate(context: typer.Context, file: FarmFile, shard: ShardOption = None) -> None:
    """Check a farm file, or a scenario with its farm: report every error with its line, key and allowed values.

    With a shard, also name its drives.
    """
    from pnfarm.cli.commands.run import is_scenario

    if is_scenario(file):
        print_line(f"{file}: OK, {_scenario_summary(file)}")
        print_next(f"pnfarm run {file} --virtual, or without --virtual on the farm's own link")
        return
    config = read(file)
    check_impairments(config)
    check_program(config)
    print_line(f"{file}: OK, {summary(config)}")
    for note in config.notes:
        print_line(f"note: {note}")
    for sentence in described(config):
        print_line(sentence)
    part = shard_option(context, shard)
    if part is not None:
        print_line(_shard_text(config, part))
    in_memory = config.link is not None and config.link.kind == "memory"
    which = f"{file}" if part is None else f"{file} --shard {part}"
    print_next(f"pnfarm up {which}" if in_memory else f"pnfarm doctor {which}, then pnfarm up {which}")


def _shard_text(config: FarmConfig, shard: Shard) -> str:
    """How many drives of the farm a shard has, and which."""
    from pnfarm.farm.file.reading import expand_all
    from pnfarm.farm.shard import part_of

    whole = expand_all(config)
    part = part_of(config, whole, shard)
    names = ", ".join(one.name for one in part)
    word = "station" if config.devices else "drive"
    return f"shard {shard}: {len(part)} of {counted(len(whole), word)}: {names}"


def _scenario_summary(file: Path) -> str:
    from pnfarm.cli.commands.run import bound
    from pnfarm.scenario.definition.file import load_scenario

    scenario = load_scenario(file)
    steps = list(scenario.every_step())
    checks = sum(step.kind == "expect" for step in steps)
    counts = f"{counted(len(steps), 'step')}, {counted(checks, 'expectation')}"
    if scenario.runs:
        counts += f" in each of {counted(len(scenario.runs), 'run')}"
    if scenario.farm_path is None:
        # the drives of a running farm are known when it runs
        return f"{counts}; its drives are not checked: it names no farm file"
    # every run is checked, and the first one shown
    configs = [bound(one)[1] for one in scenario.runs or (scenario,)]
    return f"{counts}, {summary(configs[0])}"


def schema(
    of: Annotated[SchemaOf, typer.Argument(metavar="farm|scenario|verify", help="Kind of file.", show_default=False)],
) -> None:
    """Print the JSON Schema of the farm file or the scenario file, for editors, or of the report of `verify`."""
    if of is SchemaOf.SCENARIO:
        from pnfarm.scenario.definition.schema import scenario_schema

        print_json(scenario_schema())
        return
    if of is SchemaOf.VERIFY:
        from pnfarm.cli.verify.report import report_schema

        print_json(report_schema())
        return
    from pnfarm.farm.file.schema import farm_schema

    print_json(farm_schema(known_names()))
