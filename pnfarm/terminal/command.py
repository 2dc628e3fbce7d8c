"""A command of the program: the function it runs and its place in the help."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    import typer

__all__ = ["Command", "Panel", "arranged"]


class Panel(StrEnum):
    """Headings of the help."""

    START = "Start here"
    FARM = "Farm"
    RUNNING = "Running farm"
    CONTROLLER = "Controller"
    REFERENCE = "Reference"
    MACHINE = "This machine"


@dataclass(frozen=True, slots=True)
class Command:
    """``run`` is a function with Typer's annotations, or a group of such.

    ``behind`` names the command that it follows in the help; within a panel, groups come after plain commands.
    ``pnfarm --help`` imports the modules of all commands, so they import at the top only what the help needs,
    and what imports next to nothing itself: ``errors``, ``terminal``.
    """

    name: str
    panel: Panel
    run: Callable[..., Any] | typer.Typer
    behind: str = ""


def arranged(commands: Iterable[Command], further: Iterable[Command]) -> list[Command]:
    """``commands`` with the ``further`` ones, each behind its own.

    Raises :class:`ValueError` for a name that is taken, and for a ``behind`` that is no command.
    """
    found = list(commands)
    for command in further:
        names = [other.name for other in found]
        if command.name in names:
            raise ValueError(f"two commands are called {command.name}")
        if command.behind not in names:
            raise ValueError(f"{command.name} is to follow {command.behind}, which is not a command")
        place = names.index(command.behind) + 1
        while place < len(found) and found[place].behind == command.behind:
            place += 1
        found.insert(place, command)
    return found
