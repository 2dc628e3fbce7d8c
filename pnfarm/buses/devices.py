"""Buses with devices by makers' files: the keys of ``devices:``, and the stations."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, runtime_checkable

from pnfarm.errors import InternalError

if TYPE_CHECKING:
    from pathlib import Path

    from pnfarm.buses.bus import DeviceServices
    from pnfarm.config.device import DeviceConfig, DeviceGroup
    from pnfarm.config.ip import Macs
    from pnfarm.station.device import Device
    from pnfarm.station.station import Station
    from pnfarm.vocabulary.issues import Location, Report

__all__ = ["DeviceBus", "DeviceRows", "DevicesPart", "device_bus", "devices_part"]


@dataclass(frozen=True, slots=True)
class DeviceRows:
    """What one device may need of the table at once: rows of each channel table, and pieces of plain data."""

    channels: int
    pieces: int


class DevicesPart(ABC):
    """A bus's part of ``devices:``; groups and devices are the bus's own."""

    #: The module that reads their files: for farm files with devices only.
    file_reader: ClassVar[str]

    @property
    @abstractmethod
    def devices(self) -> type[DeviceGroup]:
        """The keys of a group on this bus."""

    @abstractmethod
    def check_devices_group(self, at: Location, group: Any, report: Report) -> None:
        """Check a group's own keys."""

    def describe(self, at: Location, group: DeviceGroup, folder: Path, report: Report) -> DeviceGroup:
        """The group with what its file, relative to ``folder``, says; as it was where that is wrong, and reported.

        ``describe_group`` of the bus's ``file_reader`` makes it of the file; its ``sentences()`` are for people.
        """
        found = import_module(self.file_reader).describe_group(at, group, folder, report)
        return group if found is None else group.adopting(found)

    @abstractmethod
    def device(self, common: DeviceConfig, group: Any, step: int, macs: Macs) -> DeviceConfig:
        """A described group's device number ``step``, whose name is counted already."""


@runtime_checkable
class DeviceBus(Protocol):
    """What a bus says besides if it has devices by files."""

    @property
    def name(self) -> str: ...

    @property
    def description_key(self) -> str:
        """The key of a group that names the file: ``gsdml``."""

    def device_rows(self, config: Any) -> DeviceRows:
        """What one device of this bus needs of the table."""

    def described_device(self, station: Station, services: DeviceServices) -> Device:
        """The station's end of the bus."""


def device_bus(bus: Any) -> DeviceBus:
    """The same bus; raises :class:`InternalError` for one without devices by files."""
    if not isinstance(bus, DeviceBus):
        raise InternalError(f"{bus.name} has no devices by files")
    return bus


def devices_part(bus: Any) -> DevicesPart:
    """The bus's part of ``devices:``."""
    part: DevicesPart = bus.farm_file
    return part
