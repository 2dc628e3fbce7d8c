"""The controllers of a file in real time: what ``pnfarm plc`` runs."""

from __future__ import annotations

import asyncio
import contextlib
import os
import time
from typing import TYPE_CHECKING, Any, Self

import anyio

from pnfarm.buses.bus import line_of, port_spec
from pnfarm.buses.controller import ControllerHost
from pnfarm.config.links import LineWay
from pnfarm.config.links import MacvlanLink as MacvlanSection
from pnfarm.config.links import MemoryLink as MemorySection
from pnfarm.config.links import SerialLink as SerialSection
from pnfarm.config.links import TapLink as TapSection
from pnfarm.config.links import VethLink as VethSection
from pnfarm.controller.group import Controllers
from pnfarm.controller.line_door import LineDoor
from pnfarm.controller.plan import plan_controllers
from pnfarm.controller.program_file import program_of, program_settings
from pnfarm.controller.program_runner import ProgramRunner, with_programs
from pnfarm.drives.profiles.profidrive.pkw import NO_TASK
from pnfarm.errors import ConfigError
from pnfarm.farm.events import RealTimeOptionTakenBack
from pnfarm.farm.farm import realtime_settings
from pnfarm.farm.file.choice import bus_of_controller, titles
from pnfarm.farm.file.reading import FarmConfig, expand, expand_devices, load_farm
from pnfarm.farm.lines import line_bus, make_line
from pnfarm.farm.realtime import RealTimeDriver
from pnfarm.links.base import unwrap
from pnfarm.links.interface import InterfaceLink
from pnfarm.links.kernel.addresses import hold_ports
from pnfarm.links.kernel.capabilities import require_for_link
from pnfarm.links.kernel.interfaces import remove_leftovers
from pnfarm.links.kernel.ownership import FarmLock, bridge_name
from pnfarm.links.macvlan import MacvlanLink
from pnfarm.links.serial.link import SerialLink
from pnfarm.links.tap import TapLink
from pnfarm.links.veth import VethLink
from pnfarm.station.event_log import EventLog
from pnfarm.user_code.thread import CodeThread

if TYPE_CHECKING:
    import socket
    from collections.abc import Callable, Sequence
    from pathlib import Path
    from types import TracebackType

    from pnfarm.buses.controller import Controller
    from pnfarm.config.controller import ControllerSection
    from pnfarm.controller.axis_program import AxisProgram
    from pnfarm.controller.plan import PlannedController
    from pnfarm.drives.profiles.profidrive.pkw import Pkw
    from pnfarm.engine.realtime import RealTimeSettings
    from pnfarm.links.base import Link
    from pnfarm.station.event import Event

__all__ = ["Plc"]

#: How long a release may take before the controller closes anyway.
RELEASE_SECONDS = 2.0


def _link(config: FarmConfig, section: ControllerSection, interface: str | None, owner: str) -> Link:
    """A controller's link: an existing interface, a link of its own, or a port beside the farm's drives."""
    bus = bus_of_controller(section)
    if line_of(bus):
        return make_line(_line(config, section, bus.name), line_bus(bus.name))
    interface = interface or section.interface
    if interface is not None:
        return InterfaceLink(interface)
    wanted = section.link or config.link
    match wanted:
        case MacvlanSection():
            return MacvlanLink(owner, wanted.parent)
        case VethSection():
            bridge = wanted.bridge or bridge_name(config.farm or "farm")
            return VethLink(owner, bridge=bridge)
        case TapSection():
            if wanted.bridge is None:
                raise ConfigError("TAPs without a bridge reach no other station; give `link: {kind: tap, bridge: br0}`")
            return TapLink(owner, bridge=wanted.bridge)
        case MemorySection():
            raise ConfigError(
                "on a memory link the controller runs in the farm's own process: `pnfarm up FILE` starts both; "
                "a controller beside it needs a veth link"
            )
        case _:
            raise ConfigError(
                "the file names no interface for the controller; give `controller: {interface: ...}` or --interface"
            )


def _line(config: FarmConfig, section: ControllerSection, name: str) -> LineWay:
    """The way to a line: the section's own, or the far end of the farm's."""
    if isinstance(section.link, SerialSection):
        if section.link.baud == "auto":
            raise ConfigError("a master has a rate of its own: give `controller: {link: {kind: serial, baud: ...}}`")
        return section.link
    way = config.link if isinstance(config.link, SerialSection) else getattr(config.link, "lines", {}).get(name)
    if way is not None and way.pty not in {None, "auto"}:
        return LineWay(port=way.pty, baud=way.baud)
    if way is not None and way.listen is not None:
        return LineWay(connect=way.listen, baud=way.baud)
    raise ConfigError(
        "the file does not say how the controller reaches the line; give `controller: {link: {kind: serial, port: "
        "...}}`, or a farm whose line has a path (`pty: /tmp/line`) or listens"
    )


class _Station:
    """One controller on the network: its link, its port there, and the engine behind it."""

    def __init__(
        self, config: FarmConfig, section: ControllerSection, interface: str | None, link: Link | None
    ) -> None:
        self._lldp = config.lldp
        self.section = section
        self.owner = f"{config.farm or 'farm'} {section.name}"
        # a link that is given is a network's: a line is the file's, beside it
        given = None if line_of(bus_of_controller(section)) and len(config.controllers) > 1 else link
        self.link = given or _link(config, section, interface, self.owner)
        self._own_link = given is None
        self._lock = FarmLock(self.owner)
        self._is_ours = False
        self._held: list[socket.socket] = []
        self.driver: RealTimeDriver | None = None
        self._door: LineDoor | None = None

    async def open(self, planned: PlannedController, log: EventLog) -> Controller:
        """Take the port; nothing is sent before :meth:`start`."""
        self._lock.acquire()
        self._is_ours = True
        if self._own_link and self.link.kind not in {"interface", "serial"}:
            await remove_leftovers(self.owner)
        (port,) = await self.link.open([port_spec(planned.bus, self.section.name, planned.mac or bytes(6))])
        address, ports = planned.plan.udp_ports
        if address is not None:
            self._held += hold_ports(address, ports)
        host = ControllerHost(self.link, port, log, seed=os.urandom(16), lldp=self._lldp)
        return planned.bus.controller(planned.plan, host)

    async def start(self, core: Controller, settings: RealTimeSettings, log: EventLog) -> None:
        """Start the engine, begin to search for the drives."""

        def demoted(what: str, why: str) -> None:
            log.record(time.monotonic_ns(), "", RealTimeOptionTakenBack(what, why))

        self.driver = RealTimeDriver(core, settings, demoted=demoted)
        await self.driver.start()
        core.start(time.monotonic_ns())
        self.driver.poke()
        if isinstance(self.link, SerialLink):
            self._door = LineDoor(core, self.link.where, self.driver.poke)
            await self._door.open()

    async def close(self) -> None:
        """Give back what it has of all that; nothing where another process has it."""
        if not self._is_ours:
            return
        self._is_ours = False
        try:
            if self._door is not None:
                await self._door.close()
            if self.driver is not None:
                await self.driver.close()
        finally:
            try:
                await self.link.close()
            finally:
                for sock in self._held:
                    sock.close()
                self._held.clear()
                self._lock.release()
                self.driver = None


class Plc:
    """The controllers of a farm file, one for each bus that has drives in it and a controller.

    Use as an asynchronous context manager; leaving it releases every connection.  ``interface`` and ``link`` are for a
    file with one controller on a network; several name their interfaces in the file.  A controller on a line has none.
    """

    def __init__(
        self,
        config: FarmConfig,
        *,
        interface: str | None = None,
        log: EventLog | None = None,
        link: Link | None = None,
        settings: RealTimeSettings | None = None,
    ) -> None:
        section = config.controller
        if section is None:
            raise ConfigError("the file has no `controller:` section; `pnfarm schema farm` shows its keys")
        buses = [bus for one in config.controllers if not line_of(bus := bus_of_controller(one))]
        if len(buses) > 1 and (interface is not None or link is not None):
            raise ConfigError(
                f"the file has controllers on {titles(buses)}, which cannot share one interface; "
                f"give `controller: {{{buses[0].name}: {{interface: ...}}, ...}}`"
            )
        self.config = config
        #: Of the only controller, or the first.
        self.section = section
        self.log = log or EventLog()
        self.drives = expand(config)
        self._stations = [_Station(config, one, interface, link) for one in config.controllers]
        self._settings = settings or realtime_settings(config)
        self._controllers: Controllers | None = None
        self._runner: ProgramRunner | None = None
        self._programs: CodeThread | None = None

    @classmethod
    def from_file(cls, path: str | Path, *, interface: str | None = None, **overrides: Any) -> Self:
        config = load_farm(path).with_overrides(overrides, origin="argument")
        return cls(config, interface=interface)

    @property
    def controllers(self) -> Controllers:
        """All controllers as one."""
        if self._controllers is None:
            raise ConfigError("the controller is not running: use it inside `async with`")
        return self._controllers

    @property
    def core(self) -> Controller:
        """The only controller, or the first."""
        return self.controllers.first

    @property
    def link(self) -> Link:
        """Of the only controller, or the first."""
        return self._stations[0].link

    @property
    def driver(self) -> RealTimeDriver:
        """Of the only controller, or the first."""
        return self._drivers()[0]

    def _drivers(self) -> list[RealTimeDriver]:
        found = [station.driver for station in self._stations if station.driver is not None]
        if not found:
            raise ConfigError("the controller is not running: use it inside `async with`")
        return found

    def check_rights(self) -> None:
        """Raises :class:`EnvironmentError_` where this process may not do what the controllers' links need."""
        for station in self._stations:
            require_for_link(unwrap(station.link).kind, f"controller {station.section.name}")

    async def open(self) -> None:
        """Take the ports, start the engines, begin to search for the drives."""
        planned = plan_controllers(self.config, self.drives, expand_devices(self.config))
        own, kind = program_settings(self.config), program_of(self.config)
        try:
            cores = [await station.open(one, self.log) for station, one in zip(self._stations, planned, strict=True)]
            self._controllers = Controllers(planned, cores)
            for station, core in zip(self._stations, cores, strict=True):
                await station.start(core, self._settings, self.log)
            if own is not None and kind is not None:
                self._start_programs(kind, own.limit_ns)
        except BaseException:
            await self.close()
            raise

    def _start_programs(self, kind: type[AxisProgram], limit_ns: int) -> None:
        loop = asyncio.get_running_loop()

        def note(now: int, drive: str, event: Event) -> None:
            with contextlib.suppress(RuntimeError):  # the loop is closed: there is no log to write to
                loop.call_soon_threadsafe(self.log.record, now, drive, event)

        def failed(exc: Exception) -> None:
            with contextlib.suppress(RuntimeError):
                loop.call_soon_threadsafe(self.driver.fail, exc)

        def begin(action: Callable[[int], None]) -> None:
            action(time.monotonic_ns())
            for driver in self._drivers():
                driver.poke()

        def carry(action: Callable[[int], None]) -> None:
            with contextlib.suppress(RuntimeError):
                loop.call_soon_threadsafe(begin, action)

        self._runner = ProgramRunner(self.controllers, kind, note, limit_ns=limit_ns, in_real_time=True, carry=carry)
        self._programs = CodeThread(self._runner, failed, "pnfarm axis programs")
        self._programs.start()

    async def release(self, seconds: float = RELEASE_SECONDS) -> bool:
        """Release every connection; false when a drive did not confirm in time."""
        controllers = self.controllers
        controllers.release(time.monotonic_ns())
        for driver in self._drivers():
            driver.poke()
        with anyio.move_on_after(seconds):
            while not controllers.all_stopped:  # noqa: ASYNC110 - the state machines have no events to wait for
                await anyio.sleep(0.01)
        return controllers.all_stopped

    async def close(self) -> None:
        try:
            if self._programs is not None:
                await asyncio.to_thread(self._programs.close)
                self._programs = None
        finally:
            await self._close_stations(self._stations)

    async def _close_stations(self, stations: Sequence[_Station]) -> None:
        """Each is closed, whatever fails in the others."""
        if not stations:
            return
        try:
            await stations[0].close()
        finally:
            await self._close_stations(stations[1:])

    async def wait(self) -> None:
        """Wait until something fails; raises its exception."""
        waits = [asyncio.ensure_future(driver.wait()) for driver in self._drivers()]
        try:
            done, _ = await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
            for each in done:
                each.result()
        finally:
            for each in waits:
                each.cancel()
            await asyncio.gather(*waits, return_exceptions=True)

    async def wait_connected(self, seconds: float) -> bool:
        """Until every drive exchanges data both ways, at most ``seconds``."""
        return await self._wait(lambda all_of_them: all_of_them.all_connected, seconds)

    async def wait_running(self, seconds: float) -> bool:
        """Until every enabled axis is in operation, at most ``seconds``."""
        return await self._wait(lambda all_of_them: all_of_them.all_running and all_of_them.all_connected, seconds)

    async def _wait(self, condition: Callable[[Controllers], bool], seconds: float) -> bool:
        with anyio.move_on_after(seconds):
            while not condition(self.controllers):  # noqa: ASYNC110 - the engine's thread sets no events
                await anyio.sleep(0.005)
        return condition(self.controllers)

    async def ask_parameter(self, name: str, task: Pkw, seconds: float = 1.0) -> Pkw | None:
        """One task through the cyclic parameter channel (PKW) of a drive, as a PLC program has it.

        Sends task 0 until it is answered by 0, then ``task`` until it is answered; that stays in the telegrams.  None
        when the drive did not answer in time.  Raises :class:`ConfigError` for an unknown drive and for a telegram
        without such a channel.
        """
        for wanted in (NO_TASK, task):
            self.controllers.put_parameter_task(name, wanted)
            idle = wanted.identifier == NO_TASK.identifier

            def answered(controllers: Controllers, idle: bool = idle) -> bool:
                return (controllers.parameter_answer(name).identifier == NO_TASK.identifier) == idle

            if not await self._wait(answered, seconds):
                return None
        return self.controllers.parameter_answer(name)

    def summary(self) -> list[dict[str, Any]]:
        """The controllers' drives, as rows of ``pnfarm plc --json``."""
        return with_programs(self.controllers.snapshot(), self._runner)

    async def __aenter__(self) -> Self:
        await self.open()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, exc: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is None:
                await self.release()
        finally:
            with anyio.CancelScope(shield=True):
                await self.close()
