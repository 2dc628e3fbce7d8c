"""``pnfarm token``: the file of tokens that a farm or a hub takes."""

from __future__ import annotations

import re
import time
from pathlib import Path
from typing import Annotated

import typer

from pnfarm.errors import ConfigError
from pnfarm.terminal.output import print_json, print_line, print_table
from pnfarm.terminal.settings import Format, FormatOption, help_without_command

__all__ = ["app"]

app = typer.Typer(help="Tokens with a role and an end, for `pnfarm up --tokens` and `pnfarm hub --tokens`.")
app.callback(invoke_without_command=True)(help_without_command)

TokensArgument = Annotated[Path, typer.Argument(metavar="FILE", help="File of the tokens.", show_default=False)]
_DAYS = re.compile(r"([0-9]{1,5}) ?d")


@app.command("add")
def add(
    file: TokensArgument,
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of its user.", show_default=False)],
    role: Annotated[
        str, typer.Option(metavar="ROLE", help="What it may do: read, inject (also disturb), admin (everything).")
    ] = "read",
    expires: Annotated[
        str, typer.Option(metavar="WHEN", help="A time from now (30d, 12h), a date or time (2027-01-31), or never.")
    ] = "90d",
) -> None:
    """Add a token, and the file where there is none; prints its secret, this once.

    Running farms accept it at once.
    """
    from pnfarm.api.access.token_file import add_token
    from pnfarm.web.roles import Role

    if role not in set(Role):
        raise ConfigError(f"--role {role!r} is not a role; allowed: {', '.join(Role)}")
    secret = add_token(file, name, Role(role), _ends(expires))
    typer.echo(secret)


@app.command("list")
def show(file: TokensArgument, output: FormatOption = Format.TABLE) -> None:
    """List the tokens of a file, without their secrets, which are not stored."""
    from pnfarm.api.access.token_file import read_tokens

    now = time.time()
    found = [
        {
            "name": holder.name,
            "role": holder.role.value,
            "expires": holder.until,
            "expired": holder.ends is not None and holder.ends <= now,
        }
        for holder in read_tokens(file)
    ]
    if output is Format.JSON:
        print_json({"tokens": found})
        return
    rows = [
        (str(one["name"]), str(one["role"]), f"{one['expires']}{', expired' if one['expired'] else ''}")
        for one in found
    ]
    print_table(("NAME", "ROLE", "EXPIRES"), rows)


@app.command("remove")
def remove(
    file: TokensArgument,
    names: Annotated[list[str], typer.Argument(metavar="NAME...", help="Names of their users.", show_default=False)],
) -> None:
    """Remove tokens; running farms refuse them at once."""
    from pnfarm.api.access.token_file import remove_tokens

    remove_tokens(file, names)
    print_line(f"removed {', '.join(names)}")


def _ends(text: str) -> float | None:
    """In seconds since 1970; raises :class:`ConfigError`."""
    from pnfarm.api.access.token_file import moment

    now = int(time.time())
    try:
        ends = moment(text) if (left := _seconds(text)) is None else float(now + left)
    except ValueError as exc:
        allowed = "30d, 12h, 2027-01-31, 2027-01-31T12:00:00Z or never"
        raise ConfigError(f"--expires {text!r} is not a time; allowed: {allowed}") from exc
    if ends is not None and ends <= now:
        raise ConfigError(f"--expires {text} is over already")
    return ends


def _seconds(text: str) -> int | None:
    """Of a time from now; None for another text."""
    from pnfarm.vocabulary.durations import parse_duration

    if (days := _DAYS.fullmatch(text)) is not None:
        return int(days[1]) * 86_400
    try:
        return parse_duration(text) // 1_000_000_000
    except ValueError:
        return None
