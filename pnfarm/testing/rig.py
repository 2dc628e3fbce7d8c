"""A farm in real time for plain test functions: on the link of its file, or one that runs already.

The farm lives in a thread with an event loop of its own; every call waits for its result.  The names are those of
:class:`pnfarm.testing.Line`, so that a test may run against either.
"""

from __future__ import annotations

import asyncio
import threading
import time
from operator import attrgetter
from typing import TYPE_CHECKING, Any, TypeVar

from pnfarm.errors import ConfigError
from pnfarm.farm.wait import NotInTime, require_in_time
from pnfarm.library import Farm, RemoteFarm
from pnfarm.library.arguments import duration_ns
from pnfarm.library.reading import Reading
from pnfarm.testing.face import BlockingFace
from pnfarm.testing.fault import BlockingFault
from pnfarm.testing.rig_device import RigDevice

if TYPE_CHECKING:
    from collections.abc import Callable, Coroutine, Mapping, Sequence
    from pathlib import Path

    from pnfarm.drives.telegrams.signal_view import Word
    from pnfarm.farm.views.readings import FaultReading
    from pnfarm.library import Drive, FarmEvent, FaultHandle, Metrics, RemoteDrive, ScenarioResult
    from pnfarm.library.fault import FaultView

__all__ = ["Rig", "RigDrive", "RigFault"]

_T = TypeVar("_T")


async def _cleaned_up() -> None:
    """Until what was cancelled has ended: the end of the loop would cancel it once more, while it cleans up."""
    if cancelled := [task for task in asyncio.all_tasks() if task.cancelling()]:
        await asyncio.wait(cancelled)


class Rig(BlockingFace["RigDrive"]):
    """``where``: a farm file, or the URL of a running farm's API.  Use it in a ``with`` statement.

    Raises the errors of :mod:`pnfarm.errors`.
    """

    def __init__(self, where: str | Path, *, token: str | None = None, tls_ca: str | Path | None = None) -> None:
        self.where = str(where)
        self._farm: Farm | RemoteFarm
        is_remote = "://" in self.where
        self._farm = Farm.connect(self.where, token=token, tls_ca=tls_ca) if is_remote else Farm.from_file(where)
        self._runner: asyncio.Runner | None = None
        self._thread: threading.Thread | None = None

    def open(self) -> None:
        """Start the farm, or connect to it; on failure nothing is left behind."""
        if self._runner is not None:
            raise ConfigError("the rig runs already")
        self._runner = asyncio.Runner(loop_factory=asyncio.new_event_loop)
        self._thread = threading.Thread(target=self._runner.get_loop().run_forever, name="pnfarm-rig", daemon=True)
        self._thread.start()
        try:
            self.call(self._farm.open())
        except BaseException:
            self._end_loop()
            raise

    def close(self) -> None:
        """Clear what was injected, and stop the farm, or disconnect.  Closing twice does nothing."""
        if self._runner is not None:
            try:
                self.call(self._farm.close())
            finally:
                self._end_loop()

    def _end_loop(self) -> None:
        runner, thread, self._runner, self._thread = self._runner, self._thread, None, None
        if runner is not None and thread is not None:
            loop = runner.get_loop()
            loop.call_soon_threadsafe(loop.stop)
            thread.join()
            runner.close()

    def call(self, work: Coroutine[Any, Any, _T]) -> _T:
        """Carry out a coroutine of :attr:`farm` in the rig's thread; Ctrl-C cancels it."""
        if self._runner is None:
            work.close()
            raise ConfigError("the rig is not running: use it in a `with` statement")
        loop = self._runner.get_loop()
        future = asyncio.run_coroutine_threadsafe(work, loop)
        try:
            return future.result()
        except BaseException:
            if future.cancel():
                asyncio.run_coroutine_threadsafe(_cleaned_up(), loop).result()
            raise

    @property
    def farm(self) -> Farm | RemoteFarm:
        """The asynchronous farm."""
        return self._farm

    # -- drives and time

    @property
    def drives(self) -> list[RigDrive]:
        """Every drive, in the farm's order."""
        return [RigDrive(self, drive) for drive in self._farm.drives]

    def drive(self, name: str) -> RigDrive:
        return RigDrive(self, self._farm.drive(name))

    @property
    def devices(self) -> list[RigDevice]:
        """Every device, in the farm's order."""
        return [RigDevice(self.call, device) for device in self._farm.devices]

    def device(self, name: str) -> RigDevice:
        """A device by its name.  Raises :class:`ConfigError`."""
        return RigDevice(self.call, self._farm.device(name))

    def run(self, seconds: float) -> None:
        """Let time pass."""
        self.call(self._farm.run(seconds))

    def wait_until(self, condition: Callable[[], object], within: float, *, what: str = "the condition") -> float:
        """Until ``condition()`` is true; how long it took, s.  Raises :class:`pnfarm.NotInTime`.

        It is called in the test's own thread, each millisecond.
        """
        within_ns, began = duration_ns(within, "within"), time.monotonic_ns()
        while not condition():
            if time.monotonic_ns() - began >= within_ns:
                raise NotInTime(f"{what} did not hold within {within:g} s: {self._farm!r}")
            self.run(0.001)
        return require_in_time(what, time.monotonic_ns() - began, within_ns)

    def wait_connected(self, within: float = 20.0) -> float:
        """Until every drive and every device exchanges data with its controller."""
        return self.call(self._farm.wait_connected(within))

    def wait_running(self, within: float = 20.0) -> float:
        """Until every drive is in operation (S4)."""
        return self.call(self._farm.wait_running(within))

    # -- faults, scenarios, what happened

    def inject(self, kind: str, on: str | Sequence[str] = "all", **options: Any) -> RigFault:
        """Inject a fault: as :meth:`pnfarm.testing.Line.inject`; ends with its ``with`` statement."""
        return RigFault(self, self.call(_begun(self._farm.fault(kind, on, **options))))

    def reset(self) -> list[str]:
        """End every injected fault; the ids of those that ended."""
        return self.call(self._farm.reset())

    def run_scenario(self, path: str | Path) -> ScenarioResult:
        """Run a scenario on the farm; ``.check()`` of the result raises for one that did not pass."""
        return self.call(self._farm.run_scenario(path))

    def metrics(self) -> Metrics:
        """Every metric as it is now."""
        return self.call(self._farm.metrics())

    def events(self, drive: str | None = None) -> list[FarmEvent]:
        """What happened, oldest first, of one drive or all."""

        async def kept() -> list[FarmEvent]:
            return [event async for event in self._farm.events(drive, follow=False)]

        return self.call(kept())

    def __repr__(self) -> str:
        return f"<Rig {self.where}: {self._farm!r}>"


async def _begun(handle: FaultHandle) -> FaultHandle:
    return await handle


class RigFault(BlockingFault):
    """An injection in force: a context manager that ends it, with its evidence."""

    def __init__(self, rig: Rig, handle: FaultHandle) -> None:
        self._rig = rig
        self._handle = handle

    @property
    def _known(self) -> FaultView:
        return self._handle.view

    def _look(self) -> FaultView:
        return self._rig.call(self._handle.refresh()).view

    def clear(self) -> None:
        self._rig.call(self._handle.clear())

    def __repr__(self) -> str:
        return repr(self._handle)


class RigDrive:
    """A drive of a rig: every reading asks the farm.  Speeds are rpm, currents A, torques N m."""

    def __init__(self, rig: Rig, drive: Drive | RemoteDrive) -> None:
        self._rig = rig
        self._drive = drive

    def read(self, reading: Callable[[Drive | RemoteDrive], _T]) -> _T:
        """A reading of the drive as it is now."""

        async def read() -> _T:
            # in the rig's thread, where the farm changes
            return reading(await self._drive.refresh())

        return self._rig.call(read())

    @property
    def name(self) -> str:
        return self._drive.name

    @property
    def model(self) -> str:
        return self._drive.model

    def snapshot(self) -> Mapping[str, Any]:
        """Everything at once, as ``GET drives/{name}`` gives it."""
        return self.read(lambda drive: drive.snapshot())

    state: Reading[str] = Reading(attrgetter("state"))
    connected: Reading[bool] = Reading(attrgetter("connected"))
    faults: Reading[list[FaultReading]] = Reading(attrgetter("faults"))
    #: Equals its number (702, ``"32-1"``), code or name.
    fault: Reading[FaultReading | None] = Reading(attrgetter("active_fault"))
    last_fault: Reading[FaultReading | None] = Reading(attrgetter("last_fault"))
    warning: Reading[FaultReading | None] = Reading(attrgetter("warning"))
    stw1: Reading[Word] = Reading(attrgetter("stw1"))
    zsw1: Reading[Word] = Reading(attrgetter("zsw1"))
    setpoint: Reading[float] = Reading(attrgetter("setpoint"))
    velocity: Reading[float] = Reading(attrgetter("velocity"))
    position: Reading[float] = Reading(attrgetter("position"))
    current: Reading[float] = Reading(attrgetter("current"))
    torque: Reading[float] = Reading(attrgetter("torque"))
    following_error: Reading[float] = Reading(attrgetter("following_error"))

    def wait_for(self, condition: str, within: float | str) -> float:
        """Until a condition holds, as scenarios write it; what lasted only a moment counts.  How long it took, s."""
        return self._rig.call(self._drive.wait_for(condition, within))

    def inject(self, kind: str, **options: Any) -> RigFault:
        """Inject a fault: as :meth:`Rig.inject`, on this drive."""
        return self._rig.inject(kind, self.name, **options)

    def parameter(self, name: str | int) -> int:
        """A parameter by number or by the manual's name: the number as on the wire."""
        return self._rig.call(self._drive.parameter(name))

    def set_parameter(self, name: str | int, value: int) -> None:
        """Write a parameter; raises the drive's own error, which says what is allowed."""
        self._rig.call(self._drive.set_parameter(name, value))

    def power_cycle(self) -> None:
        """Off and on."""
        self._rig.call(self._drive.power_cycle())

    def events(self) -> list[FarmEvent]:
        """What happened to it, oldest first."""
        return self._rig.events(self.name)

    def __repr__(self) -> str:
        return repr(self._drive)
