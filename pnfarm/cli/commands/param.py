"""``pnfarm param``: a drive's parameters, by number or by the manual's name."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from pnfarm.cli.completion import complete_drive
from pnfarm.errors import ConfigError
from pnfarm.terminal import client
from pnfarm.terminal.output import print_found, print_line
from pnfarm.terminal.settings import (
    DEFAULT_URL,
    ApiOption,
    Format,
    FormatOption,
    TlsCaOption,
    TokenOption,
    help_without_command,
)

__all__ = ["app"]

app = typer.Typer(help="Read and write a drive's parameters.")
app.callback(invoke_without_command=True)(help_without_command)

Drive = Annotated[
    str,
    typer.Argument(
        metavar="NAME",
        help="Drive of the running farm; with --line a station address.",
        show_default=False,
        autocompletion=complete_drive,
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

LineOption = Annotated[
    str | None,
    typer.Option(
        "--line",
        metavar="WAY",
        help="Ask a station on a serial line without another master, not the farm: path of a pty or port, "
        "HOST:PORT, or rfc2217://HOST:PORT.",
        show_default=False,
    ),
]
BaudOption = Annotated[int, typer.Option("--baud", metavar="RATE", help="With --line: the line's bits per second.")]
OwnOption = Annotated[int, typer.Option("--own-address", metavar="N", help="With --line: this master's address.")]
ModelOption = Annotated[
    str | None,
    typer.Option(
        "--model",
        metavar="MODEL",
        help="With --line: the model whose parameter names and types are used.",
        show_default=False,
    ),
]


@app.command("get")
def get(
    name: Drive,
    pnu: Pnu,
    line: LineOption = None,
    baud: BaudOption = 1_500_000,
    own: OwnOption = 0,
    model: ModelOption = None,
    output: FormatOption = Format.TABLE,
    api: ApiOption = DEFAULT_URL,
    token: TokenOption = None,
    tls_ca: TlsCaOption = None,
) -> None:
    """Read a parameter, of a drive of the running farm or of any station on a line."""
    if line is not None:
        from pnfarm.cli.param_line import ask

        print_found(ask(line, name, pnu, None, baud=baud, own=own, model=model), output, _show)
        return
    with client.FarmClient(api, token, tls_ca) as farm:
        print_found(farm.get("drives", name, "params", pnu), output, _show)


# a negative value is a value, not an option
@app.command("set", context_settings={"ignore_unknown_options": True})
def put(
    name: Drive,
    pnu: Pnu,
    value: Annotated[
        str, typer.Argument(metavar="VALUE", help="Value as it is sent on the wire, decimal or 0x.", show_default=False)
    ],
    line: LineOption = None,
    baud: BaudOption = 1_500_000,
    own: OwnOption = 0,
    model: ModelOption = None,
    output: FormatOption = Format.TABLE,
    api: ApiOption = DEFAULT_URL,
    token: TokenOption = None,
    tls_ca: TlsCaOption = None,
) -> None:
    """Write a parameter and print the value that the drive then has."""
    wanted = _number(value)
    if line is not None:
        from pnfarm.cli.param_line import ask

        print_found(ask(line, name, pnu, wanted, baud=baud, own=own, model=model), output, _show)
        return
    with client.FarmClient(api, token, tls_ca) as farm:
        print_found(farm.put("drives", name, "params", pnu, body={"value": wanted}), output, _show)


def _number(text: str) -> int:
    try:
        return int(text, 0)
    except ValueError:
        pass
    try:
        # int(text, 0) would refuse a leading zero: 010 is ten
        return int(text, 10)
    except ValueError as exc:
        raise ConfigError(f"{text!r} is not a parameter value; give a whole number such as 12 or 0x0C") from exc


def _show(found: dict[str, Any]) -> None:
    values = found.get("values")
    numbers = values if values and not found["subindex"] else [found["value"]]
    value = " ".join(map(str, numbers))
    unit, factor = found.get("unit", ""), found.get("factor", 1)
    if unit and factor != 1:
        unit = f"({' '.join(f'{number * factor:.10g}' for number in numbers)} {unit})"
    named = f" {found['name']}" if found["name"] else ""
    print_line(f"{found['drive']} {found['pnu']}.{found['subindex']}{named} = {value} {unit}".rstrip())
