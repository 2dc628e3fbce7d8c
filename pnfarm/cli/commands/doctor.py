"""``pnfarm doctor``: checks whether this machine can run a farm, and how to fix what is missing."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pnfarm.errors import EnvironmentError_
from pnfarm.terminal.output import print_json, print_line, print_next, print_section, print_table
from pnfarm.terminal.settings import Format, FormatOption, ShardOption
from pnfarm.terminal.streams import going_on_unread

if TYPE_CHECKING:
    from pnfarm.farm.doctor.machine import Finding

__all__ = ["doctor"]

_LABELS = {True: "ok", None: "note", False: "MISSING"}


@going_on_unread()
def doctor(
    context: typer.Context,
    file: Annotated[
        Path | None,
        typer.Argument(
            help="Farm file to check on this machine: its interface, address and folder, the processor time of its "
            "drives, its serial lines, whose ports must not be in use; and whether a PLC with it will be green.",
            metavar="[FILE]",
            show_default=False,
        ),
    ] = None,
    shard: ShardOption = None,
    project: Annotated[
        Path | None,
        typer.Option(
            "--project",
            metavar="PROJECT",
            help="The PLC's project (CAx data, L5X, SIMATIC AX): whether each of its stations will be green.",
            show_default=False,
        ),
    ] = None,
    folders: Annotated[
        list[Path] | None,
        typer.Option(
            "--gsdml",
            "--gsd",
            "--eds",
            metavar="DIR",
            help="With --project: folder with description files of its devices, beside FILE's own.  Repeatable.",
            show_default=False,
        ),
    ] = None,
    output: FormatOption = Format.TABLE,
) -> None:
    """Check whether this machine can run a farm, and show how to fix what is missing.

    Exit code 4: this machine lacks something; 1: it does not, but a station of FILE would not be green in the PLC.
    """
    from pnfarm.cli.farm_file import counted, read, shard_option
    from pnfarm.farm.doctor.machine import examine

    if project is not None and file is None:
        raise typer.BadParameter("is compared with a farm file, which is missing", param_hint="--project")
    config = None if file is None else read(file)
    findings = examine()
    if config is not None:
        from pnfarm.cli.cell_doctor import examine_cell
        from pnfarm.cli.file_doctor import examine_file
        from pnfarm.farm.doctor.lines import examine_lines

        findings += [*examine_file(config, shard_option(context, shard)), *examine_lines(config)]
        findings += examine_cell(config)
        if project is not None:
            from pnfarm.cli.projects.check import examine_project

            findings += examine_project(config, project, folders or ())
    wrong = [finding for finding in findings if finding.ok is False]
    red = [finding for finding in wrong if finding.keeps_red]
    missing = len(wrong) - len(red)
    if output is Format.JSON:
        print_json({"ok": not wrong, "findings": [asdict(finding) for finding in findings]})
    else:
        rows = [(_label(finding), finding.name, finding.detail) for finding in findings]
        print_table(("", "WHAT", "~FINDING"), rows)
        remedies = [(_where(finding), finding.remedy) for finding in findings if finding.remedy]
        if remedies:
            print_section(("WHAT", "~HOW TO FIX IT"), remedies)
        print_line()
        print_line(_verdict(missing, file))
        if red:
            print_line(f"{counted(len(red), 'thing')} in {file} will keep a PLC from being green.")
        if not wrong:
            print_next("pnfarm up FILE" if file is None else f"pnfarm up {file}")
    if wrong:
        raise typer.Exit(EnvironmentError_.exit_code if missing else 1)


def _label(finding: Finding) -> str:
    return "RED" if finding.ok is False and finding.keeps_red else _LABELS[finding.ok]


def _where(finding: Finding) -> str:
    return f"{finding.name} (line {finding.line})" if finding.line else finding.name


def _verdict(missing: int, file: Path | None) -> str:
    farm = "a farm" if file is None else str(file)
    if not missing:
        return f"This machine can run {farm}."
    return f"This machine lacks {missing} thing{'' if missing == 1 else 's'} that {farm} needs."
