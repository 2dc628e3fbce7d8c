"""How time passes for a farm of this process: with the machine's clock, or as fast as the machine can."""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

import anyio
import anyio.lowlevel

from pnfarm.controller.beside import ControllerBeside
from pnfarm.controller.line import VirtualLine
from pnfarm.drives.parameters.memory import VolatileMemory
from pnfarm.errors import ConfigError
from pnfarm.farm.farm import Farm as RealFarm
from pnfarm.farm.injections import add_impairments
from pnfarm.metrics import FarmCollector
from pnfarm.scenario.lateness import FarmLateness
from pnfarm.scenario.realtime import PAUSE_NS, carry_out
from pnfarm.scenario.run import LOOK_NS, ScenarioRun
from pnfarm.scenario.virtual import carry_out_virtually
from pnfarm.station.event_log import EventLog

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.controller.axis_program import AxisProgram
    from pnfarm.farm.core import FarmCore
    from pnfarm.farm.file.reading import FarmConfig
    from pnfarm.farm.shard import Shard
    from pnfarm.scenario.definition.binding import Binding

__all__ = ["FarmRunner", "RealTimeRunner", "VirtualTimeRunner"]

#: Virtual time between two moments at which other tasks of the event loop run.
STRETCH_NS = 1_000_000_000


class FarmRunner(ABC):
    """A farm in this process, and its time."""

    in_virtual_time = False

    def __init__(self) -> None:
        self.log = EventLog(quiet=True)
        self._collector: FarmCollector | None = None

    @property
    @abstractmethod
    def core(self) -> FarmCore:
        """Raises :class:`ConfigError` while the farm does not run."""

    @property
    def collector(self) -> FarmCollector:
        """The farm's metrics."""
        if self._collector is None:
            raise ConfigError("the farm is not running: use it inside `async with`")
        return self._collector

    @abstractmethod
    async def open(self) -> None:
        """Start the farm; on failure nothing is left behind."""

    @abstractmethod
    async def close(self) -> None:
        """Stop it.  Closing twice does nothing."""

    @abstractmethod
    def now(self) -> int:
        """The farm's clock, ns."""

    @abstractmethod
    def poke(self) -> None:
        """The farm was changed: process the consequences."""

    @abstractmethod
    async def wait(self, holds: Callable[[], bool], within_ns: int, *, polled: bool = True) -> bool:
        """Let time pass until ``holds``; False when it did not in time.  ``polled``: look each millisecond."""

    @abstractmethod
    async def carry_out(self, binding: Binding) -> dict[str, Any]:
        """Run a scenario; its record."""

    @abstractmethod
    def controller_rows(self) -> list[dict[str, Any]]:
        """The built-in controller's drives.  Raises :class:`ConfigError` where it is not in this process."""

    @abstractmethod
    def program(self, name: str) -> AxisProgram:
        """The object of an axis of a program in Python.  Raises :class:`ConfigError`."""

    def _stop_counting(self) -> None:
        if self._collector is not None:
            self._collector.close()
            self._collector = None


class RealTimeRunner(FarmRunner):
    """With the machine's clock, on the link of the farm's file."""

    def __init__(self, config: FarmConfig, shard: Shard | None = None) -> None:
        super().__init__()
        self._farm = RealFarm(config, shard=shard, log=self.log)
        self._is_open = False
        self._beside = ControllerBeside(self._farm)
        self._farm.on_start.append(self._count)

    def _count(self, core: FarmCore) -> None:
        self._collector = FarmCollector(core)

    @property
    def core(self) -> FarmCore:
        if not self._is_open:
            raise ConfigError("the farm is not running: use it inside `async with`")
        return self._farm.core

    async def open(self) -> None:
        self._farm.check_rights()
        await self._farm.open()
        self._is_open = True

    async def close(self) -> None:
        self._is_open = False
        try:
            await self._farm.close()
        finally:
            self._stop_counting()

    def now(self) -> int:
        return self._farm.now()

    def poke(self) -> None:
        self._farm.poke()

    async def wait(self, holds: Callable[[], bool], within_ns: int, *, polled: bool = True) -> bool:
        failed = asyncio.ensure_future(self._farm.wait())
        woken = asyncio.Event()
        unsubscribe = self.log.subscribe(lambda _: woken.set())
        end = self.now() + within_ns
        try:
            while True:
                woken.clear()
                now = self.now()
                if holds():
                    return True
                if now >= end:
                    return False
                pause = min(end - now, LOOK_NS if polled else PAUSE_NS)
                with anyio.move_on_after(pause / 1e9):
                    await woken.wait()
                if failed.done():
                    # the farm itself has failed: raise what broke it
                    failed.result()
        finally:
            unsubscribe()
            failed.cancel()
            await asyncio.gather(failed, return_exceptions=True)

    async def carry_out(self, binding: Binding) -> dict[str, Any]:
        now = self.now()
        lateness = FarmLateness(self.core, binding.scenario.budget_ns, now)
        run = ScenarioRun(binding, self.core, self.collector, now, lateness=lateness)
        await carry_out(run, self.core, self.poke, self.now)
        return run.record.as_dict()

    def controller_rows(self) -> list[dict[str, Any]]:
        return self._beside.joined.summary()

    def program(self, name: str) -> AxisProgram:
        programs = self._beside.joined.programs
        if programs is None:
            raise ConfigError("the controller of this farm has no program in Python")
        return programs.program(name)


class VirtualTimeRunner(FarmRunner):
    """In memory in virtual time, which passes only while something is awaited of the farm."""

    in_virtual_time = True

    def __init__(self, config: FarmConfig, shard: Shard | None = None) -> None:
        super().__init__()
        self._config = config
        self._shard = shard
        self._line: VirtualLine | None = None

    @property
    def _open(self) -> VirtualLine:
        if self._line is None:
            raise ConfigError("the farm is not running: use it inside `async with`")
        return self._line

    @property
    def core(self) -> FarmCore:
        return self._open.farm

    async def open(self) -> None:
        if self._line is not None:
            raise ConfigError("the farm runs already")
        self._line = await VirtualLine.create(self._config, memory=VolatileMemory(), log=self.log, shard=self._shard)
        self._collector = FarmCollector(self._line.farm)
        farm = self._line.farm
        add_impairments(farm.injections, self._line.stations, self._line.world.now, part=self._shard is not None)

    async def close(self) -> None:
        line, self._line = self._line, None
        try:
            if line is not None:
                await line.close()
        finally:
            self._stop_counting()

    def now(self) -> int:
        return self._open.world.now

    def poke(self) -> None:
        """The world looks at what has changed when it runs on."""

    async def wait(self, holds: Callable[[], bool], within_ns: int, *, polled: bool = True) -> bool:
        world = self._open.world
        end = world.now + within_ns
        look_ns = LOOK_NS if polled else None
        while not holds():
            # other tasks, and a cancellation, have their turn
            await anyio.lowlevel.checkpoint()
            if self._line is None or world.now >= end:
                return False
            world.run(min(STRETCH_NS, end - world.now) / 1e9, until=holds, look_ns=look_ns)
        return True

    async def carry_out(self, binding: Binding) -> dict[str, Any]:
        world = self._open.world
        run = ScenarioRun(binding, self.core, self.collector, world.now)
        try:
            await carry_out_virtually(run, world)
        finally:
            run.cancel(world.now)
        return run.record.as_dict()

    def controller_rows(self) -> list[dict[str, Any]]:
        return self._open.joined.summary()

    def program(self, name: str) -> AxisProgram:
        if self._open.programs is None:
            raise ConfigError("the controller of this farm has no program in Python")
        return self._open.programs.program(name)
