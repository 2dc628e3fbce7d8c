"""``pnfarm doctor``: checks whether this machine can run a farm, and how to fix what is missing."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from pnfarm.errors import EnvironmentError_
from pnfarm.terminal.output import print_json, print_line, print_next, print_section, print_table
from pnfarm.terminal.settings import Format, FormatOption, ShardOption

__all__ = ["doctor"]

_LABELS = {True: "ok", None: "note", False: "MISSING"}


def doctor(
    context: typer.Context,
    file: Annotated[
        Path | None,
        typer.Argument(
            help="Farm file to check on this machine: its interface, address and folder, the processor time of its "
            "drives, its serial lines, whose ports must not be in use.",
            metavar="[FILE]",
            show_default=False,
        ),
    ] = None,
    shard: ShardOption = None,
    output: FormatOption = Format.TABLE,
) -> None:
    """Check whether this machine can run a farm, and show how to fix what is missing."""
    from pnfarm.cli.farm_file import read, shard_option
    from pnfarm.farm.doctor.machine import examine

    config = None if file is None else read(file)
    findings = examine()
    if config is not None:
        from pnfarm.cli.file_doctor import examine_file
        from pnfarm.farm.doctor.lines import examine_lines

        findings += [*examine_file(config, shard_option(context, shard)), *examine_lines(config)]
    missing = [finding for finding in findings if finding.ok is False]
    if output is Format.JSON:
        print_json({"ok": not missing, "findings": [asdict(finding) for finding in findings]})
    else:
        rows = [(_LABELS[finding.ok], finding.name, finding.detail) for finding in findings]
        print_table(("", "WHAT", "~FINDING"), rows)
        remedies = [finding for finding in findings if finding.remedy]
        if remedies:
            print_section(("WHAT", "~HOW TO FIX IT"), [(finding.name, finding.remedy) for finding in remedies])
        print_line()
        print_line(_verdict(len(missing), file))
        if not missing:
            print_next("pnfarm up FILE" if file is None else f"pnfarm up {file}")
    if missing:
        raise typer.Exit(EnvironmentError_.exit_code)


def _verdict(missing: int, file: Path | None) -> str:
    farm = "a farm" if file is None else str(file)
    if not missing:
        return f"This machine can run {farm}."
    return f"This machine lacks {missing} thing{'' if missing == 1 else 's'} that {farm} needs."
