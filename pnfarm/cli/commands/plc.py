"""``pnfarm plc``: the built-in controller in the foreground."""

from __future__ import annotations

import json
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pnfarm.errors import EnvironmentError_
from pnfarm.farm.process.address_space import ENGINE, require_address_space
from pnfarm.terminal.output import console, make_table, number, print_json, print_line, print_table, seconds
from pnfarm.terminal.settings import Format, settings
from pnfarm.terminal.streams import going_on_unread
from pnfarm.vocabulary.quoting import shortened

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from rich.table import Table

    from pnfarm.controller.runtime import Plc
    from pnfarm.farm.file.reading import FarmConfig

__all__ = ["plc"]

#: Refresh period of the live table.
DRAW_SECONDS = 0.25


@going_on_unread()
def plc(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="[FILE]", help="Farm file, *.pnfarm.yml; or --project or --gsdml instead.", show_default=False
        ),
    ] = None,
    interface: Annotated[
        str | None,
        typer.Option(
            "--interface",
            "-i",
            metavar="IF",
            envvar="PNFARM_PLC_INTERFACE",
            help="Existing network interface for the controller.",
        ),
    ] = None,
    project: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Run the stations of a PLC of this project (CAx data, L5X, SIMATIC AX); needs --interface or --line.",
        ),
    ] = None,
    gsdml: Annotated[
        list[Path] | None,
        typer.Option(
            "--gsdml",
            "--gsd",
            "--eds",
            metavar="PATH",
            help="Run one device described by this GSDML file; needs --device, --ip and --interface.  With --project: "
            "a folder with the makers' files, beside the project's own; repeatable.",
            show_default=False,
        ),
    ] = None,
    plc_name: Annotated[
        str | None, typer.Option("--plc", metavar="NAME", help="With --project: which PLC or IO system, of several.")
    ] = None,
    line: Annotated[
        str | None,
        typer.Option(
            "--line",
            metavar="WAY",
            help="With --project: the way to the PROFIBUS line, a port or pty, HOST:PORT, or rfc2217://HOST:PORT.",
        ),
    ] = None,
    baud: Annotated[
        int | None, typer.Option(metavar="RATE", help="With --line: its bits per second; default: 1500000.")
    ] = None,
    device: Annotated[str | None, typer.Option(metavar="NAME", help="Station name of that device.")] = None,
    ip: Annotated[
        str | None,
        typer.Option(
            "--ip", metavar="ADDRESS/PREFIX", help="IP address of that device; with --project: of the controller."
        ),
    ] = None,
    dap: Annotated[
        str | None, typer.Option(metavar="ID", help="Device access point, where the GSDML file has several.")
    ] = None,
    module: Annotated[list[str] | None, typer.Option(metavar="SLOT=ID", help="Module in a slot.  Repeatable.")] = None,
    cycle: Annotated[
        str | None, typer.Option(help="Cycle time of that device, or of the project's; default: 16ms.")
    ] = None,
    watchdog_factor: Annotated[
        int | None, typer.Option(metavar="N", help="Missed cycles until the connection is dropped; default: 3.")
    ] = None,
    seconds: Annotated[
        float | None, typer.Option(min=0.1, help="Run for this time, then release the drives; default: until Ctrl-C.")
    ] = None,
    json_file: Annotated[
        Path | None,
        typer.Option("--json", metavar="FILE", help="Write a summary to this file at the end.", dir_okay=False),
    ] = None,
    output: Annotated[
        Format | None, typer.Option("--format", help="Print a summary at the end; default: a live table on a terminal.")
    ] = None,
) -> None:
    """Run the built-in controller for the drives and devices of a farm file or a project, until Ctrl-C.

    With --seconds the exit code is 1 if a drive never exchanged data.
    """
    import anyio

    from pnfarm.cli.commands.run import check_writable
    from pnfarm.cli.farm_file import read
    from pnfarm.cli.plc_device import one_device
    from pnfarm.cli.projects.plc import project_plc
    from pnfarm.farm.file.choice import bus_of_controller

    require_address_space(ENGINE)
    if sum(one is not None for one in (file, project, gsdml if project is None else None)) != 1:
        raise typer.BadParameter("give a farm file, --project or --gsdml", param_hint="FILE")
    if json_file is not None:
        check_writable(json_file)
    of_device = device, dap, module
    if file is not None and any((*of_device, ip, cycle, watchdog_factor is not None)):
        raise typer.BadParameter(
            "needs --gsdml; a farm file has these settings itself", param_hint="an option of a device"
        )
    if project is None and any((plc_name, line)):
        raise typer.BadParameter("needs --project", param_hint="--plc, --line")
    with ExitStack() as files:
        if file is not None:
            config = read(file)
        elif project is not None:
            if any(of_device):
                raise typer.BadParameter("needs --gsdml and nothing else", param_hint="--device, --dap, --module")
            if interface is None and line is None:
                raise typer.BadParameter("is required with --project", param_hint="--interface or --line")
            found = files.enter_context(
                project_plc(
                    project, gsdml or (), plc=plc_name, interface=interface, line=line, baud=baud, ip=ip, cycle=cycle,
                    watchdog_factor=watchdog_factor,
                )
            )  # fmt: skip
            config = found.config
            for remark in found.remarks:
                typer.echo(f"{project}: {remark}", err=True)
        else:
            if gsdml is None or len(gsdml) != 1:
                raise typer.BadParameter("names one file", param_hint="--gsdml")
            config = one_device(
                gsdml[0], device=device, ip=ip, interface=interface, dap=dap, modules=module or (), cycle=cycle,
                watchdog_factor=watchdog_factor,
            )  # fmt: skip
        rows, interrupted = anyio.run(_run, config, interface, seconds, output is None and _is_live())
    quiet = [row["name"] for row in rows if not row["connects"]]
    summary = {"ok": not quiet, "controller": config.controller.name if config.controller else "", "drives": rows}
    if several := len(config.controllers) > 1:
        summary["controllers"] = [
            {"bus": bus_of_controller(section).name, "name": section.name} for section in config.controllers
        ]
    if json_file is not None:
        _write(json_file, summary)
    if output is Format.JSON:
        print_json(summary)
    elif output is Format.TABLE:
        columns = _columns(_COLUMNS, several)
        print_table(columns, _cells(rows, columns))
    if seconds is not None and quiet and not interrupted:
        sys.stderr.write(f"pnfarm: {len(quiet)} of {len(rows)} drives never exchanged data: {shortened(quiet)}\n")
        raise typer.Exit(1)


def _is_live() -> bool:
    return sys.stdout.isatty() and not settings.logs_json


def _write(path: Path, summary: dict[str, Any]) -> None:
    try:
        path.write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    except OSError as exc:
        raise EnvironmentError_(f"the summary {path} cannot be written: {(exc.strerror or str(exc)).lower()}") from exc


async def _run(
    config: FarmConfig, interface: str | None, seconds: float | None, live: bool
) -> tuple[list[dict[str, Any]], bool]:
    """The state of the controller's drives before it released them, and whether a signal ended the run."""
    import anyio

    from pnfarm.cli.running import compile_ahead, stop_on_signals
    from pnfarm.controller.runtime import Plc
    from pnfarm.farm.process.garbage import keep_what_is_loaded

    controller = Plc(config, interface=interface)
    rows: list[dict[str, Any]] = []
    opened = False
    async with stop_on_signals() as running:
        try:
            with running:
                controller.check_rights()  # checked before compiling, which may take a minute
                await compile_ahead(in_memory=False)
                await controller.open()
                keep_what_is_loaded()
                opened = True
                if not settings.logs_json and not live:
                    _say_up(controller)
                with anyio.move_on_after(seconds):
                    await _watch(controller, live)
            if opened:
                rows = controller.summary()
                with anyio.CancelScope(shield=True):
                    await controller.release()
        finally:
            with anyio.CancelScope(shield=True):
                await controller.close()
    return rows, running.cancel_called


def _say_up(controller: Plc) -> None:
    from pnfarm.cli.farm_file import counted

    several = len(controller.controllers) > 1
    for one, section in zip(controller.controllers, controller.config.controllers, strict=True):
        count = len(one.snapshot()) if several else len(controller.drives)
        print_line(f"{section.name}: controller of {counted(count, 'drive')} on {one.port.name}")


async def _watch(controller: Plc, live: bool) -> None:
    """Until something fails, with a table on the terminal if there is one."""
    import anyio

    if not live:
        await controller.wait()
        return
    from rich.live import Live

    out = console()

    def table() -> Table:
        # a line for the heads of the columns, one for what is left out, one for the cursor
        return _live_table(controller, max(1, out.height - 3))

    with Live(table(), console=out, auto_refresh=False) as screen:

        async def draw() -> None:
            while True:
                await anyio.sleep(DRAW_SECONDS)
                screen.update(table(), refresh=True)

        async with anyio.create_task_group() as tasks:
            tasks.start_soon(draw)
            await controller.wait()


def _reason(row: dict[str, Any]) -> str:
    """Why a drive does not operate: its program's failure, unusable submodules, or the last lost connection."""
    failure = row["program"]["failure"] if row["program"] else ""
    return failure or "; ".join(row["unusable"]) or row["last_reason"]


#: What each column shows of a drive.
_COLUMNS: Mapping[str, Callable[[dict[str, Any]], object]] = {
    "DRIVE": lambda row: row["name"],
    "BUS": lambda row: row["bus"],
    "CONNECTION": lambda row: row["state"],
    "PROGRAM": lambda row: row["phase"],
    "IP": lambda row: row["ip"],
    ">CYCLE": lambda row: seconds(row["cycle_seconds"]),
    ">CONNECTS": lambda row: row["connects"],
    ">LOSSES": lambda row: row["losses"],
    ">FAULTS": lambda row: row["faults"],
    ">SENT": lambda row: number(row["frames_sent"]),
    ">RECEIVED": lambda row: number(row["frames_received"]),
    "ZSW1": lambda row: f"0x{row['zsw1']:04X}",
    "~LAST REASON": _reason,
}
#: What a terminal of 80 columns has room for.
_LIVE_COLUMNS = ("DRIVE", "BUS", "CONNECTION", "PROGRAM", ">CYCLE", ">LOSSES", ">FAULTS", ">RECEIVED", "~LAST REASON")


def _columns(names: Iterable[str], several: bool) -> list[str]:
    """The bus is shown where there are several controllers."""
    return [name for name in names if several or name != "BUS"]


def _cells(rows: Iterable[dict[str, Any]], columns: Sequence[str]) -> list[list[object]]:
    return [[_COLUMNS[column](row) for column in columns] for row in rows]


def _live_table(controller: Plc, room: int) -> Table:
    """A table of at most ``room`` drives; those that are not running come first."""
    rows = controller.summary()
    hidden = len(rows) - room
    if hidden > 0:
        rows = sorted(rows, key=lambda row: row["state"] == "DATA" and row["phase"] == "running")[:room]
    columns = _columns(_LIVE_COLUMNS, len(controller.controllers) > 1)
    caption = f"... and {hidden} more" if hidden > 0 else ""
    return make_table(columns, _cells(rows, columns), caption=caption)
