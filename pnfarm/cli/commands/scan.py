"""``pnfarm scan``: the devices on this wire, whatever their bus; each bus searches in its own way."""

from __future__ import annotations

from ipaddress import IPv4Address
from typing import TYPE_CHECKING, Annotated

import typer

from pnfarm.buses import registry
from pnfarm.errors import ConfigError
from pnfarm.terminal.output import print_json, print_line
from pnfarm.terminal.settings import Format, FormatOption

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.buses.search import SearchAnswer

__all__ = ["scan"]

#: Stations that announce themselves do so every 5 s or more often: each has sent once by then.
_NEIGHBOUR_SECONDS = 6.0


def scan(
    interface: Annotated[
        str,
        typer.Option("--interface", "-i", metavar="IF", help="Network interface, such as eth1.", show_default=False),
    ],
    bus: Annotated[
        list[str] | None,
        typer.Option(
            "--bus",
            metavar="BUS",
            help=f"Search for devices on this bus: {', '.join(registry.searches())}.  Repeatable; default: all.",
            show_default=False,
        ),
    ] = None,
    to: Annotated[
        list[str] | None,
        typer.Option(
            "--to",
            metavar="IP",
            help="Ask this address as well, where the bus can: a broadcast may not reach it.  Repeatable.",
            show_default=False,
        ),
    ] = None,
    seconds: Annotated[float, typer.Option(min=0.1, max=60, help="How long to wait for answers.")] = 2.0,
    lldp_seconds: Annotated[
        float, typer.Option(min=0.1, max=120, help="How long to listen for LLDP in all.")
    ] = _NEIGHBOUR_SECONDS,
    no_lldp: Annotated[bool, typer.Option("--no-lldp", help="Do not listen for LLDP.")] = False,
    output: FormatOption = Format.TABLE,
) -> None:
    """Find devices on the wire (name, type, addresses, identity), and neighbours by LLDP."""
    import anyio

    from pnfarm.buses.search import Question

    searches = registry.searches()
    wanted = _wanted(bus or ())
    addresses = tuple(map(_address, to or ()))
    answers: list[SearchAnswer] = []
    for name in wanted:
        question = Question(interface, seconds, 0.0 if no_lldp else lldp_seconds, addresses, chosen=bool(bus))
        answers.append(anyio.run(searches[name].search, question))
    for answer in answers:
        for sentence in answer.warnings:
            typer.echo(sentence, err=True)
    if output is Format.JSON:
        found = zip(wanted, answers, strict=True)
        print_json([{"bus": name, **device} for name, answer in found for device in answer.devices])
        return
    shown = [answer for answer in answers if answer.searched]
    for place, answer in enumerate(shown):
        if place:
            print_line("")
        answer.show()


def _wanted(names: Sequence[str]) -> list[str]:
    """The buses to search, each once."""
    known = registry.searches()
    for name in names:
        if name not in known:
            raise ConfigError(f"unknown bus {name!r}, allowed are {', '.join(known)}")
    return list(dict.fromkeys(names or known))


def _address(text: str) -> IPv4Address:
    try:
        return IPv4Address(text)
    except ValueError as exc:
        raise ConfigError(f"--to {text!r} is not an IPv4 address, such as 10.77.0.11") from exc
