"""Interface of a bus to the rest of the package, and the services that a device on it uses.

A bus is one package under :mod:`pnfarm.buses`; the rest knows it only through these types, and no bus knows
another.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from pnfarm.links.base import PortSpec

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
    from ipaddress import IPv4Address
    from pathlib import Path
    from types import ModuleType

    from fastapi import FastAPI

    from pnfarm.buses.controller import Controller, ControllerHost, ControllerPlan
    from pnfarm.buses.farm_file import FarmFilePart
    from pnfarm.captures.decoder import FrameDecoder
    from pnfarm.captures.packet import Capture
    from pnfarm.drives.description.model import Model
    from pnfarm.engine.channels.impairments import ImpairmentTable
    from pnfarm.engine.channels.schedule import ChannelTable
    from pnfarm.engine.columns import Columns
    from pnfarm.engine.lateness import LatenessRecord
    from pnfarm.faults.effects.addresses import Addresses
    from pnfarm.faults.effects.carrier import Carriers
    from pnfarm.faults.effects.parts import InjectedDrive
    from pnfarm.faults.gate.gate import GatedLink
    from pnfarm.faults.gate.socket_gate import SocketGate
    from pnfarm.faults.kind import InjectionKind, KindOnBus
    from pnfarm.links.serial.link import Splitter
    from pnfarm.station.absent import Absent
    from pnfarm.station.device import Device
    from pnfarm.station.station import Station
    from pnfarm.terminal.command import Command

__all__ = [
    "Bus", "DeviceServices", "InjectionHost", "LineBus", "LineSegment", "RouteHost", "Segment",
    "line_of", "port_spec",
]  # fmt: skip


@dataclass(frozen=True, slots=True)
class DeviceServices:
    """What a device uses and does not own: rows of the channel and impairment tables, a seed for its UUIDs.

    ``lateness``: how late the farm itself was; ``lldp``: whether the drives speak LLDP.  ``next_hop(port, address)``:
    the MAC address to which a drive's frames for an IPv4 address go, None while it is not known, and ``answers_arp``:
    whether the link answers ARP for a drive's address, so that its device must not; both only for buses with sockets.
    ``plain_row``: the row of plain data of a station that has such.
    """

    channels: ChannelTable
    impairments: ImpairmentTable
    lateness: LatenessRecord
    seed: bytes
    lldp: bool = True
    next_hop: Callable[[int, IPv4Address], bytes | None] = lambda _port, _address: None
    answers_arp: bool = False
    plain_row: int = 0


class Segment(Protocol):
    """State that the devices of one farm on one bus share: which device a frame concerns."""

    @property
    def absent(self) -> Absent:
        """Names or addresses that controllers ask for and no device has."""

    def admits(self, port: int, frame: bytes, now: int) -> bool:
        """Whether the device at this port has to process a frame; the others are counted there."""

    def audience(self, frame: bytes, now: int, besides: Collection[int] = ()) -> Sequence[int] | None:
        """Ports that a group-addressed frame can concern, None for any: the others get no copy.

        It is asked once, for all devices; what :meth:`admits` would have counted for the others counts there
        nevertheless, except for the ports ``besides``, which get it anyway.
        """

    def settled(self, port: int) -> None:
        """The device at this port may have another address now."""


@dataclass(frozen=True, slots=True)
class InjectionHost:
    """Services of the farm for injections into one drive.

    ``settle(now)`` lets its device process their effects; ``sockets`` is what its streams and datagrams pass.
    """

    columns: Columns
    impairments: ImpairmentTable
    gate: GatedLink
    carriers: Carriers
    addresses: Addresses
    settle: Callable[[int], None]
    sockets: SocketGate


class RouteHost(Protocol):
    """Services of the API for the routes of a bus."""

    def station(self, name: str) -> Station:
        """A drive by its name.

        Raises :class:`~pnfarm.web.errors.NotFoundError`, as a bus's routes do for a drive on another bus.
        """

    def now(self) -> int:
        """The farm's clock."""

    def changed(self, station: Station) -> None:
        """A handler changed this drive: let it process the consequences and send its frames."""


class Bus(ABC):
    """One fieldbus; :mod:`pnfarm.buses.registry` has them all.

    What a bus offers is in its own folder, in modules that have the same names on each bus.  It is imported when it is
    asked for, because ``pnfarm --help`` imports every bus.  A bus has here what is different on it.
    """

    @property
    @abstractmethod
    def name(self) -> str:
        """Name by which a model names its bus: ``profinet``."""

    @property
    @abstractmethod
    def title(self) -> str:
        """Name for people: ``PROFINET``."""

    @property
    @abstractmethod
    def link_kinds(self) -> frozenset[str]:
        """Kinds of links that can carry it, by the farm file's words."""

    @property
    def uses_sockets(self) -> bool:
        """Whether its drives are a :class:`~pnfarm.station.device.SocketDevice`.

        On a link with interfaces, the kernel then answers for the addresses of drives and controller: no IPv4 comes
        to :meth:`~pnfarm.station.device.Device.receive`, and ARP is received, but not answered there.
        """
        return False

    @property
    def folder(self) -> str:
        """The package with its modules: that of its own class."""
        return type(self).__module__.rpartition(".")[0]

    @property
    def prefix(self) -> str:
        """How the names of its classes begin: as that of its own class, ``Profinet``."""
        return type(self).__name__

    def _room(self, name: str) -> ModuleType:
        return import_module(f"{self.folder}.{name}")

    def _own(self, room: str, name: str) -> Any:
        """What a module of its folder has under a name."""
        return getattr(self._room(room), name)

    @property
    def farm_file(self) -> FarmFilePart[Any, Any]:
        """Its part of the farm file; groups, drives and controllers there are the bus's own."""
        return self._own("config.part", f"{self.name.upper()}_PART")

    @property
    def connection_states(self) -> Sequence[str]:
        """The words of :attr:`pnfarm.station.device.ConnectionView.state`, in the order of their numbers from 1."""
        return self._own("device.view", "CONNECTION_STATES")

    @property
    def usual_losses(self) -> Sequence[str]:
        """Slugs of the reasons for which drives usually lose their connection."""
        return self._own("device.view", "USUAL_LOSSES")

    @abstractmethod
    def channel_rows(self, model: Model) -> int:
        """Rows of each channel table that one drive of this model may need at once."""

    def device(self, station: Station, services: DeviceServices) -> Device:
        """The device of one drive; the station builds it when it powers on."""
        return self._own("device.device", f"{self.prefix}Device")(station, services)

    def segment(self, devices: Sequence[Any]) -> Segment:
        """The shared state of the farm's devices on this bus; ``devices`` are the bus's own."""
        return self._own("device.segment", f"{self.prefix}Segment")(devices)

    def plan(
        self,
        section: Any,
        drives: Sequence[Any],
        models: Sequence[Model],
        folder: Path | None,
        devices: Sequence[Any] = (),
    ) -> ControllerPlan:
        """What the farm file's controller is to do with the drives and devices of this bus, which are the bus's own, as
        the section is.

        Files that the section names are relative to ``folder``.  Raises :class:`ConfigError`.
        """
        further = (devices,) if devices else ()
        return self._own("controller.plan", "plan_controller")(section, drives, models, folder, *further)

    def controller(self, plan: Any, host: ControllerHost) -> Controller:
        """The controller that carries out a plan of this bus."""
        return self._own("controller.core", f"{self.prefix}Core")(plan, host)

    def fault_kinds(self) -> Iterable[InjectionKind]:
        """The kinds of injections that only drives on this bus can have."""
        from pnfarm.faults.catalogue import kinds_in

        return kinds_in(self._room("faults.kinds"))

    def kinds_here(self) -> Mapping[str, KindOnBus]:
        """What it says about kinds that are not its own, by their names: parameters of its own, texts, refusals."""
        return self._own("faults.on_bus", f"ON_{self.name.upper()}")

    def commands(self) -> Iterable[Command]:
        """The bus's own commands.  Has to be fast: it runs at each start of the program."""
        return ()

    def add_routes(self, app: FastAPI, host: RouteHost) -> None:  # noqa: B027 - most buses have none
        """Add the bus's own routes and types to the API."""

    @property
    @abstractmethod
    def frame_families(self) -> Sequence[str]:
        """Words for the families of this bus's frames in a capture; ``cyclic`` is every bus's word for cyclic data."""

    def decoder(self, capture: Capture) -> FrameDecoder:
        """The decoder of the bus's frames of one capture."""
        return self._own("decode.decoder", f"{self.prefix}Decoder")(capture)

    def injected_drives(self, device: Any, host: InjectionHost) -> Sequence[InjectedDrive]:
        """A station of this bus as injections see it, behind it its axes if there are several."""
        drives: Sequence[InjectedDrive] = self._own("faults.drive", "injected_drives")(device, host)
        return drives


@runtime_checkable
class LineBus(Protocol):
    """What a bus says besides if its stations share one serial line; one without this has a network.

    Such stations have no hardware address; a frame is a telegram, and each of them hears all.
    """

    @property
    def link_type(self) -> int:
        """LINKTYPE of its telegrams in a capture (tcpdump.org)."""

    @property
    def baud_rates(self) -> Sequence[int]:
        """Rates that its lines may have, bit/s."""

    def longest_reply_ns(self, baud: int) -> int:
        """How late an answer may begin after the last bit of its request."""

    def splitter(self, baud: int) -> Splitter:
        """For one end of a line of this rate, bit/s."""


@runtime_checkable
class LineSegment(Protocol):
    """What a segment does besides if its drives share a line."""

    def counts(self) -> Mapping[str, int]:
        """What happened on the line since the start, by kind: the same kinds always."""

    def addressed(self, octets: bytes) -> int | None:
        """Port of the one drive that these octets poll for its cyclic data; None for anything else."""

    def answer(self, octets: Any, length: int, now: int) -> tuple[int, memoryview] | None:
        """Port and answer of a drive whose poll is like the one before; None, and nothing done, for anything else.

        ``octets``: an array of bytes, of which so many count.  The answer is overwritten by the next one.
        """

    def answered(self, port: int, now: int) -> None:
        """What this port had to send is on the line: what its requests changed may follow."""

    def poll(self, port: int, octets: bytes, now: int) -> bytes | None:
        """The drive's answer to a poll, where nothing but its cyclic data changes by it.

        None: nothing was done, and the octets are to go the usual way.
        """

    def least_reply_bits(self, port: int) -> int:
        """Bit times between a request and the answer of this drive at least."""


def line_of(bus: Bus) -> str:
    """The name of the serial line that the stations of a bus share, empty for a network."""
    return bus.name if isinstance(bus, LineBus) else ""


def port_spec(bus: Bus, station: str, mac: bytes) -> PortSpec:
    """The port that a station on this bus wants, drive or controller."""
    if not isinstance(bus, LineBus):
        return PortSpec(station, mac, kernel=bus.uses_sockets)
    return PortSpec(station, b"", line=bus.name, link_type=bus.link_type)
