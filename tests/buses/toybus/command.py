"""``pnfarm toy-order``: an order of the toy bus in hexadecimal."""

from __future__ import annotations

from typing import Annotated

import typer


def toy_order(
    speed: Annotated[int, typer.Argument(min=-3000, max=3000, help="rpm.")] = 0,
    enable: Annotated[bool, typer.Option(help="Whether the drive shall run.")] = True,
) -> None:
    """Print an order of the toy bus."""
    from toybus.frames import Order, emit_order

    typer.echo(emit_order(Order(enable, speed)).hex())
