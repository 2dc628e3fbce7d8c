"""A bus's part of the farm file: keys, their checks, and the drives made from them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar

from pnfarm.config.controller import ControllerSection
from pnfarm.config.drive import DriveGroup
from pnfarm.vocabulary.quoting import shown

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pnfarm.config.drive import DriveConfig
    from pnfarm.config.ip import Macs
    from pnfarm.config.known import Known, ModelFacts
    from pnfarm.vocabulary.issues import Location, Report

__all__ = ["CONTROLLER", "Claims", "Expansion", "FarmFilePart", "PlacedGroup"]

#: Owner of the values in the controller's section; with several controllers, followed by "on" and the bus's title.
CONTROLLER = "the controller"

Group = TypeVar("Group", bound=DriveGroup)
Controller = TypeVar("Controller", bound=ControllerSection)


class Claims:
    """Names and addresses that must be unique in a farm, each with its first owner."""

    def __init__(self) -> None:
        self._owners: dict[tuple[str, object], tuple[str, str]] = {}

    def claim(self, key: str, value: object, where: str, name: str) -> str | None:
        """Claim a value of a key for the drive or device ``name`` of a place; None, or a text that names its owner."""
        owner = self._owners.setdefault((key, value), (where, name))
        if owner == (where, name):
            return None
        return owner[0] if owner[0].startswith(CONTROLLER) else f"{shown(owner[1])} of {owner[0]}"

    def place(self, key: str, value: object) -> str:
        """The place of the first owner of a value."""
        return self._owners[key, value][0]


@dataclass(frozen=True, slots=True)
class PlacedGroup(Generic[Group]):
    """A group, where it is reported, and its ``label`` in messages: ``drives[2]``."""

    at: Location
    label: str
    group: Group


@dataclass(frozen=True, slots=True)
class Expansion:
    """What the drives of a file share while they are counted up; ``controller``: that of their bus, if it has one."""

    macs: Macs
    controller: ControllerSection | None


class FarmFilePart(ABC, Generic[Group, Controller]):
    """A bus's part of the farm file.

    The file is flat: a group has the keys of every drive (:class:`pnfarm.config.drive.DriveGroup`) and those of its
    model's bus beside each other.  Checks report a place, what is wrong, and what is allowed; one report per group and
    cause, not one per drive.
    """

    @property
    @abstractmethod
    def drives(self) -> type[Group]:
        """The keys of a group on this bus."""

    @property
    def controller(self) -> type[Controller] | None:
        """The keys of the built-in controller on this bus; None where there is none."""
        return None

    @property
    def together(self) -> Mapping[str, Sequence[str]]:
        """Keys that belong together: where the first is wrong, the others are not checked."""
        return {}

    @property
    def judged_by_model(self) -> frozenset[str]:
        """Keys of a group that only its model can check, so that they are not checked for an unknown model."""
        return frozenset()

    @abstractmethod
    def check_name(self, at: Location, name: str, report: Report) -> bool:
        """Whether a drive of this bus may be called so; it is reported if not."""

    @abstractmethod
    def check_group(self, at: Location, group: Group, report: Report) -> None:
        """Check a group's keys, independent of its model."""

    def check_model(self, at: Location, group: Group, model: ModelFacts, report: Report) -> None:
        """Check a group's keys against its model."""

    def check_devices(self, controller: Controller, claims: Claims, report: Report) -> None:
        """Devices in addition to the drives, which only the controller's section names."""

    def check_controller(
        self, controller: Controller, groups: Sequence[PlacedGroup[Group]], known: Known, report: Report
    ) -> None:
        """Check the controller's keys, also against the groups on its bus."""

    @abstractmethod
    def drive(
        self, common: DriveConfig, group: Group, step: int, model: ModelFacts | None, expansion: Expansion
    ) -> DriveConfig:
        """A group's drive number ``step``, whose name is counted already; ``model`` is None if it is unknown."""
