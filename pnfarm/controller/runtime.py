"""The controller in real time: what ``pnfarm plc`` runs."""

from __future__ import annotations

import asyncio
import contextlib
import os
import time
from typing import TYPE_CHECKING, Any, Self

import anyio

from pnfarm.buses.controller import ControllerHost
from pnfarm.config.links import MacvlanLink as MacvlanSection
from pnfarm.config.links import MemoryLink as MemorySection
from pnfarm.config.links import TapLink as TapSection
from pnfarm.config.links import VethLink as VethSection
from pnfarm.controller.plan import plan_controller
from pnfarm.controller.program_file import program_of
from pnfarm.controller.program_runner import ProgramRunner
from pnfarm.controller.program_thread import ProgramThread
from pnfarm.drives.profiles.profidrive.pkw import NO_TASK
from pnfarm.errors import ConfigError
from pnfarm.farm.farm import realtime_settings
from pnfarm.farm.file.reading import FarmConfig, controller_mac, expand, load_farm
from pnfarm.farm.realtime import RealTimeDriver
from pnfarm.links.base import PortSpec, unwrap
from pnfarm.links.capabilities import require_for_link
from pnfarm.links.interface import InterfaceLink
from pnfarm.links.interfaces import remove_leftovers
from pnfarm.links.kernel_addresses import hold_ports
from pnfarm.links.macvlan import MacvlanLink
from pnfarm.links.ownership import FarmLock, bridge_name
from pnfarm.links.tap import TapLink
from pnfarm.links.veth import VethLink
from pnfarm.station.event_log import EventLog

if TYPE_CHECKING:
    import socket
    from collections.abc import Callable, Sequence
    from pathlib import Path
    from types import TracebackType

    from pnfarm.buses.controller import Controller, ProgrammableDevice
    from pnfarm.controller.axis_program import AxisProgram
    from pnfarm.drives.profiles.profidrive.pkw import Pkw
    from pnfarm.engine.realtime import RealTimeSettings
    from pnfarm.links.base import Link
    from pnfarm.station.events import Event

__all__ = ["Plc"]

#: How long a release may take before the controller closes anyway.
RELEASE_SECONDS = 2.0


def _link(config: FarmConfig, interface: str | None, owner: str) -> Link:
    """The controller's link: an existing interface, a link of its own, or a port beside the farm's drives."""
    section = config.controller
    interface = interface or (section.interface if section else None)
    if interface is not None:
        return InterfaceLink(interface)
    wanted = (section.link if section else None) or config.link
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


class Plc:
    """Use as an asynchronous context manager; leaving it releases every connection."""

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
        self.config = config
        self.section = section
        self.log = log or EventLog()
        self.drives = expand(config)
        self._owner = f"{config.farm or 'farm'} {section.name}"
        self.link = link or _link(config, interface, self._owner)
        self._own_link = link is None
        self._settings = settings or realtime_settings(config, len(self.drives) + len(section.device_names))
        self._lock = FarmLock(self._owner)
        self._driver: RealTimeDriver | None = None
        self._held: list[socket.socket] = []
        self._core: Controller | None = None
        self._runner: ProgramRunner | None = None
        self._programs: ProgramThread | None = None

    @classmethod
    def from_file(cls, path: str | Path, *, interface: str | None = None, **overrides: Any) -> Self:
        config = load_farm(path).with_overrides(overrides, origin="argument")
        return cls(config, interface=interface)

    @property
    def core(self) -> Controller:
        if self._core is None:
            raise ConfigError("the controller is not running: use it inside `async with`")
        return self._core

    @property
    def driver(self) -> RealTimeDriver:
        if self._driver is None:
            raise ConfigError("the controller is not running: use it inside `async with`")
        return self._driver

    def check_rights(self) -> None:
        """Raises :class:`EnvironmentError_` where this process may not do what the controller's link needs."""
        require_for_link(unwrap(self.link).kind, f"controller {self.section.name}")

    async def open(self) -> None:
        """Take the port, start the engine, begin to search for the drives."""
        bus, plan = plan_controller(self.config, self.drives)
        kind = program_of(self.config)
        address, ports = plan.udp_ports
        self._lock.acquire()
        try:
            if self._own_link and self.link.kind != "interface":
                await remove_leftovers(self._owner)
            mac = controller_mac(self.config) or bytes(6)
            (port,) = await self.link.open([PortSpec(self.section.name, mac)])
            if address is not None:
                self._held += hold_ports(address, ports)
            self._core = bus.controller(
                plan, ControllerHost(self.link, port, self.log, seed=os.urandom(16), lldp=self.config.lldp)
            )
            self._driver = RealTimeDriver(self._core, self._settings)
            await self._driver.start()
            self._core.start(time.monotonic_ns())
            self._driver.poke()
            if kind is not None:
                self._start_programs(kind, plan.devices)
        except BaseException:
            await self.close()
            raise

    def _start_programs(self, kind: type[AxisProgram], devices: Sequence[ProgrammableDevice]) -> None:
        loop = asyncio.get_running_loop()

        def note(now: int, drive: str, event: Event) -> None:
            with contextlib.suppress(RuntimeError):  # the loop is closed: there is no log to write to
                loop.call_soon_threadsafe(self.log.record, now, drive, event)

        def failed(exc: Exception) -> None:
            with contextlib.suppress(RuntimeError):
                loop.call_soon_threadsafe(self.driver.fail, exc)

        limit = self.section.program.limit_ns
        self._runner = ProgramRunner(self.core.columns, devices, kind, note, limit_ns=limit, in_real_time=True)
        self._programs = ProgramThread(self._runner, failed)
        self._programs.start()

    async def release(self, seconds: float = RELEASE_SECONDS) -> bool:
        """Release every connection; false when a drive did not confirm in time."""
        core = self.core
        core.release(time.monotonic_ns())
        self.driver.poke()
        with anyio.move_on_after(seconds):
            while not core.all_stopped:  # noqa: ASYNC110 - the state machines have no events to wait for
                await anyio.sleep(0.01)
        return core.all_stopped

    async def close(self) -> None:
        try:
            if self._programs is not None:
                await asyncio.to_thread(self._programs.close)
                self._programs = None
            if self._driver is not None:
                await self._driver.close()
        finally:
            try:
                await self.link.close()
            finally:
                for sock in self._held:
                    sock.close()
                self._held.clear()
                self._lock.release()
                self._driver = None

    async def wait(self) -> None:
        """Wait until something fails; raises its exception."""
        await self.driver.wait()

    async def wait_connected(self, seconds: float) -> bool:
        """Until every drive exchanges data both ways, at most ``seconds``."""
        return await self._wait(lambda core: core.all_connected, seconds)

    async def wait_running(self, seconds: float) -> bool:
        """Until every enabled axis is in operation, at most ``seconds``."""
        return await self._wait(lambda core: core.all_running and core.all_connected, seconds)

    async def _wait(self, condition: Callable[[Controller], bool], seconds: float) -> bool:
        with anyio.move_on_after(seconds):
            while not condition(self.core):  # noqa: ASYNC110 - the engine's thread sets no events
                await anyio.sleep(0.005)
        return condition(self.core)

    async def ask_parameter(self, name: str, task: Pkw, seconds: float = 1.0) -> Pkw | None:
        """One task through the cyclic parameter channel (PKW) of a drive, as a PLC program has it.

        Sends task 0 until it is answered by 0, then ``task`` until it is answered; that stays in the telegrams.  None
        when the drive did not answer in time.  Raises :class:`ConfigError` for an unknown drive and for a telegram
        without such a channel.
        """
        for wanted in (NO_TASK, task):
            self.core.put_parameter_task(name, wanted)
            idle = wanted.identifier == NO_TASK.identifier

            def answered(core: Controller, idle: bool = idle) -> bool:
                return (core.parameter_answer(name).identifier == NO_TASK.identifier) == idle

            if not await self._wait(answered, seconds):
                return None
        return self.core.parameter_answer(name)

    def summary(self) -> list[dict[str, Any]]:
        """The controller's drives; ``program``: counts of a user's program, None without one."""
        runner = self._runner
        return [
            row | {"program": None if runner is None else runner.snapshot(row["name"])} for row in self.core.snapshot()
        ]

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
