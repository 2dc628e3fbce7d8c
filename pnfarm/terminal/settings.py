"""What every command shares: the global options as they were given, and the words that several commands take."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated

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
    "TokenOption",
    "help_without_command",
    "settings",
]

#: Where a farm serves its API when its file says nothing.
DEFAULT_URL = "http://127.0.0.1:8702"


class Format(StrEnum):
    """How a command prints its result."""

    TABLE = "table"
    JSON = "json"


class LogFormat(StrEnum):
    """How log lines are written to standard error."""

    CONSOLE = "console"
    JSON = "json"


class LogLevel(StrEnum):
    """The least that is logged."""

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


#: Of the command that runs; filled by the program's own callback.
settings = Settings()

FarmFile = Annotated[Path, typer.Argument(help="Farm file, *.pnfarm.yml.", metavar="FILE", show_default=False)]
FormatOption = Annotated[Format, typer.Option("--format", help="How to print it.")]
ApiOption = Annotated[
    str, typer.Option("--api", help="Where the farm serves its API, a URL or HOST:PORT.", envvar="PNFARM_API")
]
TokenOption = Annotated[
    str | None,
    typer.Option(
        "--token",
        help="The API's bearer token, where it asks for one; PNFARM_TOKEN_FILE names a file that holds it.",
        envvar="PNFARM_TOKEN",
    ),
]


def help_without_command(context: typer.Context) -> None:
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())
        raise typer.Exit
