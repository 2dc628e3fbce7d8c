"""A farm and its controllers in one virtual world, from one farm file."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.buses.bus import port_spec
from pnfarm.buses.controller import ControllerHost
from pnfarm.buses.registry import bus
from pnfarm.config.device import DeviceConfig
from pnfarm.config.drive import DriveConfig
from pnfarm.config.ip import IpController
from pnfarm.config.links import MemoryLink as MemorySection
from pnfarm.controller.group import Controllers
from pnfarm.controller.plan import plan_controllers
from pnfarm.controller.program_file import program_of, program_settings
from pnfarm.controller.program_runner import ProgramRunner, with_programs
from pnfarm.drives.parameters.memory import VolatileMemory
from pnfarm.errors import ConfigError
from pnfarm.farm.core import FarmCore
from pnfarm.farm.farm import model_of
from pnfarm.farm.file.places import places_of
from pnfarm.farm.file.reading import controller_mac, expand_all
from pnfarm.farm.plant import plant_of
from pnfarm.farm.shard import part_of
from pnfarm.farm.state.files import states_folder
from pnfarm.farm.virtual import VirtualWorld
from pnfarm.links.capture.pcap import PcapLink
from pnfarm.station.event_log import EventLog

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from pnfarm.buses.controller import Controller
    from pnfarm.controller.axis_program import AxisProgram
    from pnfarm.drives.parameters.memory import NonVolatile
    from pnfarm.farm.file.reading import FarmConfig
    from pnfarm.farm.shard import Shard
    from pnfarm.links.base import Link, Port
    from pnfarm.links.capture.files import BlockSink
    from pnfarm.links.memory import MemoryLink

__all__ = ["JoinedControllers", "VirtualLine", "join_controllers"]


@dataclass(frozen=True, slots=True)
class JoinedControllers:
    """Controllers in a world; ``programs``: the users' programs of their axes, None where the file has none."""

    controllers: Controllers
    programs: ProgramRunner | None
    links: Sequence[MemoryLink]

    def summary(self) -> list[dict[str, Any]]:
        """Their drives, as rows of ``pnfarm plc --json``."""
        return with_programs(self.controllers.snapshot(), self.programs)

    async def close(self) -> None:
        """End the users' programs, and leave the world's switch."""
        if self.programs is not None:
            await asyncio.to_thread(self.programs.close)
        for link in self.links:
            await link.close()


async def join_controllers(
    world: VirtualWorld,
    config: FarmConfig,
    drives: Sequence[DriveConfig],
    log: EventLog,
    program: type[AxisProgram] | None = None,
    devices: Sequence[DeviceConfig] = (),
) -> JoinedControllers | None:
    """Put the file's controllers into a world that has its farm already, and power them on; None where it has none.

    ``program`` replaces the file of a program of one's own.  Raises :class:`ConfigError` for one that needs a network.
    """
    if not config.controllers:
        return None
    for section in config.controllers:
        if isinstance(section, IpController) and (controller_mac(config, section) is None or section.ip is None):
            raise ConfigError("a controller in memory needs `ip`, and no `interface`")
    planned = plan_controllers(config, drives, devices)
    links: list[MemoryLink] = []
    ports: list[Port] = []
    for one in planned:
        link = world.link()
        links.append(link)
        ports += await link.open([port_spec(one.bus, one.section.name, one.mac or b"")])
    controllers = Controllers(
        planned,
        [
            one.bus.controller(one.plan, ControllerHost(link, port, log, seed=b"plc", lldp=config.lldp))
            for one, link, port in zip(planned, links, ports, strict=True)
        ],
    )
    settings, runner = program_settings(config), None
    if settings is not None and (kind := program or program_of(config)) is not None:
        runner = ProgramRunner(
            controllers,
            kind,
            log.record,
            limit_ns=settings.limit_ns,
            in_real_time=False,
            call_ns=settings.call_time_ns,
        )
    for node, port in zip(controllers, ports, strict=True):
        world.join(node, [port])
    if runner is not None:
        world.join_programs(runner)
    controllers.start(world.now)
    return JoinedControllers(controllers, runner, links)


class VirtualLine:
    """``farm`` and its controllers (none without a ``controller:`` section) in ``world``; made by :meth:`create`."""

    def __init__(
        self,
        config: FarmConfig,
        world: VirtualWorld,
        farm: FarmCore,
        farm_link: MemoryLink,
        joined: JoinedControllers | None,
        stations: Sequence[DriveConfig | DeviceConfig],
    ) -> None:
        self.config = config
        #: The drives, and then the devices.
        self.stations = stations
        self.drives = [one for one in stations if isinstance(one, DriveConfig)]
        self.world = world
        self.farm = farm
        self.farm_link = farm_link
        self._joined = joined
        #: The users' programs of the controllers' axes, None where the file has none.
        self.programs: ProgramRunner | None = joined.programs if joined is not None else None

    async def close(self) -> None:
        """End the users' programs and the plant's models, close the farm's link, and with it a capture."""
        if self.programs is not None:
            self.programs.close()
        if self.farm.plant is not None:
            self.farm.plant.close()
        await self.farm.link.close()

    @property
    def joined(self) -> JoinedControllers:
        """What runs the drives; raises :class:`ConfigError` when the file has no controller."""
        if self._joined is None:
            raise ConfigError("the file has no `controller:` section")
        return self._joined

    @property
    def controllers(self) -> Controllers:
        """The controllers; raises as :attr:`joined` does."""
        return self.joined.controllers

    @property
    def plc(self) -> Controller:
        """The only controller, or the first; raises as :attr:`joined` does."""
        return self.controllers.first

    @classmethod
    async def create(
        cls,
        config: FarmConfig,
        *,
        memory: NonVolatile | None = None,
        log: EventLog | None = None,
        plc_log: EventLog | None = None,
        pcap: Path | None = None,
        frames: BlockSink | None = None,
        epoch_ns: int | None = None,
        program: type[AxisProgram] | None = None,
        shard: Shard | None = None,
    ) -> VirtualLine:
        """Power the drives on, and the controllers where the file has some.  Nothing runs before ``world.run``.

        ``pcap`` (or ``frames``) captures all frames of the drives, stamped with the world's time plus ``epoch_ns``
        (default: such that the world begins now); :meth:`close` ends it.
        ``program`` replaces the file of a program of one's own; ``shard``: the part of the drives that is here, with
        controllers for it.  Raises :class:`~pnfarm.errors.EnvironmentError_`.
        """
        whole_farm = expand_all(config)
        stations = whole_farm if shard is None else part_of(config, whole_farm, shard)
        drives = [one for one in stations if isinstance(one, DriveConfig)]
        devices = [one for one in stations if isinstance(one, DeviceConfig)]
        world = VirtualWorld()
        section = config.link
        link = world.link(baud=section.baud if isinstance(section, MemorySection) else 0)
        whole: Link = link
        if pcap is not None or frames is not None:
            comment = f"pnfarm farm {config.farm or 'farm'}"
            whole = PcapLink(link, pcap, clock=world.clock, epoch_ns=epoch_ns, comment=comment, sink=frames)
            world.watch(whole.record)
        specs = [port_spec(bus(model_of(drive).bus), drive.name, drive.mac) for drive in drives]
        specs += [port_spec(bus(device.bus), device.name, device.mac) for device in devices]
        ports = await whole.open(specs)
        farm = FarmCore(
            config.farm or "farm",
            drives,
            model_of,
            whole,
            ports,
            memory=memory or VolatileMemory(),
            log=log or EventLog(quiet=True),
            seed=b"farm",
            clock=world.clock,
            lldp=config.lldp,
            shard=shard,
            devices=devices,
            plant=plant_of(config, stations, model_of),
            file=places_of(config, whole_farm),
            states=states_folder(config.state_directory, shard),
        )
        world.join(farm, ports)
        farm.start(world.now)
        joined = await join_controllers(world, config, drives, plc_log or EventLog(quiet=True), program, devices)
        return cls(config, world, farm, link, joined, stations)
