"""A farm for asynchronous code: in real time on the link of its file, or in memory in virtual time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Self

import anyio

from pnfarm.buses.registry import fault_kinds
from pnfarm.config.known import catalogue
from pnfarm.errors import ConfigError
from pnfarm.farm.file.reading import load_farm, parse_farm
from pnfarm.farm.injection_fields import fields_of
from pnfarm.farm.shard import parse_shard
from pnfarm.farm.tracing import FarmTrace, trace_fields
from pnfarm.farm.wait import NotInTime, require_in_time
from pnfarm.library.arguments import duration_ns
from pnfarm.library.device import Device
from pnfarm.library.drive import Drive
from pnfarm.library.events import FarmEvent
from pnfarm.library.face import FarmFace, first_drives
from pnfarm.library.fault import Bound, FaultHandle, FaultView
from pnfarm.library.metrics import Metrics
from pnfarm.library.plant import PlantReadings
from pnfarm.library.remote import RemoteFarm
from pnfarm.library.result import ScenarioResult
from pnfarm.library.runner import RealTimeRunner, VirtualTimeRunner
from pnfarm.scenario.definition.binding import bind_scenario
from pnfarm.scenario.definition.file import load_scenario

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Callable, Mapping, Sequence
    from pathlib import Path

    from pnfarm.controller.axis_program import AxisProgram
    from pnfarm.farm.core import FarmCore
    from pnfarm.farm.file.reading import FarmConfig
    from pnfarm.farm.shard import Shard
    from pnfarm.faults.manager import Injection, InjectionManager
    from pnfarm.library.runner import FarmRunner
    from pnfarm.trace import Recording

__all__ = ["Farm"]

#: The longest wait for the next event of a farm in virtual time, between two checks of whether its reader goes on.
EVENT_STRETCH_NS = 3_600_000_000_000


class Farm(FarmFace[Drive, Device]):
    """``async with`` starts it and stops it, also after an exception or a cancellation.

    On a link with interfaces the controller is the one on the wire: a PLC, or :class:`pnfarm.Plc` beside it.  On a
    memory link the file's controller runs with the farm.  ``virtual``: in memory whatever the link, and time passes
    only while something is awaited of the farm; an hour takes seconds.

    Errors are those of :mod:`pnfarm.errors`, with the sentences of the command line.
    """

    def __init__(self, config: FarmConfig, *, virtual: bool = False, shard: Shard | None = None) -> None:
        super().__init__()
        self.config = config
        self._passing: FarmRunner = VirtualTimeRunner(config, shard) if virtual else RealTimeRunner(config, shard)
        self._began_ns = 0

    @classmethod
    def from_file(cls, path: str | Path, *, virtual: bool = False, shard: str | None = None, **overrides: Any) -> Self:
        """A farm from its file; ``overrides`` set keys of the file.  Raises :class:`ConfigError`.

        ``shard``: ``"1/3"`` for the first of three parts of its drives, as ``pnfarm up --shard``.
        """
        config = load_farm(path, catalogue(frozenset(fault_kinds())))
        return cls(config.with_overrides(overrides, origin="argument"), virtual=virtual, shard=_shard(shard))

    @classmethod
    def from_text(cls, text: str, *, virtual: bool = False, shard: str | None = None) -> Self:
        """As :meth:`from_file`, from the file's text."""
        config = parse_farm(text, known=catalogue(frozenset(fault_kinds())))
        return cls(config, virtual=virtual, shard=_shard(shard))

    @staticmethod
    def connect(url: str, *, token: str | None = None, tls_ca: str | Path | None = None) -> RemoteFarm:
        """A farm that runs already, by its API: ``Farm.connect("http://127.0.0.1:8702")``.

        ``tls_ca``: the file of the authority of a farm at https; left out, the one that PNFARM_TLS_CA names, or the
        system's.  Raises :class:`ConfigError`.
        """
        return RemoteFarm(url, token=token, tls_ca=tls_ca)

    # -- start and end

    async def open(self) -> None:
        """Start it; on failure nothing is left behind.  Raises :class:`~pnfarm.errors.EnvironmentError_`."""
        await self._passing.open()
        self._began_ns = self._passing.now()
        self._drives = {s.configured_name: Drive(self.fault, self._passing, s) for s in self.core.axes}
        self._devices = {s.configured_name: Device(self._passing, s) for s in self.core.stations if not s.axes}

    async def close(self) -> None:
        """End every fault, stop the drives, and remove every interface that the farm made.  Twice does nothing."""
        self._drives, self._devices = {}, {}
        with anyio.CancelScope(shield=True):
            await self._passing.close()

    # -- drives and time

    def drive(self, name: str) -> Drive:
        """A drive by its name in the file, or the one that DCP gave it.  Raises :class:`ConfigError`."""
        return self._drives[self.core.axis(name).configured_name]

    def device(self, name: str) -> Device:
        """A device by its name, as :meth:`drive`."""
        return self._devices[self.core.device(name).configured_name]

    @property
    def plant(self) -> PlantReadings:
        """The models behind the stations: ``farm.plant.gripper.extended``; raises :class:`ConfigError` without."""
        return PlantReadings(self.core)

    @property
    def now(self) -> float:
        """Seconds since the start, by the farm's clock."""
        return (self._passing.now() - self._began_ns) / 1e9

    async def run(self, seconds: float | str) -> None:
        """Let time pass."""
        await self._passing.wait(lambda: False, duration_ns(seconds, "seconds"), polled=False)

    async def wait_until(self, holds: Callable[[], object], within: float | str, *, what: str = "it") -> float:
        """Until ``holds()`` is true, checked each millisecond; how long it took, s.  Raises :class:`NotInTime`."""
        within_ns, began = duration_ns(within, "within"), self._passing.now()
        if not await self._passing.wait(lambda: bool(holds()), within_ns):
            raise NotInTime(f"{what} did not hold within {within_ns / 1e9:g} s: {first_drives(self.drives)}")
        return require_in_time(what, self._passing.now() - began, within_ns)

    # -- faults, traces, scenarios

    def fault(self, kind: str, on: str | Sequence[str] = "all", **options: Any) -> FaultHandle:
        """Inject a fault: ``await farm.fault("loss", on="axis-*", probability=0.1)``, or with ``async with``.

        ``options`` are the common fields (``count``, ``cycles``, ``for_``, ``after``, ``ttl`` in seconds,
        ``probability``, ``seed``, ``direction``, ``share`` ...) and the parameters of the kind (``pnfarm fault
        kinds``).  Raises :class:`ConfigError` when it is awaited.
        """

        async def begin() -> _LocalFault:
            found = self._injections.inject(fields_of(kind, on, options), self._passing.now())
            self._passing.poke()
            return _LocalFault(self._passing, found)

        return FaultHandle(begin)

    async def reset(self) -> list[str]:
        """End every injected fault; the ids of those that ended."""
        ended = self._injections.clear(None, self._passing.now())
        self._passing.poke()
        return [injection.id for injection in ended]

    def trace(self, on: str | Sequence[str], signals: Sequence[str] | str, **fields: Any) -> FarmTrace:
        """Record signals of drives and devices around a trigger; use it with ``async with`` (docs/trace.md).

        ``fields`` are the others of a trace: ``trigger="fault 702", pre="200ms", length="2s"``.
        """
        return _Trace(self._passing, trace_fields(on, signals, fields))

    async def run_scenario(self, path: str | Path) -> ScenarioResult:
        """Run a scenario on this farm (its ``farm:`` is ignored).  Raises :class:`ConfigError` before it begins.

        A cancellation ends it, and its faults.
        """
        scenario = load_scenario(path)
        if scenario.overrides:
            raise ConfigError(f"{path}: with: sets keys of a farm file, and this farm runs already; leave it out")
        models = {station.configured_name: station.model for station in self.core.axes}
        kinds = {name: device.kinds for name, device in self.core.signal_owners.items()}
        binding = bind_scenario(scenario, models, fault_kinds(), self.core.signals(), kinds)
        return ScenarioResult(await self._passing.carry_out(binding))

    # -- what happened

    async def events(self, drive: str | None = None, *, follow: bool = True) -> AsyncIterator[FarmEvent]:
        """What happened since the start, oldest first (of the last 4,096 entries), then new entries as they come.

        ``drive``: of this drive only.  Without ``follow`` it ends with the newest entry.
        """
        wanted = None if drive is None else self.drive(drive).name
        log, last = self._passing.log, 0
        while True:
            entries = log.entries(after=last)
            for entry in entries:
                last = entry.sequence
                if wanted in {None, entry.drive}:
                    yield FarmEvent.of(entry.as_dict())
            if log.newest > last:
                continue
            if not follow:
                return
            seen = last
            await self._passing.wait(lambda seen=seen: log.newest > seen, EVENT_STRETCH_NS, polled=False)  # type: ignore[misc]  # mypy does not type the default

    async def metrics(self) -> Metrics:
        """Every metric as it is now."""
        self._passing.now()
        return Metrics(self._passing.collector.gather().metrics())

    def controller(self, name: str) -> Mapping[str, Any]:
        """The built-in controller's view of a drive.  Raises :class:`ConfigError` where it is not in this process."""
        for row in self._passing.controller_rows():
            if row["name"] == name:
                return row
        raise ConfigError(f"the controller has no drive {name!r}")

    def program(self, name: str) -> AxisProgram:
        """The object of an axis of a controller's program in Python (docs/plc-programs.md)."""
        return self._passing.program(name)

    @property
    def core(self) -> FarmCore:
        """The farm itself, for what this class does not offer; not part of the public interface."""
        return self._passing.core

    @property
    def _injections(self) -> InjectionManager:
        return self._passing.core.injections

    def __repr__(self) -> str:
        return f"<Farm {self.config.farm or 'farm'}: {first_drives(self.drives) or 'not running'}>"


class _LocalFault(Bound):
    def __init__(self, passing: FarmRunner, injection: Injection) -> None:
        self._passing = passing
        self._injection = injection

    @property
    def view(self) -> FaultView:
        return FaultView.of(self._injection)

    async def clear(self) -> None:
        if self.view.state != "ended":
            self._passing.core.injections.clear(self._injection.id, self._passing.now())
            self._passing.poke()


class _Trace(FarmTrace):
    """In virtual time, time passes while its end is awaited."""

    def __init__(self, passing: FarmRunner, fields: Mapping[str, Any]) -> None:
        super().__init__(passing, fields)
        self._passing = passing

    async def complete(self, within: float | None = None) -> Recording:
        """Wait for the last sample; raises :class:`NotInTime` if it has not come ``within`` so many seconds."""
        trace = self.trace
        within_ns = EVENT_STRETCH_NS if within is None else duration_ns(within, "within")
        if not await self._passing.wait(lambda: trace.complete, within_ns):
            what = f"trace {trace.id} is {trace.state} after {within_ns / 1e9:g} s"
            raise NotInTime(f"{what} (trigger: {trace.request.trigger.text})")
        return trace.recording()


def _shard(text: str | None) -> Shard | None:
    return None if text is None else parse_shard(text, "shard")
