"""The global options as given, and the options and arguments that several commands share."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

__all__ = [
    "DEFAULT_URL",
    "ApiOption",
    "FarmFile",
    "Format",
    "FormatOption",
    "LogFormat",
    "LogLevel",
    "Settings",
    "ShardOption",
    "TlsCaOption",
    "TokenOption",
    "help_without_command",
    "setting",
    "settings",
]

#: Default address of a farm's API.
DEFAULT_URL = "http://127.0.0.1:8702"


class Format(StrEnum):
    """Output format of a command."""

    TABLE = "table"
    JSON = "json"


class LogFormat(StrEnum):
    """Format of the log lines on standard error."""

    CONSOLE = "console"
    JSON = "json"


class LogLevel(StrEnum):
    """Lowest level that is logged."""

    DEBUG = "debug"
    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


@dataclass(slots=True)
class Settings:
    """Global options; ``log_format`` None follows standard error: console on a terminal, else JSON."""

    log_format: LogFormat | None = None
    log_level: LogLevel = LogLevel.INFO
    debug: bool = False

    @property
    def logs_json(self) -> bool:
        """Whether log lines are JSON objects."""
        if self.log_format is None:
            return not sys.stderr.isatty()
        return self.log_format is LogFormat.JSON


#: Global options of the running command; set by the program's callback.
settings = Settings()


def setting(flag: str, variable: str, text: str, **options: Any) -> Any:
    """An option with its help, which an environment variable may give, too; ``options`` are Typer's.

    The command's text lists the variables, the help does not.
    """
    return typer.Option(flag, envvar=variable, show_envvar=False, help=text, **options)


FarmFile = Annotated[Path, typer.Argument(help="Farm file, *.pnfarm.yml.", metavar="FILE", show_default=False)]
FormatOption = Annotated[Format, typer.Option("--format", help="Output format.")]
ShardOption = Annotated[
    str | None,
    setting(
        "--shard", "PNFARM_UP_SHARD", "Part I of N of the drives, as `pnfarm up --shard I/N` runs it.", metavar="I/N"
    ),
]
ApiOption = Annotated[
    str, typer.Option("--api", help="Address of the farm's API, a URL or HOST:PORT.", envvar="PNFARM_API")
]
TokenOption = Annotated[
    str | None,
    typer.Option(
        "--token",
        help="Bearer token of the API, if it needs one; or set PNFARM_TOKEN_FILE to a file that holds it.",
        envvar="PNFARM_TOKEN",
    ),
]
TlsCaOption = Annotated[
    Path | None,
    typer.Option(
        "--tls-ca",
        help="Authority of the farm's certificate, PEM, for an address with https://; or set PNFARM_TLS_CA.",
        metavar="FILE",
    ),
]


def help_without_command(context: typer.Context) -> None:
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())
        raise typer.Exit
