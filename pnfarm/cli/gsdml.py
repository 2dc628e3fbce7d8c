"""``pnfarm gsdml``: the file that an engineering tool imports to know a virtual drive."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

__all__ = ["gsdml"]


def gsdml(
    model: Annotated[str, typer.Argument(metavar="MODEL", help="Drive model, one of `pnfarm models`.")],
    directory: Annotated[
        Path,
        typer.Option(
            "--output", "-o", metavar="DIR", help="Folder to write the file into; - prints it.", allow_dash=True
        ),
    ] = Path(),
) -> None:
    """Write a model's GSDML file, which says what the virtual drive answers, and print its path."""
    from pnfarm.cli.output import print_line
    from pnfarm.drives import catalogue
    from pnfarm.errors import EnvironmentError_
    from pnfarm.protocols.profinet.gsdml.describe import describe_model, file_name
    from pnfarm.protocols.profinet.gsdml.writer import emit_gsdml

    described = catalogue.model(model)
    text = emit_gsdml(describe_model(described))
    if str(directory) == "-":
        typer.echo(text, nl=False)
        return
    path = directory / file_name(described)
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as exc:
        raise EnvironmentError_(f"{path} cannot be written: {(exc.strerror or str(exc)).lower()}") from exc
    print_line(str(path))
