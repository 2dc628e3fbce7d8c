"""The program ``pnfarm``: its commands, its global options, its exit codes.

A command's module imports at the top only what its help needs, and the building blocks of commands, which import next
to nothing; the rest is imported when the command runs, so that ``pnfarm --help`` is fast, and ``demo`` and ``bench``
can enter a namespace before any thread exists.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Annotated

import typer

from pnfarm.buses import registry
from pnfarm.cli.access import audit, tls, token
from pnfarm.cli.commands import (
    bench,
    decode,
    demo,
    doctor,
    fault,
    hub,
    importing,
    inspect,
    io,
    models,
    param,
    plant,
    plc,
    scan,
    state,
    trace,
    up,
    validate,
    verify,
)
from pnfarm.cli.commands import run as scenario
from pnfarm.cli.errors import report
from pnfarm.farm.process.address_space import COMMAND, few_threads, require_address_space
from pnfarm.farm.process.garbage import search_seldom
from pnfarm.farm.process.heap import keep_heap_small
from pnfarm.terminal.command import Command, Panel, arranged
from pnfarm.terminal.settings import LogFormat, LogLevel, Settings, help_without_command, settings
from pnfarm.terminal.streams import prepare_streams, silence
from pnfarm.version import __version__

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["main", "make_app", "run"]

#: The commands that are independent of the bus, in the order of the help; each bus adds its own.
COMMANDS = (
    Command("demo", Panel.START, demo.command),
    Command("up", Panel.FARM, up.up),
    Command("down", Panel.FARM, up.down),
    Command("hub", Panel.FARM, hub.hub),
    Command("audit", Panel.FARM, audit.app),
    Command("token", Panel.FARM, token.app),
    Command("tls", Panel.FARM, tls.app),
    Command("import", Panel.FARM, importing.importing),
    Command("validate", Panel.FARM, validate.validate),
    Command("plant", Panel.FARM, plant.plant),
    Command("run", Panel.FARM, scenario.run),
    Command("inspect", Panel.RUNNING, inspect.inspect),
    Command("io", Panel.RUNNING, io.io),
    Command("trace", Panel.RUNNING, trace.trace),
    Command("state", Panel.RUNNING, state.app),
    Command("fault", Panel.RUNNING, fault.app),
    Command("param", Panel.RUNNING, param.app),
    Command("plc", Panel.CONTROLLER, plc.plc),
    Command("scan", Panel.CONTROLLER, scan.scan, behind="plc"),
    Command("decode", Panel.REFERENCE, decode.decode),
    Command("models", Panel.REFERENCE, models.models),
    Command("schema", Panel.REFERENCE, validate.schema),
    Command("doctor", Panel.MACHINE, doctor.doctor),
    Command("verify", Panel.MACHINE, verify.verify),
    Command("bench", Panel.MACHINE, bench.command),
)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"pnfarm {__version__}")
        raise typer.Exit


def _options(
    context: typer.Context,
    log_format: Annotated[
        LogFormat | None,
        typer.Option(
            help="Format of log lines; default: console on a terminal, otherwise json.", envvar="PNFARM_LOG_FORMAT"
        ),
    ] = None,
    log_level: Annotated[
        LogLevel, typer.Option(help="Lowest level that is logged.", envvar="PNFARM_LOG_LEVEL")
    ] = LogLevel.INFO,
    debug: Annotated[
        bool, typer.Option("--debug", help="Show a traceback with each error.", envvar="PNFARM_DEBUG")
    ] = False,
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", is_eager=True, callback=_version)
    ] = False,
) -> None:
    """Run virtual servo drives that a real PLC controls, and break them on purpose."""
    del version
    settings.log_format, settings.log_level, settings.debug = log_format, log_level, debug
    help_without_command(context)
    require_address_space(COMMAND)
    from pnfarm.cli.log.setup import configure

    configure(as_json=settings.logs_json, level=log_level.value)


def make_app() -> typer.Typer:
    """The program with the commands of all buses."""
    app = typer.Typer(
        name="pnfarm",
        rich_markup_mode="rich",
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback(invoke_without_command=True)(_options)
    for command in arranged(COMMANDS, registry.commands()):
        if isinstance(command.run, typer.Typer):
            app.add_typer(command.run, name=command.name, rich_help_panel=command.panel.value)
        else:
            app.command(command.name, rich_help_panel=command.panel.value)(command.run)
    return app


#: Global options that are also accepted after the command -> whether a value follows.
_ANYWHERE = {"--log-format": True, "--log-level": True, "--debug": False}


def _global_first(arguments: Sequence[str]) -> list[str]:
    """The same command line with its global options moved before the command, where the parser expects them."""
    first: list[str] = []
    rest: list[str] = []
    given = list(arguments)
    while given:
        word = given.pop(0)
        if word == "--":
            rest += [word, *given]
            break
        name, equals, _ = word.partition("=")
        if name not in _ANYWHERE:
            rest.append(word)
            continue
        first.append(word)
        if _ANYWHERE[name] and not equals and given:
            first.append(given.pop(0))
    return [*first, *rest]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command line and return its exit code.  Without ``arguments``, the process's own."""
    few_threads()
    keep_heap_small()
    search_seldom()
    prepare_streams()
    blank = Settings()
    settings.log_format, settings.log_level, settings.debug = blank.log_format, blank.log_level, blank.debug
    given = _global_first(sys.argv[1:] if arguments is None else arguments)
    try:
        code = make_app()(args=given, prog_name="pnfarm", standalone_mode=False)
        sys.stdout.flush()
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        silence(sys.stdout)
        return 0
    except SystemExit as exc:
        if isinstance(exc.__context__, BrokenPipeError):
            silence(sys.stdout)
            return 0
        return exc.code if isinstance(exc.code, int) else 0
    except typer.Abort:
        return 130
    except Exception as exc:  # noqa: BLE001 - the one place where every error becomes a sentence and a code
        return report(exc)
    return code if isinstance(code, int) else 0


def run() -> None:
    """Entry point of the installed program."""
    code = main()
    try:
        sys.stderr.flush()
    except OSError:
        # what the interpreter cannot flush at its end would change the exit code
        silence(sys.stderr)
    sys.exit(code)


if __name__ == "__main__":
    run()
