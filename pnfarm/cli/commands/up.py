"""``pnfarm up`` and ``pnfarm down``: run a farm in the foreground; remove what a killed run left behind."""

from __future__ import annotations

import contextlib
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pnfarm.farm.process.address_space import ENGINE, require_address_space
from pnfarm.terminal.settings import FarmFile, ShardOption, settings

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from pnfarm.farm.capture import CaptureSettings
    from pnfarm.farm.farm import Farm
    from pnfarm.farm.file.reading import FarmConfig
    from pnfarm.farm.shard import Shard

__all__ = ["down", "up"]

#: From so many drives on, the start is announced.
MANY_DRIVES = 100
#: Rows of the table of drives printed at the start; `pnfarm inspect` shows all.
MAX_ROWS = 16

#: Heading of the capture options in the help.
_PANEL = "Capture"

#: Parameter of the command -> (key of the farm file, flag, environment).
_SETTINGS: Mapping[str, tuple[str, str, str]] = {
    "api": ("api", "--api", "PNFARM_UP_API"),
    "token": ("api.token", "--api-token", "PNFARM_UP_API_TOKEN"),
    "read_token": ("api.read_token", "--api-read-token", "PNFARM_UP_API_READ_TOKEN"),
    "parent": ("link.parent", "--parent", "PNFARM_UP_LINK_PARENT"),
    "state": ("state", "--state", "PNFARM_UP_STATE"),
    "cpu": ("realtime.cpu", "--realtime-cpu", "PNFARM_UP_REALTIME_CPU"),
    "fifo": ("realtime.fifo", "--realtime-fifo", "PNFARM_UP_REALTIME_FIFO"),
    "mlockall": ("realtime.mlockall", "--realtime-mlockall", "PNFARM_UP_REALTIME_MLOCKALL"),
}


def up(
    context: typer.Context,
    file: FarmFile,
    api: Annotated[
        str | None,
        typer.Option(
            "--api",
            metavar="HOST:PORT",
            envvar="PNFARM_UP_API",
            show_envvar=False,
            help="Address of the API; off for no API.",
        ),
    ] = None,
    token: Annotated[
        str | None,
        typer.Option(
            "--api-token",
            metavar="TOKEN",
            envvar="PNFARM_UP_API_TOKEN",
            show_envvar=False,
            help="Bearer token of the API.",
        ),
    ] = None,
    read_token: Annotated[
        str | None,
        typer.Option(
            "--api-read-token",
            metavar="TOKEN",
            envvar="PNFARM_UP_API_READ_TOKEN",
            show_envvar=False,
            help="Bearer token that may read and change nothing.",
        ),
    ] = None,
    parent: Annotated[
        str | None,
        typer.Option(
            "--parent",
            metavar="IF",
            envvar="PNFARM_UP_LINK_PARENT",
            show_envvar=False,
            help="Parent interface of the macvlans (link.parent).",
        ),
    ] = None,
    state: Annotated[
        str | None,
        typer.Option(
            "--state",
            metavar="DIR",
            envvar="PNFARM_UP_STATE",
            show_envvar=False,
            help="Folder for the drives' non-volatile memory.",
        ),
    ] = None,
    cpu: Annotated[
        int | None,
        typer.Option(
            "--realtime-cpu",
            metavar="N",
            envvar="PNFARM_UP_REALTIME_CPU",
            show_envvar=False,
            help="CPU to run the engine on.",
        ),
    ] = None,
    fifo: Annotated[
        int | None,
        typer.Option(
            "--realtime-fifo",
            metavar="PRIORITY",
            envvar="PNFARM_UP_REALTIME_FIFO",
            show_envvar=False,
            help="SCHED_FIFO priority of the engine, 1 to 99.",
        ),
    ] = None,
    mlockall: Annotated[
        bool | None,
        typer.Option(
            "--realtime-mlockall/--no-realtime-mlockall",
            envvar="PNFARM_UP_REALTIME_MLOCKALL",
            show_envvar=False,
            help="Lock all memory in RAM.",
            show_default=False,
        ),
    ] = None,
    shard: Annotated[
        str | None,
        typer.Option(
            "--shard",
            metavar="I/N",
            envvar="PNFARM_UP_SHARD",
            show_envvar=False,
            help="Run only part I of N of the drives, I from 1.",
        ),
    ] = None,
    pcap: Annotated[
        Path | None,
        typer.Option(
            "--pcap",
            metavar="OUT",
            envvar="PNFARM_UP_PCAP",
            show_envvar=False,
            help="Capture the frames of the drives to this pcapng file.",
            rich_help_panel=_PANEL,
        ),
    ] = None,
    pcap_drives: Annotated[
        list[str] | None,
        typer.Option(
            "--pcap-drives",
            metavar="GLOB",
            envvar="PNFARM_UP_PCAP_DRIVES",
            show_envvar=False,
            help="Capture only these drives.  Repeatable.",
            rich_help_panel=_PANEL,
            show_default=False,
        ),
    ] = None,
    pcap_only: Annotated[
        list[str] | None,
        typer.Option(
            "--pcap-only",
            metavar="KIND",
            envvar="PNFARM_UP_PCAP_ONLY",
            show_envvar=False,
            help="Capture only this kind of frame: cyclic, acyclic, dcp, rpc, alarm, lldp, ptcp, snmp, arp, icmp, "
            "other.  Repeatable.",
            rich_help_panel=_PANEL,
            show_default=False,
        ),
    ] = None,
    pcap_size: Annotated[
        str | None,
        typer.Option(
            "--pcap-size",
            metavar="SIZE",
            envvar="PNFARM_UP_PCAP_SIZE",
            show_envvar=False,
            help="Start a new file OUT_00001_DATE at this size, such as 100MB.",
            rich_help_panel=_PANEL,
        ),
    ] = None,
    pcap_files: Annotated[
        int | None,
        typer.Option(
            "--pcap-files",
            metavar="N",
            min=1,
            envvar="PNFARM_UP_PCAP_FILES",
            show_envvar=False,
            help="Keep only the newest N files.",
            rich_help_panel=_PANEL,
        ),
    ] = None,
) -> None:
    """Run a farm in the foreground until Ctrl-C; its interfaces are always removed at the end.

    Options override environment variables, and these override the farm file: PNFARM_UP_API, PNFARM_UP_API_TOKEN,
    PNFARM_UP_LINK_PARENT, PNFARM_UP_STATE, PNFARM_UP_REALTIME_CPU, PNFARM_UP_REALTIME_FIFO and
    PNFARM_UP_REALTIME_MLOCKALL; PNFARM_UP_SHARD is --shard.  For the capture options: PNFARM_UP_PCAP,
    PNFARM_UP_PCAP_DRIVES, PNFARM_UP_PCAP_ONLY, PNFARM_UP_PCAP_SIZE and PNFARM_UP_PCAP_FILES; separate several values
    with spaces.
    """
    import anyio

    from pnfarm.cli.farm_file import check_impairments, read, shard_option
    from pnfarm.links.serial.eager_loop import LOOKING

    require_address_space(ENGINE)
    given = {
        "api": api,
        "token": token,
        "read_token": read_token,
        "parent": parent,
        "state": state,
        "cpu": cpu,
        "fifo": fifo,
        "mlockall": mlockall,
    }
    config = _overridden(context, read(file), given)
    check_impairments(config)
    capture = capture_settings(pcap, pcap_drives, pcap_only, pcap_size, pcap_files)
    anyio.run(_run, config, shard_option(context, shard), capture, backend_options=LOOKING)


def capture_settings(
    path: Path | None,
    drives: list[str] | None,
    only: list[str] | None,
    size: str | None,
    files: int | None,
) -> CaptureSettings | None:
    """The settings of the capture options, None without a capture; raises :class:`~pnfarm.errors.ConfigError`."""
    from pnfarm.errors import ConfigError
    from pnfarm.farm.capture import CaptureSettings, parse_size

    if path is None:
        if drives or only or size is not None or files is not None:
            raise ConfigError("name the capture's file: --pcap OUT.pcapng")
        return None
    octets = None if size is None else parse_size(size)
    return CaptureSettings(path, tuple(drives or ()), tuple(only or ()), octets, files)


def _overridden(context: typer.Context, config: FarmConfig, given: Mapping[str, Any]) -> FarmConfig:
    """The file's settings, overridden by environment and flags; an error names the source of the wrong value."""
    for name, value in given.items():
        if value is None:
            continue
        key, flag, variable = _SETTINGS[name]
        source = context.get_parameter_source(name)
        origin = variable if source is not None and source.name == "ENVIRONMENT" else flag
        if name == "api" and config.api is not None and value != "off":
            # the address changes, the token stays
            config = config.with_overrides({"api": {"listen": value, **_secret(config)}}, origin)
        elif name in {"token", "read_token"}:
            listen = "" if config.api is None else f"{_bracketed(config.api.host)}:{config.api.port}"
            if not listen:
                continue  # no API, no token
            config = config.with_overrides({"api": {"listen": listen, **_secret(config), name: value}}, origin)
        else:
            config = config.with_overrides({key: value}, origin)
    return config


def _secret(config: FarmConfig) -> dict[str, str]:
    """The file's keys of the API's tokens."""
    section = config.api
    given = (
        {}
        if section is None
        else {"token": section.token, "token_file": section.token_file, "read_token": section.read_token}
    )
    return {key: value for key, value in given.items() if value is not None}


def _bracketed(host: str) -> str:
    return f"[{host}]" if ":" in host else host


async def _run(config: FarmConfig, shard: Shard | None, capture: CaptureSettings | None) -> None:
    import anyio

    from pnfarm.api import serve_farm
    from pnfarm.api.access.token import token_of
    from pnfarm.api.server import listen
    from pnfarm.cli.running import compile_ahead, stop_on_signals
    from pnfarm.config.links import MemoryLink
    from pnfarm.controller.beside import ControllerBeside
    from pnfarm.farm.capture import prepare
    from pnfarm.farm.farm import Farm
    from pnfarm.farm.process.garbage import keep_what_is_loaded
    from pnfarm.station.event_log import EventLog

    token_of(config)  # report a capture file that cannot be created before any interface is made
    farm = Farm(config, shard=shard, capture=capture)
    ControllerBeside(farm, log=EventLog())
    if (section := config.api) is not None:
        # report a port in use before the drives send anything: another farm may have the same drives on the wire
        farm.on_start.append(lambda _: listen(section.host, section.port).close())
    async with stop_on_signals() as running:
        try:
            with running:
                farm.check_rights()  # checked before compiling, which may take a minute
                await compile_ahead(in_memory=isinstance(config.link, MemoryLink))
                if capture is not None:
                    prepare()
                with _starting(len(farm.drives)):
                    await farm.open()
                async with anyio.create_task_group() as tasks:
                    host, port = await tasks.start(serve_farm, farm)
                    keep_what_is_loaded()
                    _say_up(farm, f"http://{_bracketed(host)}:{port}/" if host else None)
                    await farm.wait()
        finally:
            with anyio.CancelScope(shield=True):
                await farm.close()


@contextlib.contextmanager
def _starting(drives: int) -> Iterator[None]:
    """Say that many drives take a while."""
    from pnfarm.terminal.working import working

    if drives < MANY_DRIVES:
        yield
        return
    with working(f"starting {drives} drives"):
        yield


def _say_up(farm: Farm, url: str | None) -> None:
    """Print one line for a user or a script; with JSON logs the log has the same as events."""
    from pnfarm.cli.farm_file import counted, link_text
    from pnfarm.terminal.output import print_line, print_table

    if settings.logs_json:
        return
    where = f"API {url}" if url else "no API"
    if url and farm.config.token_path is not None:
        where += f", its token in {farm.config.token_path}"
    part = "" if farm.shard is None else f", shard {farm.shard}"
    print_line(f"{farm.config.farm}{part}: {counted(len(farm.drives), 'drive')} on {link_text(farm.config)}, {where}")
    if not sys.stdout.isatty():
        return
    rows = [(drive.name, drive.model, *drive.addresses()) for drive in farm.drives[:MAX_ROWS]]
    print_table(("DRIVE", "MODEL", "MAC", "IP"), rows)
    if len(farm.drives) > MAX_ROWS:
        print_line(f"... and {len(farm.drives) - MAX_ROWS} more; `pnfarm inspect` shows all")
    print_line("Ctrl-C stops it.")


def down(context: typer.Context, file: FarmFile, shard: ShardOption = None) -> None:
    """Remove the interfaces that a killed run of this farm, of its shards or its controller left behind."""
    from pnfarm.cli.farm_file import read, shard_option
    from pnfarm.farm.farm import remove_farm
    from pnfarm.terminal.output import print_line

    config = read(file)
    part = shard_option(context, shard)
    removed = remove_farm(config, part)
    if part is None:
        removed += _remove_controller(config)
    for name in removed:
        print_line(f"removed {name}")
    if not removed:
        print_line(f"nothing left to remove of farm {config.farm or 'farm'}")


def _remove_controller(config: FarmConfig) -> list[str]:
    """What a killed `pnfarm plc` left behind; the interfaces of a running one are kept."""
    from pnfarm.errors import EnvironmentError_
    from pnfarm.links.kernel.interfaces import remove_leftovers_now
    from pnfarm.links.kernel.ownership import FarmLock

    removed: list[str] = []
    for section in config.controllers:
        # the name under which the controller owns its interfaces
        owner = f"{config.farm or 'farm'} {section.name}"
        lock = FarmLock(owner)
        try:
            lock.acquire()
        except EnvironmentError_:
            continue
        with lock:
            removed += remove_leftovers_now(owner)
    return removed
