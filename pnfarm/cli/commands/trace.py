"""``pnfarm trace``: the oscilloscope of a running farm."""

from __future__ import annotations

import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pnfarm.errors import ConfigError, PnfarmError, RemoteError
from pnfarm.terminal import client
from pnfarm.terminal.output import print_found, print_json, print_line, print_table
from pnfarm.terminal.settings import DEFAULT_URL, ApiOption, Format, FormatOption, TlsCaOption, TokenOption

if TYPE_CHECKING:
    from pnfarm.trace import Recording

__all__ = ["trace"]

#: Time between two questions whether the trace is complete.
ASK_SECONDS = 0.1
#: How long the farm keeps a trace whose command has died.
KEEP = "30s"
#: Width of the plot where standard output is not a terminal.
PLAIN_WIDTH = 100
_FORMS = (".csv", ".json", ".svg", ".html")


def trace(
    drives: Annotated[
        list[str],
        typer.Argument(
            metavar="DRIVES",
            help="Drives, devices, models of the plant: names or globs, model:NAME, or all.",
            show_default=False,
        ),
    ],
    signals: Annotated[
        list[str] | None,
        typer.Option(
            "--signals",
            "-s",
            metavar="A,B",
            help="Signals or globs, such as velocity,zsw1.*,island-1.part_present; repeatable.  See --list.",
        ),
    ] = None,
    trigger: Annotated[
        str,
        typer.Option(
            help="When time 0 is: now, manual, `velocity > 1000`, `velocity rising 1000`, zsw1.fault_present, "
            "`island-1.pressure > 6.5 bar`, "
            "`state changes`, fault, `fault 702`, connect, disconnect, watchdog, power-off, `injection KIND`; "
            "each also with `on DRIVE`."
        ),
    ] = "now",
    pre: Annotated[str, typer.Option(metavar="TIME", help="How long to record before the trigger.")] = "0s",
    length: Annotated[str, typer.Option(metavar="TIME", help="How long to record from the trigger on.")] = "1s",
    every: Annotated[
        int | None, typer.Option(metavar="N", help="A sample every N engine steps (milliseconds); default: every step.")
    ] = None,
    interval: Annotated[
        str | None, typer.Option(metavar="TIME", help="Instead of --every: time between samples, such as 250us.")
    ] = None,
    within: Annotated[
        str | None, typer.Option(metavar="TIME", help="Give up, with exit code 1, if it is not complete by then.")
    ] = None,
    files: Annotated[
        list[Path] | None,
        typer.Option("--output", "-o", metavar="FILE", help="Write to FILE: .csv, .json, .svg or .html.  Repeatable."),
    ] = None,
    listed: Annotated[
        bool, typer.Option("--list", help="List the signals of the drives and devices with their units.")
    ] = False,
    output: FormatOption = Format.TABLE,
    api: ApiOption = DEFAULT_URL,
    token: TokenOption = None,
    tls_ca: TlsCaOption = None,
) -> None:
    """Record signals of drives, devices and models of the running farm's plant, cycle by cycle, around a trigger."""
    for file in files or []:
        _check_file(file)
    most = _seconds(within)
    with client.FarmClient(api, token, tls_ca) as farm:
        if listed:
            _list(farm, drives, output)
            return
        if not signals:
            raise ConfigError("--signals is missing; `pnfarm trace DRIVES --list` lists what the drives have")
        body: dict[str, Any] = {
            "on": drives,
            "signals": [name for text in signals for name in text.split(",")],
            "trigger": trigger,
            "pre": pre,
            "length": length,
            "keep": KEEP,
        }
        body |= {key: value for key, value in (("every", every), ("interval", interval)) if value is not None}
        recording = _recorded(farm, body, most)
    for file in files or []:
        _write(file, recording)
    if output is Format.JSON:
        print_json(recording.as_dict())
        return
    from pnfarm.trace.plot import as_text

    print_line(as_text(recording, _width()))
    by = f" ({recording.triggered_by})" if recording.triggered_by else ""
    print_line(f"{len(recording.time)} samples, trigger {recording.trigger}{by}, {recording.missed} missed")
    for file in files or []:
        print_line(f"written to {file}")


def _seconds(text: str | None) -> float | None:
    from pnfarm.vocabulary.durations import read_duration
    from pnfarm.vocabulary.problem import Problem

    try:
        return None if text is None else read_duration(text) / 1e9
    except Problem as problem:
        raise ConfigError(f"--within {problem}") from problem


def _recorded(farm: client.FarmClient, body: dict[str, Any], most: float | None) -> Recording:
    """Start the trace, wait for its end, read it; it is deleted whatever happens."""
    from pnfarm.trace.recording import Recording

    started = farm.post("traces", body=body)
    trace_id = str(started["id"])
    begin = time.monotonic()
    told = False
    try:
        while (status := farm.get("traces", trace_id, query={"format": "status"}))["state"] != "complete":
            if most is not None and time.monotonic() - begin > most:
                what = "was not triggered" if not status["triggered"] else "is not complete"
                raise RemoteError(f"the trace {what} within {most:g} s (trigger: {body['trigger']})")
            if not told and status["state"] == "waiting" and time.monotonic() - begin > 1.0:
                told = True
                sys.stderr.write(f"waiting for the trigger: {body['trigger']}\n")
            time.sleep(ASK_SECONDS)
        return Recording.from_dict(farm.get("traces", trace_id))
    finally:
        # a farm that is gone by now costs neither the recording nor the first error
        with suppress(PnfarmError):
            farm.delete("traces", trace_id)


def _list(farm: client.FarmClient, drives: list[str], output: Format) -> None:
    from pnfarm.vocabulary.globs import means

    known = {one["name"]: (one["model"],) for one in farm.get("drives")["drives"]}
    known |= {one["name"]: tuple(one["models"]) for one in farm.get("devices")["devices"]}
    known |= {one["name"]: (one["kind"],) for one in farm.get("plant")["models"]}
    names = [name for name, models in known.items() if any(means(glob, (name,), models) for glob in drives)]
    if not names:
        raise ConfigError(f"no drive matches {' '.join(drives)}; there are {', '.join(known)}")
    found = [farm.get("traces", "signals", name) for name in names]
    print_found({"drives": found}, output, _print_signals)


def _print_signals(found: dict[str, Any]) -> None:
    rows = [(one["drive"], s["signal"], s["unit"], s["doc"]) for one in found["drives"] for s in one["signals"]]
    print_table(("DRIVE", "SIGNAL", "UNIT", "~WHAT IT IS"), rows)


def _check_file(file: Path) -> None:
    """Before anything is recorded, so that no recording is lost to a misspelt name."""
    if file.suffix.lower() not in _FORMS:
        raise ConfigError(f"-o {file}: the end of the name selects the format; allowed: {', '.join(_FORMS)}")
    if not file.absolute().parent.is_dir():
        raise ConfigError(f"-o {file}: there is no folder {file.parent}")


def _write(file: Path, recording: Recording) -> None:
    import json

    from pnfarm.trace.plot import as_html, as_svg

    match file.suffix.lower():
        case ".csv":
            text = recording.csv()
        case ".json":
            text = json.dumps(recording.as_dict(), indent=1) + "\n"
        case ".svg":
            text = as_svg(recording)
        case _:
            text = as_html(recording)
    try:
        file.write_text(text, encoding="utf-8")
    except OSError as exc:
        raise ConfigError(f"-o {file} cannot be written: {(exc.strerror or str(exc)).lower()}") from exc


def _width() -> int:
    import shutil

    return shutil.get_terminal_size().columns if sys.stdout.isatty() else PLAIN_WIDTH
