"""What a bus finds of a plant in a capture or a project, for ``pnfarm import``."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from pnfarm.buses.caex import CaexElement
    from pnfarm.captures.decoder import FrameDecoder

__all__ = ["FoundDrive", "FoundStation", "ImportingBus", "ProjectBus"]


@dataclass(frozen=True, slots=True)
class FoundDrive:
    """A station that a model stands for: keys of its group in a farm file, and what a user should know of each.

    ``line``: of a station on a serial line, the line's name in a farm file.
    """

    name: str
    model: str
    keys: Mapping[str, Any]
    #: What was seen, and what is not sure; comments of the farm file.
    notes: tuple[str, ...] = ()
    #: Of its controller, for the built-in one: its name, cycle and watchdog.
    controller: Mapping[str, Any] = field(default_factory=dict)
    line: str = ""


@dataclass(frozen=True, slots=True)
class FoundStation:
    """A station that no model stands for: its name or address, and what was seen of it."""

    name: str
    facts: tuple[str, ...]
    line: str = ""


@runtime_checkable
class ProjectBus(Protocol):
    """What a bus says besides if it finds its stations in engineering projects."""

    def of_project(self, root: CaexElement, folders: Sequence[Path], base: Path) -> Iterable[FoundDrive | FoundStation]:
        """The project's stations, drives first.

        Description files are looked for in ``folders``; ``base`` is the folder of the farm file to be.  Raises
        :class:`~pnfarm.errors.ConfigError` for a folder that cannot be read.
        """
        ...


@runtime_checkable
class ImportingBus(Protocol):
    """What a bus says besides if it finds its stations in captures."""

    def observe(self, decoder: FrameDecoder) -> None:
        """Note the plant in the frames that this decoder of the bus's gets from now on."""
        ...

    def found(self, decoder: FrameDecoder) -> Iterable[FoundDrive | FoundStation]:
        """What was noted, devices first."""
        ...
