"""``pnfarm fault``: inject faults into a running farm, list and clear them, and print the catalogue."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from pnfarm.cli.completion import complete_drive, complete_fault, complete_kind
from pnfarm.errors import ConfigError, PnfarmError
from pnfarm.terminal import client
from pnfarm.terminal.output import print_found, print_json, print_line, print_next, print_section, print_table
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
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import did_you_mean, shortened
from pnfarm.vocabulary.samples import with_files

__all__ = ["app"]

app = typer.Typer(help="Inject faults into the drives of the running farm, and clear them.")
app.callback(invoke_without_command=True)(help_without_command)


@app.command("kinds")
def kinds(
    kind: Annotated[
        str | None,
        typer.Argument(
            metavar="KIND",
            help="Show one kind in full; default: a list of all.",
            show_default=False,
            autocompletion=complete_kind,
        ),
    ] = None,
    output: FormatOption = Format.TABLE,
) -> None:
    """List all kinds of fault with their parameters, or show one: what it does, on the wire and to a controller."""
    from pnfarm.buses.registry import fault_kinds

    if kind is not None:
        known = fault_kinds()
        if kind not in known:
            raise ConfigError(
                f"there is no kind of fault {kind!r}{did_you_mean(kind, known)}; `pnfarm fault kinds` lists them"
            )
        print_found(known[kind].as_dict(), output, _print_kind)
        return
    print_found({"kinds": [kind.as_dict() for kind in fault_kinds().values()]}, output, _print_kinds)


def _print_kinds(found: dict[str, Any]) -> None:
    rows: list[tuple[str, ...]] = []
    for one in found["kinds"]:
        rows.append((one["kind"], one["family"], " ".join(one["directions"]), one["doc"]))
        for name, spec in one["params"].items():
            default = "" if spec["default"] is None else f"; default {spec['default']}"
            rows.append((f"  {name}=", "", "", f"{spec['doc']}  Allowed: {spec['allowed']}{default}."))
    print_table(("KIND", "FAMILY", "DIRECTION", "~WHAT IT DOES"), rows)


def _print_kind(kind: dict[str, Any]) -> None:
    rows = [
        ("what it does", kind["doc"]),
        ("family", kind["family"]),
        ("an occurrence", kind["occurrence"]),
        ("direction", ", ".join(kind["directions"]) or "none"),
        ("on the wire", kind["wire"]),
        ("controllers", kind["reports"]),
    ]
    for bus, one in kind["buses"].items():
        if one["refused"]:
            rows.append((f"on {bus}", f"refused: {one['refused']}"))
            continue
        rows += [
            (f"on {bus}: {what}", one[key]) for what, key in (("wire", "wire"), ("controllers", "reports")) if one[key]
        ]
    rows.append(("common fields", ", ".join(dict.fromkeys(["after", "after_cycles", *kind["takes"]]))))
    print_table(("KIND", f"~{kind['kind']}"), rows)
    if kind["params"]:
        params = [
            (name, "required" if spec["required"] else "" if spec["default"] is None else str(spec["default"]),
             f"{spec['doc']} Allowed: {spec['allowed']}." + (f" [{spec['unit']}]" if spec["unit"] else ""))
            for name, spec in kind["params"].items()
        ]  # fmt: skip
        print_section(("PARAMETER", "DEFAULT", "~MEANING"), params)
    needed = [name for name, spec in kind["params"].items() if spec["required"]]
    given = "".join(f" -p {name}=..." for name in needed)
    print_line()
    print_line(f"next: pnfarm fault add {kind['kind']} --on DRIVE{given} --dry-run")


@app.command("add", context_settings={"allow_extra_args": True, "ignore_unknown_options": True})
def add(
    context: typer.Context,
    kind: Annotated[
        str,
        typer.Argument(
            metavar="KIND", help="One of `pnfarm fault kinds`.", show_default=False, autocompletion=complete_kind
        ),
    ],
    on: Annotated[
        list[str],
        typer.Option(
            "--on",
            metavar="GLOB",
            help="Drives: a name or glob, model:NAME, or all.  Repeatable.",
            autocompletion=complete_drive,
        ),
    ],
    param: Annotated[
        list[str] | None,
        typer.Option(
            "--param",
            "-p",
            metavar="K=V",
            help="A parameter of the kind.  Repeatable.  `--K V` is the same, where no option has its name.",
        ),
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
    when: Annotated[
        str | None,
        typer.Option(metavar="CONDITION", help="Begin once this holds on the drive, such as 'velocity > 1000'."),
    ] = None,
    after_cycles: Annotated[int | None, typer.Option(help="Begin after this many healthy cycles.")] = None,
    after: Annotated[str | None, typer.Option(metavar="TIME", help="Begin after this time, such as 1s.")] = None,
    share: Annotated[
        str | None, typer.Option(metavar="PERCENT", help="Only this part of the drives, such as 25%, by the seed.")
    ] = None,
    most: Annotated[int | None, typer.Option(help="At most N of the drives, chosen by the seed.")] = None,
    rate: Annotated[
        str | None, typer.Option(metavar="RATE", help="Begin repeatedly at random, at this rate, such as 2/min.")
    ] = None,
    times: Annotated[int | None, typer.Option(help="With --rate: begin N times on each drive.")] = None,
    ttl: Annotated[
        str | None, typer.Option(metavar="TIME", help="End after this time unless it is renewed, such as 10s.")
    ] = None,
    hold: Annotated[
        bool, typer.Option("--hold", help="Keep it in force while this command runs; it renews --ttl (5s).")
    ] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Change nothing: list the drives it would hit, and why others cannot.")
    ] = False,
    name: Annotated[
        str | None, typer.Option("--as", metavar="ID", help="Name for the fault, to list and clear it by.")
    ] = None,
    output: FormatOption = Format.TABLE,
    api: ApiOption = DEFAULT_URL,
    token: TokenOption = None,
    tls_ca: TlsCaOption = None,
) -> None:
    """Inject a fault."""
    options = [word.removeprefix("--") for one in context.command.params for word in one.opts]
    own = _own_options(kind, context.args, options)
    params = _with_files({**own, **dict(map(_parameter, param or []))})
    body: dict[str, Any] = {"kind": kind, "on": on, "params": params}
    wanted = {
        "for": duration,
        "count": count,
        "cycles": cycles,
        "probability": probability,
        "seed": seed,
        "direction": direction,
        "when": when,
        "after_cycles": after_cycles,
        "after": after,
        "share": share,
        "most": most,
        "rate": rate,
        "times": times,
        "ttl": ttl or ("5s" if hold else None),
        "as": name,
    }
    body |= {key: value for key, value in wanted.items() if value is not None}
    if hold and dry_run:
        raise ConfigError("--dry-run injects nothing that --hold could keep: leave one of them out")
    with client.FarmClient(api, token, tls_ca) as farm:
        if dry_run:
            reach = farm.post("faults", body=body, query={"dry_run": "true"})
            print_found(reach, output, _print_reach)
            raise_for_missing(reach)
            return
        fault = farm.post("faults", body=body)
        if output is Format.JSON:
            print_json(fault)
        else:
            print_line(f"{fault['id']}: {fault['kind']} {fault['state']} on {shortened(list(fault['drives']))}")
            if not hold:
                print_next(
                    f"pnfarm fault list {fault['id']} shows its evidence, pnfarm fault clear {fault['id']} ends it"
                )
        if hold:
            _keep(farm, fault, output)
    raise_for_missing(fault)


@app.command("list")
def show(
    fault_id: Annotated[
        str | None,
        typer.Argument(
            metavar="ID",
            help="One fault; also one that has ended recently.",
            show_default=False,
            autocompletion=complete_fault,
        ),
    ] = None,
    output: FormatOption = Format.TABLE,
    api: ApiOption = DEFAULT_URL,
    token: TokenOption = None,
    tls_ca: TlsCaOption = None,
) -> None:
    """List the pending and active faults, or one fault, with their evidence."""
    with client.FarmClient(api, token, tls_ca) as farm:
        found = farm.get("faults") if fault_id is None else {"faults": [farm.get("faults", fault_id)]}
    print_found(found, output, _print_faults)
    raise_for_missing(found if fault_id is None else found["faults"][0])


def _print_faults(found: dict[str, Any]) -> None:
    if not found["faults"]:
        known = " on the shards that answer" if found.get("partial") else ""
        print_line(f"no fault is pending or active{known}")
        return
    columns = ("ID", "KIND", "~STATE", ">CHECKS", ">ACTIVATIONS", "CONFIRMED", "~DRIVES")
    rows = [
        (
            fault["id"],
            fault["kind"],
            _state(fault),
            fault["evidence"]["checks"],
            fault["evidence"]["activations"],
            _confirmation(fault["evidence"]),
            shortened(list(fault["drives"])),
        )
        for fault in found["faults"]
    ]
    print_table(columns, rows)


@app.command("clear")
def clear(
    fault_id: Annotated[
        str | None,
        typer.Argument(
            metavar="ID", help="One fault; default: all.", show_default=False, autocompletion=complete_fault
        ),
    ] = None,
    output: FormatOption = Format.TABLE,
    api: ApiOption = DEFAULT_URL,
    token: TokenOption = None,
    tls_ca: TlsCaOption = None,
) -> None:
    """Clear a fault, or all of them; the drives return to normal."""
    with client.FarmClient(api, token, tls_ca) as farm:
        try:
            found = farm.post("reset") if fault_id is None else farm.delete("faults", fault_id)
        except client.RefusedError as error:
            if fault_id != "all":
                raise
            raise ConfigError(f"{error}; `pnfarm fault clear` without a name clears all") from error
    if output is Format.JSON:
        print_json(found)
    else:
        cleared = found["cleared"] if fault_id is None else [found["id"]]
        none = "no fault was active" + (" on the shards that answer" if found.get("partial") else "")
        print_line(f"cleared {shortened(cleared)}" if cleared else none)
        for fault in found.get("faults", []):
            print_line(f"  {fault['id']}: {fault['kind']} on {shortened(list(fault['drives']))}")
    raise_for_missing(found)


def _state(fault: dict[str, Any]) -> str:
    """The state, of one that waits also for what."""
    waits = {run.get("waits_for") or "" for run in fault["drives"].values()} - {""}
    state: str = fault["state"]
    return f"{state} for {', '.join(sorted(waits))}" if state == "waiting" and waits else state


def _confirmation(evidence: dict[str, Any]) -> str:
    if evidence["confirmed"]:
        return "yes"
    # a farm of an earlier version says yes or no only
    found: str = evidence.get("confirmation", "no")
    return found


def _print_reach(found: dict[str, Any]) -> None:
    rows = [
        *((drive, "yes", "") for drive in found["drives"]),
        *((entry["drive"], "no", entry["why"]) for entry in found["cannot"]),
        *((drive, "no", "left out by share or most") for drive in found["left_out"]),
    ]
    print_table(("DRIVE", "HIT", "~WHY NOT"), rows)
    seed = found["spec"].get("seed")
    again = "" if seed is None else f"; --seed {seed} chooses the same"
    what = f"{found['kind']} would hit {len(found['drives'])} of {len(rows)} drives"
    refused = ", and is refused as long as a drive cannot" if found["cannot"] else ""
    print_line(f"{what}{refused}{again}")


def _keep(farm: client.FarmClient, fault: dict[str, Any], output: Format) -> None:
    """Renew a fault's time to live until it ends or this command is stopped, then clear it, and print how it ended."""
    import signal
    import threading

    from pnfarm.vocabulary.durations import parse_duration

    stop = threading.Event()
    before = {number: signal.signal(number, lambda *_: stop.set()) for number in (signal.SIGINT, signal.SIGTERM)}
    pause = parse_duration(fault["spec"]["ttl"]) / 3e9
    try:
        while fault["state"] != "ended" and not stop.wait(pause):
            fault = farm.get("faults", fault["id"])
            if fault["state"] != "ended":
                fault = farm.post("faults", fault["id"], "renew")
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if fault["state"] != "ended":
            try:
                fault = farm.delete("faults", fault["id"])
            except PnfarmError as exc:
                typer.echo(f"{fault['id']} ends by its time to live: {exc}", err=True)
    print_found(fault, output, lambda one: print_line(f"{one['id']}: {one['state']}"))


def _parameter(text: str) -> tuple[str, Any]:
    key, equals, value = text.partition("=")
    if not equals or not key:
        raise ConfigError(f"--param {text!r} is not a parameter; give NAME=VALUE such as hold=true")
    return key.strip(), _scalar(value.strip())


def _own_options(kind: str, words: list[str], options: list[str]) -> dict[str, Any]:
    """Parameters of a kind that are written as options: ``--slot 3``, ``--slot=3``.

    ``options`` are those of the command.  Raises :class:`ConfigError`.
    """
    from pnfarm.buses.registry import fault_kinds

    found: dict[str, Any] = {}
    rest = iter(words)
    for word in rest:
        head, equals, value = word.partition("=")
        name = head.removeprefix("--")
        if not head.startswith("--") or not name:
            raise ConfigError(f"{word!r} is not an option; see `pnfarm fault add --help`")
        known = fault_kinds()
        if kind in known and name not in known[kind].params:
            names = ", ".join(known[kind].params) or "none"
            hint = did_you_mean(name, [*known[kind].params, *options])
            raise ConfigError(f"no such option: {head}{hint}; the parameters of {kind} are {names}")
        given = value if equals else next(rest, None)
        if given is None:
            raise ConfigError(f"{head} needs a value")
        found[name] = _scalar(given)
    return found


def _with_files(params: dict[str, Any]) -> Any:
    try:
        return with_files(params, Path())
    except Problem as problem:
        raise ConfigError(f"params.values: {problem.what}; allowed: {problem.allowed}") from problem


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
