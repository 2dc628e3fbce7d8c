"""What a bus finds of a plant in a capture or a project, for ``pnfarm import``."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from pnfarm.buses.bus import Bus

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    from pnfarm.buses.projects.description_folders import DescriptionFile, DescriptionFolders

__all__ = [
    "Found", "FoundController", "FoundDevice", "FoundDrive", "FoundStation", "ImportingBus", "ProjectBus", "Said",
    "drives_first",
]  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Said:
    """What a source says of a station in words, to be held against another source's: by subject, of modules by slot.

    ``name`` is the station's own, empty where one was made up for it; ``identity`` are the subjects that tell which
    product it is.
    """

    name: str = ""
    identity: Mapping[str, str] = field(default_factory=dict)
    subjects: Mapping[str, str] = field(default_factory=dict)
    slots: Mapping[int, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class FoundDrive:
    """A station that becomes a drive of a model: keys of its group in a farm file, and what a user should know of each.

    ``notes`` say how it is made and what is not sure, ``facts`` what it is in the plant: comments of the farm file.
    ``line``: of a station on a serial line, the line's name in a farm file.  ``file``: what ``gsdml``
    or ``identity`` names, where that has to be written.  ``doubts``: what of a project could not be taken over.
    """

    name: str
    model: str
    keys: Mapping[str, Any]
    notes: tuple[str, ...] = ()
    facts: tuple[str, ...] = ()
    line: str = ""
    file: DescriptionFile | None = None
    said: Said = field(default_factory=Said)
    doubts: tuple[str, ...] = ()
    #: Whether its controller compares vendor and device when it connects.
    keyed: bool = True


@dataclass(frozen=True, slots=True)
class FoundDevice:
    """A station that becomes a device by its file; ``keys`` are the others of its group, ``doubts`` as of a drive."""

    name: str
    file: DescriptionFile
    keys: Mapping[str, Any]
    notes: tuple[str, ...] = ()
    facts: tuple[str, ...] = ()
    line: str = ""
    said: Said = field(default_factory=Said)
    doubts: tuple[str, ...] = ()
    #: Whether its controller compares vendor and device when it connects.
    keyed: bool = True


@dataclass(frozen=True, slots=True)
class FoundStation:
    """A station that becomes neither drive nor device: its name or address, and what was seen of it.

    ``missing``: the description file that would do, where that is known.  ``keys`` are those of its addresses.
    """

    name: str
    facts: tuple[str, ...]
    line: str = ""
    missing: str = ""
    keys: Mapping[str, Any] = field(default_factory=dict)
    said: Said = field(default_factory=Said)


@dataclass(frozen=True, slots=True)
class FoundController:
    """A project's PLC on one bus: ``keys`` of its section, and its stations.

    Their keys are those of ``devices`` in the section; one that it cannot run is no device, with the reason as its
    first fact.
    """

    keys: Mapping[str, Any]
    stations: Sequence[FoundDevice | FoundStation]


Found = FoundDrive | FoundDevice | FoundStation
_ORDER = (FoundDrive, FoundDevice, FoundStation)


def drives_first(found: Iterable[Found]) -> Iterator[Found]:
    """Drives, devices, other stations; in the same order otherwise."""
    return iter(sorted(found, key=lambda one: _ORDER.index(type(one))))


class ProjectBus(Bus):
    """A bus that finds its stations in engineering projects of a kind, ``caex`` or ``l5x``."""

    project_kind: ClassVar[str]

    def of_project(self, project: Any, folders: DescriptionFolders, base: Path) -> Iterable[Found]:
        """The stations of a project of this kind (a `CaexProject` or an `L5xProject`), drives first.

        Description files are searched in ``folders``; ``base`` is the folder of the farm file to be.
        """
        return self._own("project.stations", "of_project")(project, folders, base)

    def controller_of_project(
        self, project: Any, folders: DescriptionFolders, base: Path, plc: str | None
    ) -> FoundController:
        """The PLC of this name, or the only one, with all of its stations, none as a drive of a model.

        Raises :class:`ConfigError` where that is not one PLC with one system on this bus.
        """
        found: FoundController = self._own("project.controlled", "controller_of_project")(project, folders, base, plc)
        return found


class ImportingBus(Bus):
    """A bus that finds its stations in captures."""

    def observe(self, decoder: Any) -> None:
        """Note the plant in the frames that this decoder of the bus's gets from now on."""
        decoder.shared.observed = self._own("decode.observed", "Observed")()

    def found(self, decoder: Any, *, models: bool = True) -> Iterable[Found]:
        """What was noted, drives first; without ``models`` no station becomes a drive."""
        return self._own("found", "found")(decoder, models=models)
