"""``pnfarm up`` and ``pnfarm down``: run a farm in the foreground; remove what a killed run left behind."""

from __future__ import annotations

import contextlib
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer  # noqa: TC002 - typer reads the annotations

from pnfarm.errors import ConfigError, EnvironmentError_
from pnfarm.farm.process.address_space import ENGINE, require_address_space
from pnfarm.terminal.output import print_line, print_table
from pnfarm.terminal.settings import FarmFile, ShardOption, setting, settings
from pnfarm.terminal.streams import going_on_unread
from pnfarm.terminal.working import working
from pnfarm.vocabulary.endpoints import host_port

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

#: An option of the capture, with a heading of its own in the help.
_capturing = partial(setting, rich_help_panel="Capture")

#: Parameter of the command -> (key of the farm file, flag, environment).
_SETTINGS: Mapping[str, tuple[str, str, str]] = {
    "api": ("api", "--api", "PNFARM_UP_API"),
    "token": ("api.token", "--api-token", "PNFARM_UP_API_TOKEN"),
    "read_token": ("api.read_token", "--api-read-token", "PNFARM_UP_API_READ_TOKEN"),
    "tokens": ("api.tokens", "--tokens", "PNFARM_UP_TOKENS"),
    "audit": ("api.audit", "--audit", "PNFARM_UP_AUDIT"),
    "tls_cert": ("api.tls_cert", "--tls-cert", "PNFARM_UP_TLS_CERT"),
    "tls_key": ("api.tls_key", "--tls-key", "PNFARM_UP_TLS_KEY"),
    "opcua": ("opcua", "--opcua", "PNFARM_UP_OPCUA"),
    "parent": ("link.parent", "--parent", "PNFARM_UP_LINK_PARENT"),
    "state": ("state", "--state", "PNFARM_UP_STATE"),
    "cpu": ("realtime.cpu", "--realtime-cpu", "PNFARM_UP_REALTIME_CPU"),
    "fifo": ("realtime.fifo", "--realtime-fifo", "PNFARM_UP_REALTIME_FIFO"),
    "mlockall": ("realtime.mlockall", "--realtime-mlockall", "PNFARM_UP_REALTIME_MLOCKALL"),
}


@going_on_unread()
def up(
    context: typer.Context,
    file: FarmFile,
    api: Annotated[
        str | None, setting("--api", "PNFARM_UP_API", "Address of the API; off for no API.", metavar="HOST:PORT")
    ] = None,
    token: Annotated[
        str | None, setting("--api-token", "PNFARM_UP_API_TOKEN", "Bearer token of the API.", metavar="TOKEN")
    ] = None,
    read_token: Annotated[
        str | None,
        setting(
            "--api-read-token",
            "PNFARM_UP_API_READ_TOKEN",
            "Bearer token that may read and change nothing.",
            metavar="TOKEN",
        ),
    ] = None,
    tokens: Annotated[
        Path | None,
        setting("--tokens", "PNFARM_UP_TOKENS", "File of tokens with roles (`pnfarm token`).", metavar="FILE"),
    ] = None,
    audit: Annotated[
        Path | None,
        setting("--audit", "PNFARM_UP_AUDIT", "File of the audit log (`pnfarm audit`).", metavar="FILE"),
    ] = None,
    tls_cert: Annotated[
        Path | None,
        setting("--tls-cert", "PNFARM_UP_TLS_CERT", "Certificate of the API, PEM: serve it by TLS.", metavar="FILE"),
    ] = None,
    tls_key: Annotated[
        Path | None,
        setting(
            "--tls-key",
            "PNFARM_UP_TLS_KEY",
            "The certificate's key, PEM; left out, it is in the certificate's file.",
            metavar="FILE",
        ),
    ] = None,
    opcua: Annotated[
        str | None,
        setting("--opcua", "PNFARM_UP_OPCUA", "Address of an OPC UA server; off for none.", metavar="HOST:PORT"),
    ] = None,
    parent: Annotated[
        str | None,
        setting("--parent", "PNFARM_UP_LINK_PARENT", "Parent interface of the macvlans (link.parent).", metavar="IF"),
    ] = None,
    state: Annotated[
        str | None, setting("--state", "PNFARM_UP_STATE", "Folder for the drives' non-volatile memory.", metavar="DIR")
    ] = None,
    cpu: Annotated[
        int | None, setting("--realtime-cpu", "PNFARM_UP_REALTIME_CPU", "CPU to run the engine on.", metavar="N")
    ] = None,
    fifo: Annotated[
        int | None,
        setting(
            "--realtime-fifo",
            "PNFARM_UP_REALTIME_FIFO",
            "SCHED_FIFO priority of the engine, 1 to 99; 0: the ordinary scheduler.",
            metavar="PRIORITY",
        ),
    ] = None,
    mlockall: Annotated[
        bool | None,
        setting(
            "--realtime-mlockall/--no-realtime-mlockall",
            "PNFARM_UP_REALTIME_MLOCKALL",
            "Lock all memory in RAM.",
            show_default=False,
        ),
    ] = None,
    shard: Annotated[
        str | None,
        setting("--shard", "PNFARM_UP_SHARD", "Run only part I of N of the drives, I from 1.", metavar="I/N"),
    ] = None,
    restore: Annotated[
        str | None,
        setting("--restore", "PNFARM_UP_RESTORE", "Begin in this saved state (`pnfarm state save`).", metavar="NAME"),
    ] = None,
    pcap: Annotated[
        Path | None,
        _capturing("--pcap", "PNFARM_UP_PCAP", "Capture the frames of the drives to this pcapng file.", metavar="OUT"),
    ] = None,
    pcap_drives: Annotated[
        list[str] | None,
        _capturing(
            "--pcap-drives",
            "PNFARM_UP_PCAP_DRIVES",
            "Capture only these drives.  Repeatable.",
            metavar="GLOB",
            show_default=False,
        ),
    ] = None,
    pcap_only: Annotated[
        list[str] | None,
        _capturing(
            "--pcap-only",
            "PNFARM_UP_PCAP_ONLY",
            "Capture only this kind of frame: cyclic, acyclic, dcp, rpc, alarm, lldp, ptcp, snmp, arp, icmp, "
            "other.  Repeatable.",
            metavar="KIND",
            show_default=False,
        ),
    ] = None,
    pcap_size: Annotated[
        str | None,
        _capturing(
            "--pcap-size",
            "PNFARM_UP_PCAP_SIZE",
            "Start a new file OUT_00001_DATE at this size, such as 100MB.",
            metavar="SIZE",
        ),
    ] = None,
    pcap_files: Annotated[
        int | None,
        _capturing("--pcap-files", "PNFARM_UP_PCAP_FILES", "Keep only the newest N files.", metavar="N", min=1),
    ] = None,
) -> None:
    """Run a farm in the foreground until Ctrl-C; its interfaces are always removed at the end.

    Options override environment variables, and these override the farm file: PNFARM_UP_API, PNFARM_UP_API_TOKEN,
    PNFARM_UP_API_READ_TOKEN, PNFARM_UP_TOKENS, PNFARM_UP_AUDIT, PNFARM_UP_TLS_CERT, PNFARM_UP_TLS_KEY,
    PNFARM_UP_OPCUA, PNFARM_UP_LINK_PARENT, PNFARM_UP_STATE, PNFARM_UP_REALTIME_CPU, PNFARM_UP_REALTIME_FIFO and
    PNFARM_UP_REALTIME_MLOCKALL; PNFARM_UP_SHARD is --shard, PNFARM_UP_RESTORE --restore.  For the capture options:
    PNFARM_UP_PCAP, PNFARM_UP_PCAP_DRIVES, PNFARM_UP_PCAP_ONLY, PNFARM_UP_PCAP_SIZE and PNFARM_UP_PCAP_FILES; separate
    several values with spaces.
    """
    import anyio

    from pnfarm.cli.farm_file import check_impairments, read, shard_option
    from pnfarm.links.serial.eager_loop import LOOKING

    # they are read from the context
    del api, token, read_token, tokens, audit, tls_cert, tls_key, opcua, parent, state, cpu, fifo, mlockall
    require_address_space(ENGINE)
    config = _overridden(context, read(file), context.params)
    check_impairments(config)
    capture = capture_settings(pcap, pcap_drives, pcap_only, pcap_size, pcap_files)
    anyio.run(_run, config, shard_option(context, shard), capture, restore, backend_options=LOOKING)


def capture_settings(
    path: Path | None, drives: list[str] | None, only: list[str] | None, size: str | None, files: int | None
) -> CaptureSettings | None:
    """The settings of the capture options, None without a capture; raises :class:`~pnfarm.errors.ConfigError`."""
    from pnfarm.farm.capture import CaptureSettings, parse_size

    if path is None:
        if drives or only or size is not None or files is not None:
            raise ConfigError("name the capture's file: --pcap OUT.pcapng")
        return None
    octets = None if size is None else parse_size(size)
    return CaptureSettings(path, tuple(drives or ()), tuple(only or ()), octets, files)


def _overridden(context: typer.Context, config: FarmConfig, given: Mapping[str, Any]) -> FarmConfig:
    """The file's settings, overridden by environment and flags; an error names the source of the wrong value."""
    from pnfarm.vocabulary.regular_file import beside

    for name, (key, flag, variable) in _SETTINGS.items():
        if (value := given.get(name)) is None:
            continue
        source = context.get_parameter_source(name)
        origin = variable if source is not None and source.name == "ENVIRONMENT" else flag
        if name == "api" and config.api is not None and value != "off":
            # the address changes, tokens and certificate stay
            config = config.with_overrides({"api": {"listen": value, **_secret(config)}}, origin)
        elif name == "opcua" and config.opcua is not None and config.opcua.model_fields_set - {"listen"}:
            # the same: users and certificate stay
            config = config.with_overrides({"opcua" if value == "off" else "opcua.listen": value}, origin)
        elif key.startswith("api."):
            if config.api is None:
                continue  # no API, no token
            listen = host_port(config.api.host, config.api.port)
            # a file of the command line is in the folder where it is given, one of the farm file beside that
            given_here = str(value.absolute()) if isinstance(value, Path) else value
            config = config.with_overrides({"api": {"listen": listen, **_secret(config), name: given_here}}, origin)
        elif name == "state" and value and "://" not in value:
            # as those files
            config = config.with_overrides({key: str(beside(Path.cwd(), value))}, origin)
        else:
            config = config.with_overrides({key: value}, origin)
    return config


def _secret(config: FarmConfig) -> dict[str, str]:
    """The file's keys of the API beside its address."""
    keys = ("token", "token_file", "read_token", "tokens", "audit", "tls_cert", "tls_key")
    return {key: value for key in keys if (value := getattr(config.api, key, None)) is not None}


def _check_restore(farm: Farm, name: str) -> None:
    """Whether the farm, which has not begun yet, can be put into this state; raises :class:`PnfarmError`."""
    farm.states.restore_at_once(name, only_check=True)


async def _run(config: FarmConfig, shard: Shard | None, capture: CaptureSettings | None, restore: str | None) -> None:
    import anyio

    from pnfarm.api import api_url, audit_of, serve_farm, tls_of
    from pnfarm.api.access.token import token_of
    from pnfarm.api.server import listen
    from pnfarm.cli.running import compile_ahead, stop_on_signals
    from pnfarm.config.links import MemoryLink
    from pnfarm.controller.beside import ControllerBeside
    from pnfarm.farm.capture import prepare
    from pnfarm.farm.farm import Farm
    from pnfarm.farm.process.garbage import keep_what_is_loaded
    from pnfarm.opcua import prepare_opcua, serve_opcua
    from pnfarm.station.event_log import EventLog

    token_of(config)  # report a capture file that cannot be created before any interface is made
    secure = tls_of(config) is not None
    if (audit := audit_of(config)) is not None:
        # the farm opens it again when it serves
        audit.release()
    farm = Farm(config, shard=shard, capture=capture)
    ControllerBeside(farm, log=EventLog())
    if (section := config.api) is not None:
        # report a port in use before the drives send anything: another farm may have the same drives on the wire
        farm.on_start.append(lambda _: listen(section.host, section.port).close())
    if restore is not None:
        # likewise a state that is not there, or is another farm's
        farm.on_start.append(lambda _: _check_restore(farm, restore))
    async with stop_on_signals() as running:
        try:
            with running:
                farm.check_rights()  # checked before compiling, which may take a minute
                await compile_ahead(in_memory=isinstance(config.link, MemoryLink))
                opcua = await prepare_opcua(farm)
                if capture is not None:
                    prepare()
                with _starting(len(farm.drives) + len(farm.devices)):
                    await farm.open()
                    if restore is not None:
                        await farm.states.restore(restore)
                async with anyio.create_task_group() as tasks:
                    host, port = await tasks.start(serve_farm, farm)
                    await tasks.start(serve_opcua, farm, opcua)
                    keep_what_is_loaded()
                    _say_up(farm, f"{api_url(host, port, secure=secure)}/" if host else None)
                    await farm.wait()
        finally:
            with anyio.CancelScope(shield=True):
                await farm.close()


@contextlib.contextmanager
def _starting(drives: int) -> Iterator[None]:
    """Say that many drives take a while."""
    if drives < MANY_DRIVES:
        yield
        return
    with working(f"starting {drives} drives"):
        yield


def _say_up(farm: Farm, url: str | None) -> None:
    """Print one line for a user or a script; with JSON logs the log has the same as events."""
    from pnfarm.cli.farm_file import counted, link_text

    if settings.logs_json:
        return
    where = f"API {url}" if url else "no API"
    if url and farm.config.token_path is not None:
        where += f", its token in {farm.config.token_path}"
    part = "" if farm.shard is None else f", shard {farm.shard}"
    counts = [counted(len(each), word) for each, word in ((farm.drives, "drive"), (farm.devices, "device")) if each]
    print_line(f"{farm.config.farm}{part}: {' and '.join(counts)} on {link_text(farm.config)}, {where}")
    if not sys.stdout.isatty():
        return
    rows = [(drive.name, drive.model, *drive.addresses()) for drive in farm.drives[:MAX_ROWS]]
    if rows:
        print_table(("DRIVE", "MODEL", "MAC", "IP"), rows)
    if len(farm.drives) > MAX_ROWS:
        print_line(f"... and {len(farm.drives) - MAX_ROWS} more; `pnfarm inspect` shows all")
    others = [(device.name, device.kinds[-1], *device.addresses()) for device in farm.devices[:MAX_ROWS]]
    if others:
        print_table(("DEVICE", "KIND", "MAC", "IP"), others)
    if len(farm.devices) > MAX_ROWS:
        print_line(f"... and {len(farm.devices) - MAX_ROWS} more")
    print_line("Ctrl-C stops it.")


def down(context: typer.Context, file: FarmFile, shard: ShardOption = None) -> None:
    """Remove the interfaces that a killed run of this farm, of its shards or its controller left behind."""
    from pnfarm.cli.farm_file import read, shard_option
    from pnfarm.farm.farm import remove_farm

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
