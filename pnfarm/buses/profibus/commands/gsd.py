"""``pnfarm gsd``: the file that an engineering tool imports for a virtual drive on PROFIBUS."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

__all__ = ["gsd"]


def gsd(
    model: Annotated[str, typer.Argument(metavar="MODEL", help="Drive model, one of `pnfarm models`.")],
    directory: Annotated[
        Path,
        typer.Option(
            "--output", "-o", metavar="DIR", help="Folder for the file, made if needed; - prints it.", allow_dash=True
        ),
    ] = Path(),
) -> None:
    """Write a model's GSD file, which describes the virtual drive, and print its path."""
    from pnfarm.buses.profibus.description.sheet import describe_model, file_name
    from pnfarm.drives import catalogue
    from pnfarm.errors import ConfigError, EnvironmentError_
    from pnfarm.protocols.profibus.gsd import emit_gsd
    from pnfarm.terminal.output import print_line, print_next

    described = catalogue.model(model)
    octets = emit_gsd(describe_model(described))
    if str(directory) == "-":
        typer.echo(octets, nl=False)
        return
    name = file_name(described)
    if directory.suffix.lower() == ".gsd" and not directory.is_dir():
        raise ConfigError(f"{directory} is not a folder; give the folder, the file is called {name}")
    path = directory / name
    try:
        directory.mkdir(parents=True, exist_ok=True)
        path.write_bytes(octets)
    except OSError as exc:
        raise EnvironmentError_(f"{path} cannot be written: {(exc.strerror or str(exc)).lower()}") from exc
    print_line(str(path))
    print_next("install it in the engineering tool (docs/drives/index.md says where)")
