"""``pnfarm state``: the state of the whole running farm, saved and restored."""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pnfarm.terminal import client
from pnfarm.terminal.output import print_json, print_line, print_table
from pnfarm.terminal.partial import raise_for_missing
from pnfarm.terminal.settings import (
    DEFAULT_URL,
    ApiOption,
    Format,
    FormatOption,
    TlsCaOption,
    TokenOption,
    help_without_command,
)

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

__all__ = ["app"]

app = typer.Typer(help="Save the state of the running farm, and begin a test in the middle of a sequence.")
app.callback(invoke_without_command=True)(help_without_command)

NameArgument = Annotated[str, typer.Argument(metavar="NAME", help="The state's name.")]


@app.command("save")
def save(
    name: NameArgument,
    output: FormatOption = Format.TABLE,
    api: ApiOption = DEFAULT_URL,
    token: TokenOption = None,
    tls_ca: TlsCaOption = None,
) -> None:
    """Save the farm as it is now: drives, devices, plant. An earlier state of that name is replaced."""
    _do(lambda farm: farm.put("states", name, body={}), f"saved {name}", output, api, token, tls_ca)


@app.command("restore")
def restore(
    name: NameArgument,
    check: Annotated[bool, typer.Option("--check", help="Only find out whether it can be restored.")] = False,
    output: FormatOption = Format.TABLE,
    api: ApiOption = DEFAULT_URL,
    token: TokenOption = None,
    tls_ca: TlsCaOption = None,
) -> None:
    """Put the farm into a saved state, all of it or nothing; controllers set their connections up again."""
    query = {"check": "true"} if check else {}
    done = f"{name} can be restored" if check else f"restored {name}"
    _do(lambda farm: farm.post("states", name, "restore", query=query), done, output, api, token, tls_ca)


@app.command("list")
def show(
    output: FormatOption = Format.TABLE,
    api: ApiOption = DEFAULT_URL,
    token: TokenOption = None,
    tls_ca: TlsCaOption = None,
) -> None:
    """List the saved states of the farm."""
    with client.FarmClient(api, token, tls_ca) as farm:
        found = farm.get("states")
    if output is Format.JSON:
        print_json(found)
    elif found["states"]:
        rows = [(one["state"], _when(one["saved"]), one["octets"], one.get("shard", "")) for one in found["states"]]
        print_table(("STATE", "SAVED", ">OCTETS", "SHARD"), rows)
    else:
        print_line("the farm has no saved states")
    raise_for_missing(found)


@app.command("delete")
def delete(
    name: NameArgument,
    output: FormatOption = Format.TABLE,
    api: ApiOption = DEFAULT_URL,
    token: TokenOption = None,
    tls_ca: TlsCaOption = None,
) -> None:
    """Delete a saved state."""
    _do(lambda farm: farm.delete("states", name), f"deleted {name}", output, api, token, tls_ca)


def _do(
    ask: Callable[[client.FarmClient], Any], done: str, output: Format, api: str, token: str | None, tls_ca: Path | None
) -> None:
    with client.FarmClient(api, token, tls_ca) as farm:
        found = ask(farm)
    if output is Format.JSON:
        print_json(found)
        return
    print_line(done)
    for note in found["notes"]:
        print_line(note)


def _when(seconds: float) -> str:
    return datetime.fromtimestamp(seconds).astimezone().isoformat(" ", "seconds")
