"""One farm and several controllers in one virtual world, each with the submodules of a drive that it is given."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from ipaddress import IPv4Interface

from pnfarm.buses.controller import ControllerHost
from pnfarm.buses.profinet.controller.core import ProfinetCore
from pnfarm.buses.profinet.controller.device_plan import ProfinetPlan
from pnfarm.buses.profinet.controller.plan import plan_devices
from pnfarm.drives.parameters.memory import VolatileMemory
from pnfarm.farm.core import FarmCore
from pnfarm.farm.farm import model_of
from pnfarm.farm.file.reading import expand, parse_farm
from pnfarm.farm.virtual import VirtualWorld
from pnfarm.links.base import PortSpec
from pnfarm.station.event_log import EventLog


class SharedLine:
    """``controllers[i]`` has what ``wants[i]``, a test on a submodule's slot, picks of each drive."""

    def __init__(self, text: str, wants) -> None:
        self.log = EventLog(quiet=True)
        self.world = VirtualWorld()
        self.controllers: list[ProfinetCore] = []
        asyncio.run(self._create(parse_farm(text), wants))

    async def _create(self, config, wants):
        drives = expand(config)
        link = self.world.link()
        ports = await link.open([PortSpec(drive.name, drive.mac) for drive in drives])
        self.farm = FarmCore(
            "farm",
            drives,
            model_of,
            link,
            ports,
            memory=VolatileMemory(),
            log=self.log,
            seed=b"farm",
            clock=self.world.clock,
            lldp=False,
        )
        self.world.join(self.farm, ports)
        self.farm.start(self.world.now)
        section = config.controller
        for number, wanted in enumerate(wants):
            own = self.world.link()
            (port,) = await own.open([PortSpec(f"plc-{number}", bytes([2, 0, 0, 0, 9, number]))])
            plans = [
                replace(plan, submodules=tuple(s for s in plan.submodules if wanted(s.slot)), reconnect_after_ns=None)
                for plan in plan_devices(section, drives, [model_of(drive) for drive in drives])
            ]
            plan = ProfinetPlan(f"plc-{number}", IPv4Interface((section.ip.ip + number, 23)), plans)
            host = ControllerHost(own, port, EventLog(quiet=True), bytes([number]), lldp=False)
            controller = ProfinetCore(plan, host)
            self.world.join(controller, [port])
            controller.start(self.world.now)
            self.controllers.append(controller)

    def run(self, seconds: float) -> None:
        self.world.run(seconds)

    def until(self, condition, within: float = 5.0) -> bool:
        return self.world.run(within, until=condition)

    def reasons(self) -> list[str]:
        return [f"{s.state} {s.measures.last_reason}" for c in self.controllers for s in c.sessions]
