"""A farm and its controller in one virtual world, from one farm file."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.buses.controller import ControllerHost
from pnfarm.config.ip import IpController
from pnfarm.controller.plan import plan_controller
from pnfarm.controller.program_file import program_of
from pnfarm.controller.program_runner import ProgrammedNode, ProgramRunner
from pnfarm.drives.memory import VolatileMemory
from pnfarm.errors import ConfigError
from pnfarm.farm.core import FarmCore
from pnfarm.farm.farm import model_of
from pnfarm.farm.file.reading import controller_mac, expand
from pnfarm.farm.virtual import VirtualWorld
from pnfarm.links.base import PortSpec
from pnfarm.links.pcap import PcapLink
from pnfarm.station.event_log import EventLog

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from pnfarm.buses.controller import Controller
    from pnfarm.config.drive import DriveConfig
    from pnfarm.controller.axis_program import AxisProgram
    from pnfarm.drives.memory import NonVolatile
    from pnfarm.farm.file.reading import FarmConfig
    from pnfarm.links.base import Link
    from pnfarm.links.memory import MemoryLink

__all__ = ["JoinedController", "VirtualLine", "join_controller"]


@dataclass(frozen=True, slots=True)
class JoinedController:
    """A controller in a world; ``programs``: the users' programs of its axes, None where the file has none."""

    plc: Controller
    programs: ProgramRunner | None
    link: MemoryLink

    def summary(self) -> list[dict[str, Any]]:
        """Its drives, as rows of ``pnfarm plc --json``."""
        programs = self.programs
        return [
            row | {"program": None if programs is None else programs.snapshot(row["name"])}
            for row in self.plc.snapshot()
        ]

    async def close(self) -> None:
        """End the users' programs, and leave the world's switch."""
        if self.programs is not None:
            await asyncio.to_thread(self.programs.close)
        await self.link.close()


async def join_controller(
    world: VirtualWorld,
    config: FarmConfig,
    drives: Sequence[DriveConfig],
    log: EventLog,
    program: type[AxisProgram] | None = None,
) -> JoinedController | None:
    """Put the file's controller into a world that has its farm already, and power it on; None where it has none.

    ``program`` replaces the file of a program of one's own.  Raises :class:`ConfigError` for one that needs a network.
    """
    section = config.controller
    if section is None:
        return None
    mac = controller_mac(config)
    if isinstance(section, IpController) and (mac is None or section.ip is None):
        raise ConfigError("a controller in memory needs `ip`, and no `interface`")
    link = world.link()
    (port,) = await link.open([PortSpec(section.name, mac or b"")])
    bus, plan = plan_controller(config, drives)
    plc = bus.controller(plan, ControllerHost(link, port, log, seed=b"plc", lldp=config.lldp))
    kind, runner = program or program_of(config), None
    if kind is not None:
        runner = ProgramRunner(
            plc.columns,
            plan.devices,
            kind,
            log.record,
            limit_ns=section.program.limit_ns,
            in_real_time=False,
            call_ns=section.program.call_time_ns,
        )
    world.join(plc if runner is None else ProgrammedNode(plc, runner), [port])
    plc.start(world.now)
    return JoinedController(plc, runner, link)


class VirtualLine:
    """``farm`` and ``plc`` (None without a ``controller:`` section) in ``world``; made by :meth:`create`."""

    def __init__(
        self, config: FarmConfig, world: VirtualWorld, farm: FarmCore, farm_link: MemoryLink, plc: Controller | None
    ) -> None:
        self.config = config
        self.world = world
        self.farm = farm
        self.farm_link = farm_link
        self._plc = plc
        #: The users' programs of the controller's axes, None where the file has none.
        self.programs: ProgramRunner | None = None

    async def close(self) -> None:
        """End the users' programs, close the farm's link, and with it a capture."""
        if self.programs is not None:
            self.programs.close()
        await self.farm.link.close()

    @property
    def plc(self) -> Controller:
        """The controller; raises :class:`ConfigError` when the file has none."""
        if self._plc is None:
            raise ConfigError("the file has no `controller:` section")
        return self._plc

    @classmethod
    async def create(
        cls,
        config: FarmConfig,
        *,
        memory: NonVolatile | None = None,
        log: EventLog | None = None,
        plc_log: EventLog | None = None,
        pcap: Path | None = None,
        epoch_ns: int | None = None,
        program: type[AxisProgram] | None = None,
    ) -> VirtualLine:
        """Power the drives on, and the controller where the file has one.  Nothing runs before ``world.run``.

        ``pcap`` captures all frames of the drives, stamped with the world's time plus ``epoch_ns`` (default: such that
        the world begins now); :meth:`close` ends it.
        ``program`` replaces the file of a program of one's own.  Raises :class:`~pnfarm.errors.EnvironmentError_`.
        """
        drives = expand(config)
        world = VirtualWorld()
        link = world.link()
        whole: Link = link
        if pcap is not None:
            whole = PcapLink(
                link, pcap, clock=world.clock, epoch_ns=epoch_ns, comment=f"pnfarm farm {config.farm or 'farm'}"
            )
            world.watch(whole.record)
        ports = await whole.open([PortSpec(drive.name, drive.mac) for drive in drives])
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
        )
        world.join(farm, ports)
        farm.start(world.now)
        joined = await join_controller(world, config, drives, plc_log or EventLog(quiet=True), program)
        if joined is None:
            return cls(config, world, farm, link, None)
        line = cls(config, world, farm, link, joined.plc)
        line.programs = joined.programs
        return line
