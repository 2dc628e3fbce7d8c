"""``pnfarm audit``: is an audit log whole."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated

import typer

from pnfarm.terminal.output import print_json, print_line
from pnfarm.terminal.settings import Format, FormatOption, help_without_command

__all__ = ["app"]

app = typer.Typer(help="The audit log of `pnfarm up --audit` and `pnfarm hub --audit`.")
app.callback(invoke_without_command=True)(help_without_command)


@app.command("check")
def check(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...",
            help="The audit log; earlier parts that were moved away come before it, oldest first.",
            show_default=False,
        ),
    ],
    noted: Annotated[
        str | None,
        typer.Option(metavar="DIGEST", help="Digest that was noted elsewhere: its line must still be there."),
    ] = None,
    output: FormatOption = Format.TABLE,
) -> int:
    """Check that no line was changed, added or removed; print the last number and digest, to be noted elsewhere.

    Exit codes: 0 it is intact, 1 it is not, 2 it cannot be read.
    """
    from pnfarm.api.access.audit_check import check_audit

    found = check_audit(*files, noted=noted)
    wrong = list(found.wrong)
    if noted is not None and not found.is_noted:
        wrong.append(f"no line has the digest {noted}: the file was shortened or rewritten")
    if output is Format.JSON:
        print_json({**dataclasses.asdict(found), "wrong": wrong, "ok": not wrong})
        return 1 if wrong else 0
    for one in (*wrong, *(f"note: {note}" for note in found.notes)):
        print_line(one)
    last = files[-1]
    if found.more:
        print_line(f"{last}: and {found.more} more")
    span = f", from {found.first_time} to {found.last_time}" if found.records else ""
    verdict = "NOT WHOLE" if wrong else "whole"
    print_line(f"{last}: {verdict}, {found.records} records, {found.requests} requests{span}")
    print_line(f"last: {found.sequence} {found.digest}")
    return 1 if wrong else 0
