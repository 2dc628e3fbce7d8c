"""What a bus offers to the house, and what the house asks of a device on it.

A bus is one room under :mod:`pnfarm.buses`; the house above knows it only through these types, and no bus knows
another.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from pathlib import Path

    from fastapi import FastAPI

    from pnfarm.buses.controller import Controller, ControllerHost, ControllerPlan
    from pnfarm.buses.farm_file import FarmFilePart
    from pnfarm.captures.decoder import FrameDecoder
    from pnfarm.captures.packet import Capture
    from pnfarm.drives.model import Model
    from pnfarm.engine.columns import Columns
    from pnfarm.engine.impairments import ImpairmentTable
    from pnfarm.engine.schedule import ChannelTable
    from pnfarm.faults.carrier import Carriers
    from pnfarm.faults.gate import GatedLink
    from pnfarm.faults.kind import InjectionKind
    from pnfarm.faults.parts import InjectedDrive
    from pnfarm.station.device import Device
    from pnfarm.station.station import Station
    from pnfarm.terminal.command import Command

__all__ = ["Bus", "DeviceServices", "InjectionHost", "RouteHost", "Segment"]


@dataclass(frozen=True, slots=True)
class DeviceServices:
    """What a device uses and does not own: rows of the channel and impairment tables, a seed for its UUIDs.

    ``lldp``: whether the drives speak LLDP.
    """

    channels: ChannelTable
    impairments: ImpairmentTable
    seed: bytes
    lldp: bool = True


class Segment(Protocol):
    """What the devices of one farm on one bus have in common: whom a frame concerns."""

    def admits(self, port: int, frame: bytes, now: int) -> bool:
        """Whether the device at this port has to do anything about a frame; what it has not is counted there."""
        ...

    def audience(self, frame: bytes) -> Sequence[int] | None:
        """Ports that a group-addressed frame can concern, None for any: saves a switch in memory the copies."""
        ...

    def settled(self, port: int) -> None:
        """The device at this port may have another address now."""
        ...


@dataclass(frozen=True, slots=True)
class InjectionHost:
    """What a farm has for the injections into one drive.  ``settle(now)`` lets its device finish what was begun."""

    columns: Columns
    impairments: ImpairmentTable
    gate: GatedLink
    carriers: Carriers
    settle: Callable[[int], None]


class RouteHost(Protocol):
    """What the API has for the routes of a bus."""

    def station(self, name: str) -> Station:
        """A drive by its name.

        Raises :class:`~pnfarm.web.errors.NotFoundError`, as a bus's routes do for a drive on another bus.
        """
        ...

    def now(self) -> int:
        """The farm's clock."""
        ...

    def changed(self, station: Station) -> None:
        """A handler changed this drive: let it finish what follows, and send it."""
        ...


class Bus(Protocol):
    """One fieldbus; :mod:`pnfarm.buses.registry` has them all.

    The module of a bus imports at its head next to nothing: ``pnfarm --help`` imports it.  Its methods import what
    they give.
    """

    @property
    def name(self) -> str:
        """As a model says which bus it is for: ``profinet``."""
        ...

    @property
    def title(self) -> str:
        """As people write it: ``PROFINET``."""
        ...

    @property
    def link_kinds(self) -> frozenset[str]:
        """Kinds of links that can carry it, by the farm file's words."""
        ...

    @property
    def farm_file(self) -> FarmFilePart[Any, Any]:
        """Its part of the farm file; groups, drives and controllers there are the bus's own."""
        ...

    @property
    def connection_states(self) -> Sequence[str]:
        """The words of :attr:`pnfarm.station.device.ConnectionView.state`, in the order of their numbers from 1."""
        ...

    @property
    def usual_losses(self) -> Sequence[str]:
        """Slugs of the reasons for which drives usually lose their connection."""
        ...

    def channel_rows(self, model: Model) -> int:
        """Rows of each channel table that one drive of this model may need at once."""
        ...

    def device(self, station: Station, services: DeviceServices) -> Device:
        """The device of one drive; the station builds it when it powers on."""
        ...

    def segment(self, devices: Sequence[Any]) -> Segment:
        """What the farm's devices on this bus have in common; they are the bus's own."""
        ...

    def plan(self, section: Any, drives: Sequence[Any], models: Sequence[Model], folder: Path | None) -> ControllerPlan:
        """What the farm file's controller is to do with the drives of this bus; section and drives are the bus's own.

        ``folder`` is what files that the section names are relative to.  Raises :class:`ConfigError`.
        """
        ...

    def controller(self, plan: Any, host: ControllerHost) -> Controller:
        """The controller that carries out a plan of this bus."""
        ...

    def fault_kinds(self) -> Iterable[InjectionKind]:
        """The kinds of injections that only drives on this bus can have."""
        ...

    def commands(self) -> Iterable[Command]:
        """What only this bus has on the command line.  Quick: each start of the program asks for it."""
        ...

    def add_routes(self, app: FastAPI, host: RouteHost) -> None:
        """Add to the API what only drives on this bus have, with its types."""
        ...

    @property
    def frame_families(self) -> Sequence[str]:
        """Words for the families of this bus's frames in a capture; ``cyclic`` is every bus's word for cyclic data."""
        ...

    def decoder(self, capture: Capture) -> FrameDecoder:
        """What says in words what the bus's frames of one capture are."""
        ...

    def injected_drive(self, device: Any, host: InjectionHost) -> InjectedDrive:
        """A drive of this bus as injections see it; ``device`` is the bus's own."""
        ...
