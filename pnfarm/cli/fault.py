"""``pnfarm fault``: inject faults into a running farm, list and clear them, and print the catalogue."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from pnfarm.terminal.settings import DEFAULT_URL, ApiOption, Format, FormatOption, TokenOption, help_without_command

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["app"]

app = typer.Typer(help="Inject faults into the drives of the running farm, and clear them.")
app.callback(invoke_without_command=True)(help_without_command)


@app.command("kinds")
def kinds(output: FormatOption = Format.TABLE) -> None:
    """List all kinds of fault with their parameters."""
    from pnfarm.buses.registry import fault_kinds
    from pnfarm.terminal.output import print_json, print_table

    catalogue = [kind.as_dict() for kind in fault_kinds().values()]
    if output is Format.JSON:
        print_json({"kinds": catalogue})
        return
    rows: list[tuple[str, ...]] = []
    for kind in catalogue:
        rows.append((kind["kind"], kind["family"], " ".join(kind["directions"]), kind["doc"]))
        for name, spec in kind["params"].items():
            default = "" if spec["default"] is None else f"; default {spec['default']}"
            rows.append((f"  {name}=", "", "", f"{spec['doc']}  {spec['allowed']}{default}"))
    print_table(("KIND", "FAMILY", "DIRECTION", "~WHAT IT DOES"), rows)


@app.command("add")
def add(
    kind: Annotated[str, typer.Argument(metavar="KIND", help="One of `pnfarm fault kinds`.", show_default=False)],
    on: Annotated[
        list[str],
        typer.Option("--on", metavar="GLOB", help="Drives: a name or glob, model:NAME, or all.  Repeatable."),
    ],
    param: Annotated[
        list[str] | None, typer.Option("--param", "-p", metavar="K=V", help="A parameter of the kind.  Repeatable.")
    ] = None,
    duration: Annotated[
        str | None, typer.Option("--for", metavar="TIME", help="End after this time, such as 500ms or 5s.")
    ] = None,
    count: Annotated[int | None, typer.Option(help="End after this many occurrences.")] = None,
    cycles: Annotated[int | None, typer.Option(help="End after this many cycles.")] = None,
    probability: Annotated[
        float | None, typer.Option(min=0, max=1, help="Probability of each occurrence, above 0, at most 1.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the random choices, to repeat a run.")] = None,
    direction: Annotated[str | None, typer.Option(help="in, out or both, seen from the drive.")] = None,
    after_cycles: Annotated[int | None, typer.Option(help="Begin after this many healthy cycles.")] = None,
    after: Annotated[str | None, typer.Option(metavar="TIME", help="Begin after this time, such as 1s.")] = None,
    name: Annotated[
        str | None, typer.Option("--as", metavar="ID", help="Name for the fault, to list and clear it by.")
    ] = None,
    output: FormatOption = Format.TABLE,
    api: ApiOption = DEFAULT_URL,
    token: TokenOption = None,
) -> None:
    """Inject a fault."""
    from pnfarm.terminal.client import FarmClient
    from pnfarm.terminal.output import print_json, print_line

    body: dict[str, Any] = {"kind": kind, "on": on, "params": dict(map(_parameter, param or []))}
    wanted = {
        "for": duration,
        "count": count,
        "cycles": cycles,
        "probability": probability,
        "seed": seed,
        "direction": direction,
        "after_cycles": after_cycles,
        "after": after,
        "as": name,
    }
    body |= {key: value for key, value in wanted.items() if value is not None}
    with FarmClient(api, token) as farm:
        fault = farm.post("faults", body=body)
    if output is Format.JSON:
        print_json(fault)
    else:
        print_line(f"{fault['id']}: {fault['kind']} {fault['state']} on {_shortened(list(fault['drives']))}")


@app.command("list")
def show(
    fault_id: Annotated[
        str | None,
        typer.Argument(metavar="ID", help="One fault; also one that has ended recently.", show_default=False),
    ] = None,
    output: FormatOption = Format.TABLE,
    api: ApiOption = DEFAULT_URL,
    token: TokenOption = None,
) -> None:
    """List the pending and active faults, or one fault, with their evidence."""
    from pnfarm.terminal.client import FarmClient
    from pnfarm.terminal.output import print_json, print_line, print_table

    with FarmClient(api, token) as farm:
        found = farm.get("faults") if fault_id is None else {"faults": [farm.get("faults", fault_id)]}
    if output is Format.JSON:
        print_json(found)
        return
    if not found["faults"]:
        print_line("no fault is pending or active")
        return
    columns = ("ID", "KIND", "STATE", ">CHECKS", ">ACTIVATIONS", "CONFIRMED", "~DRIVES")
    rows = [
        (
            fault["id"],
            fault["kind"],
            fault["state"],
            fault["evidence"]["checks"],
            fault["evidence"]["activations"],
            "yes" if fault["evidence"]["confirmed"] else "no",
            _shortened(list(fault["drives"])),
        )
        for fault in found["faults"]
    ]
    print_table(columns, rows)


@app.command("clear")
def clear(
    fault_id: Annotated[
        str | None, typer.Argument(metavar="ID", help="One fault; default: all.", show_default=False)
    ] = None,
    output: FormatOption = Format.TABLE,
    api: ApiOption = DEFAULT_URL,
    token: TokenOption = None,
) -> None:
    """Clear a fault, or all of them; the drives return to normal."""
    from pnfarm.terminal.client import FarmClient
    from pnfarm.terminal.output import print_json, print_line

    with FarmClient(api, token) as farm:
        found = farm.post("reset") if fault_id is None else farm.delete("faults", fault_id)
    if output is Format.JSON:
        print_json(found)
        return
    cleared = found["cleared"] if fault_id is None else [found["id"]]
    print_line(f"cleared {_shortened(cleared)}" if cleared else "no fault was active")


def _parameter(text: str) -> tuple[str, Any]:
    from pnfarm.errors import ConfigError

    key, equals, value = text.partition("=")
    if not equals or not key:
        raise ConfigError(f"--param {text!r} is not a parameter; give NAME=VALUE such as hold=true")
    return key.strip(), _scalar(value.strip())


def _scalar(text: str) -> int | float | bool | str:
    """A value as in a farm file: true, false, a number, otherwise text."""
    if text in {"true", "false"}:
        return text == "true"
    for kind in (lambda word: int(word, 0), float):
        try:
            value = kind(text)
        except ValueError:
            continue
        # "nan" and "inf" are text, as in JSON
        return value if abs(value) < float("inf") else text
    return text


def _shortened(names: Sequence[str], most: int = 8) -> str:
    rest = len(names) - most
    return " ".join(names[:most]) + (f" and {rest} more" if rest > 0 else "")
