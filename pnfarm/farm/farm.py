"""A running farm in real time: what ``pnfarm up`` runs, and what :class:`pnfarm.Farm` is for Python code."""

from __future__ import annotations

import asyncio
import contextlib
import os
import time
from functools import partial
from typing import TYPE_CHECKING, Any, Self

import anyio

from pnfarm.buses.bus import port_spec
from pnfarm.buses.registry import bus, fault_kinds
from pnfarm.config.device import DeviceConfig
from pnfarm.config.drive import DriveConfig
from pnfarm.config.known import catalogue
from pnfarm.config.links import MacvlanLink as MacvlanSection
from pnfarm.config.links import MemoryLink as MemorySection
from pnfarm.config.links import SerialLink as SerialSection
from pnfarm.config.links import TapLink as TapSection
from pnfarm.config.links import VethLink as VethSection
from pnfarm.drives.catalogue import model as model_by_name
from pnfarm.drives.description.behaviour import with_behaviour
from pnfarm.drives.description.fault_rows import with_faults
from pnfarm.drives.description.identity import with_identity
from pnfarm.drives.description.motor_kinds import with_motor
from pnfarm.drives.telegrams.own_words import with_words
from pnfarm.engine.realtime import RealTimeSettings
from pnfarm.errors import ConfigError, EnvironmentError_
from pnfarm.farm.capture import CaptureSettings, FarmCapture
from pnfarm.farm.core import FarmCore
from pnfarm.farm.events import (
    AnswersWithheld,
    CaptureStarted,
    FarmFileNote,
    FarmStarted,
    FarmStopped,
    LineInterrupted,
    LineOpened,
    LineReady,
    RealTimeOptionRefused,
    RealTimeOptionTakenBack,
)
from pnfarm.farm.file.places import places_of
from pnfarm.farm.file.reading import FarmConfig, expand_all, load_farm
from pnfarm.farm.injections import add_impairments
from pnfarm.farm.lease import Lease
from pnfarm.farm.leaseholder import Leaseholder
from pnfarm.farm.lines import line_ways, make_lines
from pnfarm.farm.load import line_name
from pnfarm.farm.memory.postgres import PostgresState
from pnfarm.farm.memory.sqlite import FarmState
from pnfarm.farm.memory_link import MemoryDriver
from pnfarm.farm.plant import plant_of
from pnfarm.farm.process.open_files import raise_file_limit
from pnfarm.farm.realtime import RealTimeDriver
from pnfarm.farm.shard import Shard, parse_shard, part_of
from pnfarm.farm.state.files import states_folder
from pnfarm.farm.state.states import SavedStates
from pnfarm.farm.virtual import VirtualWorld
from pnfarm.links.base import PortSpec, unwrap
from pnfarm.links.joined import JoinedLink, lines_of
from pnfarm.links.kernel.capabilities import require_for_link
from pnfarm.links.kernel.interfaces import Interfaces, remove_leftovers_now, run_to_completion
from pnfarm.links.kernel.ownership import FarmLock, owner_of, shards_in
from pnfarm.links.macvlan import MacvlanLink
from pnfarm.links.muted import MutedLink
from pnfarm.links.tap import TapLink
from pnfarm.links.veth import VethLink
from pnfarm.station.event_log import EventLog
from pnfarm.user_code.thread import CodeThread

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Mapping, Sequence
    from pathlib import Path
    from types import TracebackType

    from pnfarm.config.links import LineWay
    from pnfarm.drives.description.model import Model
    from pnfarm.faults.manager import Injection, InjectionManager
    from pnfarm.links.base import Link, Port
    from pnfarm.station.event import Event

__all__ = ["Farm", "make_link", "model_of", "realtime_settings"]


def model_of(config: DriveConfig) -> Model:
    """A drive's model with what the farm file changes: parameters, motor, behaviour, faults, words, identity."""
    described = model_by_name(config.model) if config.listed is None else config.listed
    asked = config.motor.kind, config.motor.pitch, *config.behaviour.items()
    # a value of an identity may be a map: its text is the key
    key = id(described), asked, config.faults, repr((config.words, config.identity))
    if key not in _models:
        if len(_models) >= MOST_MODELS:
            _models.clear()
        fitted = with_motor(described, config.motor.kind, config.motor.pitch)
        fitted = with_words(with_faults(with_behaviour(fitted, config.behaviour), config.faults), config.words)
        # described is kept, so that no other one gets its id
        _models[key] = described, with_identity(fitted, config.identity)
    return _models[key][1]


#: What :func:`model_of` found: the drives of a group share a model, and so do farm and controller of one process.
_models: dict[tuple[object, ...], tuple[Model, Model]] = {}
MOST_MODELS = 256


def make_link(
    config: FarmConfig, drives: Sequence[DriveConfig], shard: Shard | None = None, *, captured: bool = False
) -> Link:
    """The link that a farm file requests for these drives, not open yet.

    ``captured``: all frames have to be seen at the drives' ports.

    Raises :class:`ConfigError` for one without interfaces: in memory, a farm makes its own.
    """
    name, section = _owner(config, shard), config.link
    lines = dict(getattr(section, "lines", {}))
    if shard is not None:
        # a line is opened where its drives are
        lines = {line: way for line, way in lines.items() if line in {line_name(config, drive) for drive in drives}}
    match section:
        case MacvlanSection():
            return _with_lines(MacvlanLink(name, section.parent, send="own" if captured else section.send), lines)
        case VethSection():
            return _with_lines(VethLink(name, bridge=section.bridge, own_bridge=section.bridge is None), lines)
        case TapSection():
            return _with_lines(TapLink(name, bridge=section.bridge), lines)
        case SerialSection():
            (line,) = make_lines(line_ways(config)).values()
            return line
        case None:
            raise ConfigError("the file has no link; add for example `link: {kind: macvlan, parent: eth1}`")
        case _:
            raise ConfigError(f"a {section.kind} link has no interfaces; use macvlan, veth or tap")


def _owner(config: FarmConfig, shard: Shard | None) -> str:
    return owner_of(config.farm or "farm", "" if shard is None else str(shard))


def _with_lines(link: Link, ways: Mapping[str, LineWay]) -> Link:
    return JoinedLink(link, make_lines(ways)) if ways else link


def realtime_settings(config: FarmConfig) -> RealTimeSettings:
    """What the engine requests from the kernel, for a farm or a controller."""
    section = config.realtime
    return RealTimeSettings(
        cpu=section.cpu,
        fifo_priority=section.fifo,
        lock_memory=section.mlockall,
        timer_slack_ns=section.timer_slack_ns,
        nice=section.nice,
        timestamps=section.timestamps,
    )


#: What is requested from the kernel, by its first word, and the key of the file that asks for it.
_REALTIME_OPTIONS = {
    "cpu": "cpu", "SCHED_FIFO": "fifo", "nice": "nice", "mlockall": "mlockall", "timer": "timer_slack_ns",
}  # fmt: skip


class Farm:
    """See the module's docstring.  Use as an asynchronous context manager, or ``open`` and ``close``.

    ``shard``: the part of the file's drives that runs here; None for all.
    """

    def __init__(
        self,
        config: FarmConfig,
        *,
        shard: Shard | None = None,
        log: EventLog | None = None,
        link: Link | None = None,
        capture: CaptureSettings | None = None,
    ) -> None:
        self.config = config
        self.log = log or EventLog()
        self._capture_settings = capture
        #: The running or last capture.
        self.capture: FarmCapture | None = None
        #: The farm and its controller in memory; None on a link with interfaces.
        self.world: VirtualWorld | None = None
        if link is None and isinstance(config.link, MemorySection):
            if capture is not None:
                raise ConfigError(
                    "a memory link has no interface to capture from: use a veth link, or run a scenario in virtual "
                    "time (`pnfarm run SCENARIO --virtual --pcap FILE`)"
                )
            self.world = VirtualWorld(time.monotonic_ns())
            link = self.world.link(baud=config.link.baud)
        self.shard = shard
        whole = expand_all(config)
        self._file = places_of(config, whole)
        here = whole if shard is None else part_of(config, whole, shard)
        self.drives = [one for one in here if isinstance(one, DriveConfig)]
        #: Those that are no drives.
        self.devices = [one for one in here if isinstance(one, DeviceConfig)]
        self._stations = here
        self.link = link or make_link(config, self.drives, shard, captured=capture is not None)
        self._lock = _lock(config, shard)
        self._state: FarmState | PostgresState | None = None
        self._leaseholder: Leaseholder | None = None
        self._driver: RealTimeDriver | MemoryDriver | None = None
        self._core: FarmCore | None = None
        self._plant: list[CodeThread] = []
        self.started_ns = 0
        #: Called before the engine starts, with the core.
        self.on_start: list[Callable[[FarmCore], None]] = []
        #: Called with the world of a farm in memory: what joins it beside the drives.
        self.on_world: list[Callable[[VirtualWorld], Awaitable[None]]] = []
        #: Called when the farm has stopped, or could not start.
        self.on_close: list[Callable[[], Awaitable[None]]] = []

    @classmethod
    def from_file(cls, path: str | Path, *, shard: str | None = None, **overrides: Any) -> Self:
        """A farm, or its ``shard`` ``I/N``, from its file; ``overrides`` as in :meth:`FarmConfig.with_overrides`."""
        config = load_farm(path, catalogue(frozenset(fault_kinds())))
        config = config.with_overrides(overrides, origin="argument")
        return cls(config, shard=None if shard is None else parse_shard(shard, "shard"))

    @property
    def core(self) -> FarmCore:
        if self._core is None:
            raise ConfigError("the farm is not running: use it inside `async with`")
        return self._core

    @property
    def states(self) -> SavedStates:
        """The saved states of the running farm, in its `state` folder."""
        return SavedStates(self.core, self.core.states_folder, self.now, self.poke)

    @property
    def driver(self) -> RealTimeDriver | MemoryDriver:
        if self._driver is None:
            raise ConfigError("the farm is not running: use it inside `async with`")
        return self._driver

    def now(self) -> int:
        """The farm's time, ns: the machine's, or that of its world in memory."""
        return self.driver.now()

    def poke(self) -> None:
        """The farm was changed from outside: process the consequences now."""
        self.driver.poke()

    @property
    def injections(self) -> InjectionManager:
        """After a change here, call :meth:`RealTimeDriver.poke`."""
        return self.core.injections

    def inject(self, fields: Mapping[str, Any]) -> Injection:
        """Put an injection in force; ``fields`` as in a scenario's ``fault:`` step.  Raises :class:`ConfigError`."""
        injection = self.injections.inject(fields, self.now())
        self.driver.poke()
        return injection

    def check_rights(self) -> None:
        """Raises :class:`EnvironmentError_` where this process may not do what the farm's link needs."""
        require_for_link(unwrap(self.link).kind, f"farm {self.config.farm or 'farm'}")

    async def open(self) -> None:
        """Make the interfaces, power the drives on, start the engine.  On failure nothing is left behind."""
        if not self.drives and not self.devices:
            raise ConfigError("the farm has neither drives nor devices")
        if self._core is not None:
            raise ConfigError("this farm has run already: make another one of its file")
        raise_file_limit()
        self._lock.acquire()
        try:
            self._make_capture()
            if self.world is None:
                await run_to_completion(make_way, self.config, self.shard)
            else:
                self.world.clock.now = time.monotonic_ns()
            self._state = await self._open_state()
            ports = await self.link.open([self._port_of(one) for one in self._stations])
            if self.capture is not None:
                self.capture.start(ports, far_end=isinstance(unwrap(self.link), TapLink))
                for line in lines_of(self.link).values():
                    line.set_watcher(self.capture.telegram)
            self._core = FarmCore(
                self.config.farm or "farm",
                self.drives,
                model_of,
                self.link,
                ports,
                memory=self._state,
                log=self.log,
                seed=os.urandom(16),
                clock=time.monotonic_ns if self.world is None else self.world.clock,
                lldp=self.config.lldp,
                shard=self.shard,
                devices=self.devices,
                plant=plant_of(self.config, self._stations, model_of),
                in_real_time=self.world is None,
                file=self._file,
                states=states_folder(self.config.state_directory, self.shard),
            )
            for action in self.on_start:
                action(self._core)
            now = await self._make_driver(self._core, ports)
            if self._leaseholder is not None:
                self._leaseholder.start(self._core, self.poke, self.driver.fail)
            add_impairments(self._core.injections, self._stations, now, part=self.shard is not None)
            self._core.start(now)
            await self.driver.start()
            self._start_plant(self._core)
            self.started_ns = now
            self._report(now)
        except BaseException:
            with anyio.CancelScope(shield=True):
                await self.close()
            raise

    def _start_plant(self, core: FarmCore) -> None:
        """Models of the plant in Python have a thread of their own in real time, and FMUs another one."""
        plant = core.plant
        if plant is None or self.world is not None:
            return
        loop = asyncio.get_running_loop()

        def carry(action: Callable[[], object]) -> None:
            with contextlib.suppress(RuntimeError):  # the loop is closed: no task waits for it
                loop.call_soon_threadsafe(action)

        plant.carry = carry
        for models, name in ((plant.python, "pnfarm plant"), (plant.fmus, "pnfarm FMUs")):
            if len(models):
                self._plant.append(CodeThread(models, lambda exc: carry(partial(self.driver.fail, exc)), name))
                self._plant[-1].start()

    async def _open_state(self) -> FarmState | PostgresState:
        """The drives' memory; in a database it is shared, and every drive is claimed there before it is made."""
        url = self.config.state_database
        if url is None:
            return FarmState(self.config.state_directory)
        state = PostgresState(
            url,
            self.config.farm or "farm",
            [one.name for one in self._stations],
            lease=Lease(self.config.lease.ttl_ns),
            shard="" if self.shard is None else str(self.shard),
        )
        self._state = state
        holder = self._leaseholder = Leaseholder(state, self.log, time.monotonic_ns)
        await run_to_completion(state.start)
        await holder.wait()
        if self.world is None:
            self.link = MutedLink(self.link, state.may_speak)
        return state

    @staticmethod
    def _port_of(one: DriveConfig | DeviceConfig) -> PortSpec:
        its = bus(one.bus if isinstance(one, DeviceConfig) else model_by_name(one.model).bus)
        return port_spec(its, one.name, one.mac)

    async def _make_driver(self, core: FarmCore, ports: Sequence[Port]) -> int:
        """What lets time pass; returns the farm's time at its start."""
        if self.world is None:
            settings = realtime_settings(self.config)
            self._driver = RealTimeDriver(core, settings, lateness=core.lateness, demoted=self._demoted)
            return time.monotonic_ns()
        self.world.join(core, ports)
        for join in self.on_world:
            await join(self.world)
        self._driver = MemoryDriver(self.world)
        return self.world.now

    def _make_capture(self) -> None:
        """Called before any interface is made, so that an unwritable file is reported before the drives send."""
        if self._capture_settings is None:
            return
        loop = asyncio.get_running_loop()

        def note(event: Event) -> None:
            def record() -> None:
                self.log.record(time.monotonic_ns(), "", event)

            with contextlib.suppress(RuntimeError):  # the loop is closed: there is no log to write to
                loop.call_soon_threadsafe(record)

        names = [one.name for one in self._stations]
        self.capture = FarmCapture(self._capture_settings, self.config.farm or "farm", names, note)

    def _report(self, now: int) -> None:
        engine = self.driver.engine
        granted = engine.report.granted if engine else []
        refused = engine.report.refused if engine else {}
        self.log.record(now, "", FarmStarted(len(self.drives), self.link.kind, tuple(granted)))
        for note in self.config.notes:
            self.log.record(now, "", FarmFileNote(note))
        for link in lines_of(self.link).values():
            self.log.record(now, "", LineReady(link.line.kind, link.line.where, link.baud))
            link.line.set_news(self._line_news)
            link.set_withheld_news(self._answers_withheld)
        if self.capture is not None:
            self.log.record(now, "", CaptureStarted(str(self.capture.path)))
        asked = self.config.realtime.model_fields_set
        for what, why in refused.items():
            option = _REALTIME_OPTIONS.get(what.partition(" ")[0])
            self.log.record(now, "", RealTimeOptionRefused(what, why, asked=option in asked))

    def _demoted(self, what: str, why: str) -> None:
        self.log.record(self.now(), "", RealTimeOptionTakenBack(what, why))

    def _answers_withheld(self, where: str, count: int, latest_ns: int) -> None:
        self.log.record(self.now(), "", AnswersWithheld(where, count, latest_ns / 1e9))

    def _line_news(self, up: bool, text: str) -> None:
        self.log.record(self.now(), "", LineOpened(text) if up else LineInterrupted(text))

    async def close(self) -> None:
        """Stop, notify the controllers, and remove every interface that the farm created."""
        # the last one first; each of these is done, whatever the others raise
        async with contextlib.AsyncExitStack() as stack:
            stack.push_async_callback(self._release)
            stack.push_async_callback(self.link.close)
            if self.capture is not None:
                stack.push_async_callback(asyncio.to_thread, self.capture.stop)
            if self._core is not None and self._core.plant is not None:
                # in memory its models step with the farm, until the driver is closed
                stack.push_async_callback(asyncio.to_thread, self._core.plant.close)
            for action in self.on_close:
                stack.push_async_callback(action)
            if self._driver is not None:
                stack.push_async_callback(self._driver.close)
            for models in self._plant:
                stack.push_async_callback(asyncio.to_thread, models.close)
            if self._core is not None and self._driver is not None:
                now = self.now()
                self._core.stop(now)
                self.log.record(now, "", FarmStopped())

    async def _release(self) -> None:
        """After the interfaces are gone: others may have the drives."""
        if self._leaseholder is not None:
            self._leaseholder.stop()
        if self._state is not None:
            await asyncio.to_thread(self._state.close)
            self._state = None
        self._lock.release()
        self._driver = None

    async def wait(self) -> None:
        """Wait until something fails; raises its exception."""
        await self.driver.wait()

    async def __aenter__(self) -> Self:
        await self.open()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, exc: BaseException | None, trace: TracebackType | None
    ) -> None:
        with anyio.CancelScope(shield=True):
            await self.close()


def _lock(config: FarmConfig, shard: Shard | None) -> FarmLock:
    return FarmLock(config.farm or "farm", config.state_directory, shard="" if shard is None else str(shard))


def make_way(config: FarmConfig, shard: Shard | None) -> None:
    """Remove what killed runs left that had drives of this one: of itself, of the whole farm, of other divisions.

    With the lock of this one held, none of these runs.
    """
    farm, lock = config.farm or "farm", _lock(config, shard)
    with Interfaces() as interfaces:
        shards = shards_in(farm, [facts.alias for facts in interfaces.everything()])
        others = [owner_of(farm, one) for one in ("", *shards) if lock.excludes(one)]
        for owner in dict.fromkeys([_owner(config, shard), *others]):
            interfaces.remove(owner)


def remove_farm(config: FarmConfig, shard: Shard | None = None) -> list[str]:
    """Remove what killed runs of this farm left, or of one shard; returns the names of the removed interfaces.

    Without ``shard`` that is what the whole farm and every shard left that does not run.
    Raises :class:`EnvironmentError_` when the farm, or the named shard, is running.
    """
    farm = config.farm or "farm"
    if shard is not None:
        with _lock(config, shard):
            return remove_leftovers_now(_owner(config, shard))
    removed: list[str] = []
    with Interfaces() as interfaces:
        shards = shards_in(farm, [facts.alias for facts in interfaces.everything()])
    running: EnvironmentError_ | None = None
    for text in shards:
        lock = FarmLock(farm, config.state_directory, shard=text)
        try:
            lock.acquire()
        except EnvironmentError_ as exc:
            running = exc
            continue
        with lock:
            removed += remove_leftovers_now(owner_of(farm, text))
    try:
        with _lock(config, None):
            return removed + remove_leftovers_now(farm)
    except EnvironmentError_:
        if running is None:
            raise
        # a shard that runs has removed what the whole farm left
        return removed
