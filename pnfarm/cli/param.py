"""``pnfarm param``: a drive's parameters, by number or by the manual's name."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from pnfarm.cli.completion import complete_drive
from pnfarm.terminal.settings import DEFAULT_URL, ApiOption, Format, FormatOption, TokenOption, help_without_command

__all__ = ["app"]

app = typer.Typer(help="Read and write a drive's parameters.")
app.callback(invoke_without_command=True)(help_without_command)

Drive = Annotated[
    str,
    typer.Argument(
        metavar="NAME", help="Drive of the running farm.", show_default=False, autocompletion=complete_drive
    ),
]
Pnu = Annotated[
    str,
    typer.Argument(
        metavar="PNU[.SUB]",
        help="Parameter number (also as 0x2317), with .SUB for an array element; or the manual's name.",
        show_default=False,
    ),
]


@app.command("get")
def get(
    name: Drive,
    pnu: Pnu,
    output: FormatOption = Format.TABLE,
    api: ApiOption = DEFAULT_URL,
    token: TokenOption = None,
) -> None:
    """Read a parameter."""
    from pnfarm.terminal.client import FarmClient

    with FarmClient(api, token) as farm:
        _show(farm.get("drives", name, "params", pnu), output)


# a negative value is a value, not an option
@app.command("set", context_settings={"ignore_unknown_options": True})
def put(
    name: Drive,
    pnu: Pnu,
    value: Annotated[
        str, typer.Argument(metavar="VALUE", help="Value as it is sent on the wire, decimal or 0x.", show_default=False)
    ],
    output: FormatOption = Format.TABLE,
    api: ApiOption = DEFAULT_URL,
    token: TokenOption = None,
) -> None:
    """Write a parameter and print the value that the drive then has."""
    from pnfarm.terminal.client import FarmClient

    wanted = _number(value)
    with FarmClient(api, token) as farm:
        _show(farm.put("drives", name, "params", pnu, body={"value": wanted}), output)


def _number(text: str) -> int:
    from pnfarm.errors import ConfigError

    try:
        return int(text, 0)
    except ValueError:
        pass
    try:
        # int(text, 0) would refuse a leading zero: 010 is ten
        return int(text, 10)
    except ValueError as exc:
        raise ConfigError(f"{text!r} is not a parameter value; give a whole number such as 12 or 0x0C") from exc


def _show(found: dict[str, Any], output: Format) -> None:
    from pnfarm.terminal.output import print_json, print_line

    if output is Format.JSON:
        print_json(found)
        return
    values = found.get("values")
    value = " ".join(map(str, values)) if values and not found["subindex"] else str(found["value"])
    unit = f" {found['unit']}" if found.get("unit") else ""
    print_line(f"{found['drive']} {found['pnu']}.{found['subindex']} {found['name']} = {value}{unit}")
