"""The file by which an engineering tool knows a virtual drive, as a command writes it: EDS, GSD, GSDML."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pnfarm.errors import ConfigError, EnvironmentError_
from pnfarm.terminal.output import print_line, print_next

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.drives.description.model import Model

__all__ = ["FolderOption", "ModelArgument", "write_description"]

ModelArgument = Annotated[str, typer.Argument(metavar="MODEL", help="Drive model, one of `pnfarm models`.")]
FolderOption = Annotated[
    Path,
    typer.Option(
        "--output", "-o", metavar="DIR", help="Folder for the file, made if needed; - prints it.", allow_dash=True
    ),
]


def write_description(
    model: str, directory: Path, suffix: str, name_of: Callable[[Model], str], emit: Callable[[Model], bytes]
) -> None:
    """Write a model's file and print its path; ``suffix`` is that of files of this kind.

    Raises :class:`ConfigError` for a model that does not exist or is on another bus.
    """
    from pnfarm.drives import catalogue

    described = catalogue.model(model)
    octets = emit(described)
    if str(directory) == "-":
        typer.echo(octets, nl=False)
        return
    name = name_of(described)
    if (directory.suffix.lower() == suffix or directory.exists()) and not directory.is_dir():
        raise ConfigError(f"{directory} is not a folder; give the folder, the file is called {name}")
    path = directory / name
    try:
        directory.mkdir(parents=True, exist_ok=True)
        path.write_bytes(octets)
    except OSError as exc:
        raise EnvironmentError_(f"{path} cannot be written: {(exc.strerror or str(exc)).lower()}") from exc
    print_line(str(path))
    print_next("install it in the engineering tool (docs/drives/index.md says where)")
