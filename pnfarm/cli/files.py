"""``pnfarm validate`` and ``pnfarm schema``, and the reading of a farm file for all commands."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

from pnfarm.terminal.settings import FarmFile  # noqa: TC001 - the command line is made from the annotations

if TYPE_CHECKING:
    from pathlib import Path

    from pnfarm.farm.file.reading import FarmConfig, Known

__all__ = [
    "SchemaOf",
    "check_impairments",
    "counted",
    "known_names",
    "link_text",
    "read",
    "schema",
    "summary",
    "validate",
]


class SchemaOf(StrEnum):
    """Files that have a schema."""

    FARM = "farm"
    SCENARIO = "scenario"


def known_names() -> Known:
    """The installed models and the fault catalogue, which a farm file refers to."""
    from pnfarm.buses.registry import fault_kinds
    from pnfarm.config.known import catalogue

    return catalogue(frozenset(fault_kinds()))


def read(path: Path) -> FarmConfig:
    """A farm file, checked against the models and the fault catalogue.  Raises :class:`FarmFileError`."""
    from pnfarm.farm.file.reading import load_farm

    return load_farm(path, known_names())


def check_impairments(config: FarmConfig) -> None:
    """Check the parameters of the file's impairments; raises :class:`FarmFileError`.

    The farm file's own checks only know the kinds; the fault catalogue knows the parameters of each.
    """
    from pnfarm.buses.registry import fault_kinds
    from pnfarm.farm.file.reading import FarmFileError, FileIssue
    from pnfarm.faults.errors import InjectionError

    issues: list[FileIssue] = []
    for group, drives in enumerate(config.drives):
        for number, impairment in enumerate(drives.impair):
            given = impairment.model_dump(by_alias=True, exclude_none=True) | {"on": "all"}
            given |= {key: f"{given[key]}ns" for key in ("after", "for") if key in given}
            try:
                fault_kinds().parse(given)
            except InjectionError as exc:
                for field, what, allowed in exc.issues:
                    location: tuple[str | int, ...] = ("drives", group, "impair", number, *field.split("."))
                    place = f"drives[{group}].impair[{number}].{field}"
                    issues.append(FileIssue(*config.place(location), place, what, allowed))
    if issues:
        raise FarmFileError(issues)


def check_program(config: FarmConfig) -> None:
    """Load the file of the controller's own program, if it has one; raises :class:`ConfigError`."""
    if config.controller is None or config.controller.program.python is None:
        return
    from pnfarm.controller.program_file import program_of

    program_of(config)


def validate(file: FarmFile) -> None:
    """Check a farm file, or a scenario with its farm: report every error with its line, key and allowed values."""
    from pnfarm.cli.run import is_scenario
    from pnfarm.terminal.output import print_line

    if is_scenario(file):
        print_line(f"{file}: OK, {_scenario_summary(file)}")
        return
    config = read(file)
    check_impairments(config)
    check_program(config)
    print_line(f"{file}: OK, {summary(config)}")


def _scenario_summary(file: Path) -> str:
    from pnfarm.cli.run import bound
    from pnfarm.scenario.file import load_scenario

    scenario = load_scenario(file)
    steps = list(scenario.every_step())
    checks = sum(step.kind == "expect" for step in steps)
    counts = f"{counted(len(steps), 'step')}, {counted(checks, 'expectation')}"
    if scenario.farm_path is None:
        # the drives of a running farm are known when it runs
        return f"{counts}; its drives are not checked: it names no farm file"
    _, config = bound(scenario)
    return f"{counts}, {summary(config)}"


def summary(config: FarmConfig) -> str:
    """A summary of the farm file in one line."""
    from pnfarm.farm.file.reading import expand

    drives = expand(config)
    models: dict[str, int] = {}
    for drive in drives:
        models[drive.model] = models.get(drive.model, 0) + 1
    kinds = ", ".join(f"{count} {model}" for model, count in models.items())
    parts = [f"{counted(len(drives), 'drive')} ({kinds})"] if drives else []
    if config.farm is not None:
        api = config.api
        parts.insert(0, f"farm {config.farm}")
        parts.append(f"on {link_text(config)}")
        parts.append("no API" if api is None else f"API {api.host}:{api.port}")
    if config.controller is not None:
        parts.append(f"controller {config.controller.name}")
        if config.controller.device_names:
            parts.append(f"{counted(len(config.controller.device_names), 'device')} by GSDML file")
    return ", ".join(parts)


def link_text(config: FarmConfig) -> str:
    """``macvlan eth1``, ``veth``."""
    link = config.link
    if link is None:
        return "no link"
    target = getattr(link, "parent", None) or getattr(link, "bridge", None)
    return f"{link.kind} {target}" if target else link.kind


def counted(number: int, word: str) -> str:
    """``1 drive``, ``8 drives``."""
    return f"{number} {word}{'' if number == 1 else 's'}"


def schema(
    of: Annotated[SchemaOf, typer.Argument(metavar="farm|scenario", help="Kind of file.", show_default=False)],
) -> None:
    """Print the JSON Schema of the farm file or the scenario file, for editors."""
    from pnfarm.terminal.output import print_json

    if of is SchemaOf.SCENARIO:
        from pnfarm.scenario.schema import scenario_schema

        print_json(scenario_schema())
        return
    from pnfarm.farm.file.schema import farm_schema

    print_json(farm_schema(known_names()))
