"""A farm of drives on EtherNet/IP and the built-in scanner in one virtual world, and what passed between them."""

from __future__ import annotations

import asyncio
from ipaddress import IPv4Interface
from typing import TYPE_CHECKING, Any

from pnfarm.buses.controller import ControllerHost
from pnfarm.buses.ethernetip.controller.core import EthernetIpCore
from pnfarm.buses.ethernetip.controller.plan import plan_controller
from pnfarm.controller.line import VirtualLine
from pnfarm.farm.farm import model_of
from pnfarm.farm.file.reading import expand, parse_farm
from pnfarm.links.base import PortSpec
from pnfarm.station.event_log import EventLog

if TYPE_CHECKING:
    from pathlib import Path

    from pnfarm.station.station import Station

__all__ = ["FILE", "ScannerLine"]

FILE = """
farm: cip
link: {{kind: memory}}
drives:
  - {{name: 'axis-{{n}}', count: {drives}, model: akd-ethernetip, ip: 10.77.0.11/23{group}}}
controller:
  name: plc
  ip: 10.77.1.250/23
  program: {program}
  reconnect: {reconnect}{more}
"""
RUN = "{kind: constant, speed_rpm: 60, acknowledge_after: 200ms}"


class ScannerLine:
    """``run`` seconds; look at ``farm``, ``plc`` (the file's scanner) and ``log`` (the scanner's)."""

    def __init__(
        self,
        *,
        drives: int = 1,
        program: str = RUN,
        group: str = "",
        more: str = "",
        reconnect: str = "{after: 300ms}",
        start: bool = True,
    ) -> None:
        self.text = FILE.format(drives=drives, program=program, group=group, more=more, reconnect=reconnect)
        config = parse_farm(self.text)
        self.log = EventLog(quiet=True)
        self.farm_log = EventLog(quiet=True)
        self.drives = expand(config)
        farm_only = parse_farm(self.text[: self.text.index("controller:")])
        line = asyncio.run(VirtualLine.create(farm_only, log=self.farm_log))
        self.world, self.farm = line.world, line.farm
        hosts = self.world.switch.network.hosts
        assert self.world.run(3.0, until=lambda: len(hosts) == drives), "no drive came on the wire"
        self.plc = self.scanner(config.controller, self.log, start=start)

    def scanner(
        self,
        section: Any,
        log: EventLog | None = None,
        *,
        number: int = 0,
        start: bool = True,
        folder: Path | None = None,
    ) -> EthernetIpCore:
        """One more scanner in this world."""
        link = self.world.link()
        (port,) = asyncio.run(link.open([PortSpec(f"plc-{number}", bytes.fromhex("02000000fe") + bytes([number]))]))
        plan = plan_controller(section, self.drives, [model_of(drive) for drive in self.drives], folder)
        host = ControllerHost(link, port, log or EventLog(quiet=True), seed=bytes([number]))
        core = EthernetIpCore(plan, host)
        self.world.join(core, [port])
        if start:
            core.start(self.world.now)
        return core

    def second(self, *, ip: str = "10.77.1.251/23", **changes: Any) -> EthernetIpCore:
        """A scanner beside the first, with other keys."""
        section = parse_farm(self.text).controller.model_copy(update={"ip": IPv4Interface(ip)} | changes)
        return self.scanner(section, number=1)

    def run(self, seconds: float) -> None:
        self.world.run(seconds)

    def connect(self, within: float = 5.0) -> None:
        assert self.world.run(within, until=lambda: self.plc.all_connected), self.reasons()

    def enable(self, within: float = 5.0) -> None:
        assert self.world.run(within, until=lambda: self.plc.all_running and self.plc.all_connected), self.reasons()

    def reasons(self) -> str:
        return "; ".join(f"{s.plan.name} {s.state} {s.measures.last_reason}" for s in self.plc.sessions)

    def station(self, name: str = "axis-1") -> Station:
        return self.farm.axis(name)

    def texts(self, name: str = "axis-1") -> list[str]:
        """The scanner's log of a device."""
        return [entry.event for entry in self.log.entries(name)]

    def row(self, place: int = 0) -> dict[str, Any]:
        return self.plc.snapshot()[place]

    def cable(self, *, up: bool, name: str = "axis-1") -> None:
        """Pull the drive's cable, or plug in whatever was pulled."""
        if up:
            self.farm.injections.clear(None, self.world.now)
        else:
            self.farm.injections.inject({"kind": "link-down", "on": name}, self.world.now)

    def power(self, *, on: bool, name: str = "axis-1") -> None:
        station = self.station(name)
        (station.station.power_on if on else station.station.power_off)(self.world.now)
        self.farm.settle(station.station, self.world.now)
