"""A farm of AKDs and the built-in controller in one virtual world, from the text of a farm file."""

from __future__ import annotations

import asyncio
from ipaddress import IPv4Interface

from pnfarm.controller.core import ControllerCore
from pnfarm.controller.plan import plan_devices
from pnfarm.drives.memory import VolatileMemory
from pnfarm.farm.config import controller_mac, expand, parse_farm
from pnfarm.farm.core import FarmCore
from pnfarm.farm.event_log import EventLog
from pnfarm.farm.farm import model_of
from pnfarm.farm.virtual import VirtualWorld
from pnfarm.links.base import PortSpec

FILE = """
farm: virtual
link: {{kind: memory}}
drives:
  - name: axis-{{n:02}}
    count: {drives}
    model: akd-profinet
    ip: 10.77.0.11/23
    limits: {limits}
controller:
  name: plc
  ip: 10.77.1.250/23
  cycle: {cycle}
  watchdog_factor: {watchdog}
  startup: {startup}
  telegram: {telegram}
  program: {{kind: constant, speed_rpm: 60, acknowledge_after: 200ms}}
  reconnect: {{after: 300ms}}
"""


class VirtualLine:
    """``run`` seconds; look at ``farm`` and ``plc``."""

    def __init__(self, drives: int = 1, *, cycle: str = "16ms", limits: str = "strict", watchdog: int = 3,
                 startup: str = "legacy", telegram: int = 1, controller: bool = True) -> None:  # fmt: skip
        text = FILE.format(drives=drives, cycle=cycle, limits=limits, watchdog=watchdog, startup=startup, telegram=telegram)
        self.config = parse_farm(text)
        self.drives = expand(self.config)
        self.world = VirtualWorld()
        self.memory = VolatileMemory()
        self.log = EventLog(quiet=True)
        self.plc_log = EventLog(quiet=True)
        link = self.world.link()
        ports = asyncio.run(link.open([PortSpec(drive.name, drive.mac) for drive in self.drives]))
        self.farm = FarmCore(
            "virtual", self.drives, model_of, link, ports, memory=self.memory, log=self.log, seed=b"farm"
        )
        self.world.join(self.farm, ports)
        self.farm.start(self.world.now)
        if controller:
            section = self.config.controller
            assert section is not None
            plc_link = self.world.link()
            mac = controller_mac(self.config)
            assert mac is not None
            (port,) = asyncio.run(plc_link.open([PortSpec("plc", mac)]))
            plans = plan_devices(section, self.drives, [model_of(drive) for drive in self.drives])
            self.plc = ControllerCore(
                "plc", plans, plc_link, port, ip=IPv4Interface("10.77.1.250/23"), log=self.plc_log, seed=b"plc"
            )
            self.world.join(self.plc, [port])
            self.plc.start(self.world.now)

    def run(self, seconds: float) -> None:
        self.world.run(seconds)

    def connect(self, within: float = 5.0) -> None:
        assert self.world.run(within, until=lambda: self.plc.all_connected), self.reasons()

    def enable(self, within: float = 5.0) -> None:
        assert self.world.run(within, until=lambda: self.plc.all_running), self.reasons()

    def reasons(self) -> str:
        return "; ".join(f"{s.plan.name} {s.state} {s.measures.last_reason}" for s in self.plc.sessions)

    def events(self, name: str) -> list[str]:
        return [entry.event for entry in self.log.entries(name)]
