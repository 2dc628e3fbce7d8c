"""A farm and its controller in memory, in virtual time."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TypeVar

from pnfarm.buses.registry import bus, fault_kinds
from pnfarm.config.known import catalogue
from pnfarm.controller.line import VirtualLine
from pnfarm.controller.moment import Moment
from pnfarm.drives.parameters.memory import VolatileMemory
from pnfarm.errors import ConfigError
from pnfarm.farm.file.reading import load_farm, parse_farm
from pnfarm.farm.injection_fields import fields_of
from pnfarm.farm.injections import add_impairments
from pnfarm.farm.wait import NotInTime
from pnfarm.library.face import first_drives
from pnfarm.library.plant import PlantReadings
from pnfarm.links.memory import at_once
from pnfarm.station.event_log import EventLog
from pnfarm.testing.device import Device
from pnfarm.testing.drive import Drive
from pnfarm.testing.face import BlockingFace
from pnfarm.testing.fault import Fault

if TYPE_CHECKING:
    from collections.abc import Callable, Coroutine, Mapping

    from pnfarm.controller.axis_program import AxisProgram
    from pnfarm.farm.core import FarmCore
    from pnfarm.farm.file.reading import FarmConfig
    from pnfarm.station.axis import Axis
    from pnfarm.station.event_log import LogEntry

__all__ = ["Line"]

_T = TypeVar("_T")
#: Stands for the file of a program that is given as a class.
_IN_MEMORY = "(in memory)"

RIGHT = {"kind": "constant", "speed_rpm": 60, "acknowledge_after": "200ms"}


class Line(BlockingFace[Drive]):
    """Drives by name, or a farm file (:meth:`from_file`, :meth:`from_text`); use it in a ``with`` statement.

    ``options`` are keys of every drive (``telegram=111``, ``load={"inertia": 1e-4}``).  ``cycle`` is the controller's;
    left out, the usual one of the model.  ``program`` is what the controller does: a mapping as in the farm file, the
    path of a Python file, or a class derived from :class:`pnfarm.AxisProgram`; None for a line without controller.
    """

    def __init__(
        self,
        *names: str,
        model: str = "akd-profinet",
        cycle: str | None = None,
        program: Mapping[str, Any] | str | Path | type[AxisProgram] | None = RIGHT,
        controller: Mapping[str, Any] | None = None,
        **options: Any,
    ) -> None:
        known = catalogue(frozenset(fault_kinds()))
        facts = known.model(model)
        # a drive on a line has the number of its station instead, and its controller its own
        by_ip = facts is None or "ip" in bus(facts.bus).farm_file.drives.model_fields
        drives = [
            {"name": name, "model": model}
            | ({"ip": f"10.77.{n >> 8}.{n & 255}/16"} if by_ip else {"address": n})
            | options
            for n, name in enumerate(names or ("axis-01",), 11)
        ]
        kind = program if isinstance(program, type) else None
        text: dict[str, Any] = {"farm": "test", "link": {"kind": "memory"}, "drives": drives}
        if program is not None:
            given: Mapping[str, Any]
            if isinstance(program, type):
                given = {"python": _IN_MEMORY}
            elif isinstance(program, (str, Path)):
                given = {"python": str(Path(program).absolute())}
            else:
                given = program
            place = {"ip": "10.77.255.250/16"} if by_ip else {}
            text["controller"] = {**place, "program": dict(given), **(controller or {})}
            if cycle is not None:
                text["controller"]["cycle"] = cycle
        # JSON is YAML
        self._make(parse_farm(json.dumps(text), known=known), kind)

    @classmethod
    def from_file(cls, path: str | Path) -> Self:
        """The drives and the controller of a farm file, whatever its link.  Raises :class:`ConfigError`."""
        return cls._of(load_farm(path, catalogue(frozenset(fault_kinds()))))

    @classmethod
    def from_text(cls, text: str) -> Self:
        """As :meth:`from_file`, from the file's text."""
        return cls._of(parse_farm(text, known=catalogue(frozenset(fault_kinds()))))

    @classmethod
    def _of(cls, config: FarmConfig) -> Self:
        line = cls.__new__(cls)
        line._make(config, None)
        return line

    def _make(self, config: FarmConfig, program: type[AxisProgram] | None) -> None:
        self.config = config
        self._is_open = False
        self._line = _wait(
            VirtualLine.create(
                config,
                memory=VolatileMemory(),
                log=EventLog(quiet=True),
                plc_log=(plc_log := EventLog(quiet=True)),
                program=program,
            )
        )
        self._is_open = True
        self._plc_log = plc_log
        self._began_ns = self._line.world.now
        self._drives = {s.configured_name: Drive(self, s) for s in self.core.axes}
        add_impairments(self.core.injections, self._line.stations, self.now_ns)

    # -- time

    @property
    def now(self) -> float:
        """Virtual seconds since the start."""
        return (self._line.world.now - self._began_ns) / 1e9

    @property
    def now_ns(self) -> int:
        """The drives' clock, ns."""
        return self._line.world.now

    def run(self, seconds: float) -> None:
        """Let time pass."""
        self._check_open()
        self._line.world.run(seconds)

    def wait_until(
        self, condition: Callable[[], object], within: float, *, every: float = 0.001, what: str = "the condition"
    ) -> float:
        """Let time pass until the condition holds; returns how long that took, in seconds.

        It is checked after each event and ``every`` so many seconds.  Raises :class:`NotInTime`.
        """
        self._check_open()
        if within < 0 or every <= 0:
            raise ValueError(f"within={within}, every={every}: times are above 0")
        begun = self._line.world.now
        if self._line.world.run(within, until=lambda: bool(condition()), look_ns=max(1, round(every * 1e9))):
            return (self._line.world.now - begun) / 1e9
        raise NotInTime(f"{what} did not hold within {within:g} s (t = {self.now:.3f} s): {first_drives(self.drives)}")

    def wait_connected(self, within: float = 20.0) -> float:
        """Until every drive exchanges data with the controller."""
        return self.wait_until(lambda: self._line.controllers.all_connected, within, what="a connection of every drive")

    def wait_running(self, within: float = 20.0) -> float:
        """Until every drive is in operation (S4)."""
        return self.wait_until(
            lambda: all(d.state == "S4" for d in self._drives.values()), within, what="operation of every drive"
        )

    # -- back to a moment

    def save(self) -> Moment:
        """This moment of the whole line: drives, devices, plant, faults, controllers with their programs, the time.

        Its ``left_out`` are the kinds of objects of one's own programs and models that it cannot save.  Raises
        :class:`ConfigError` for a plant with FMUs, which are processes of their own.
        """
        self._check_open()
        if self.core.plant is not None and (fmus := self.core.plant.fmu_names):
            raise ConfigError(f"a line with FMUs cannot go back to a moment: {', '.join(fmus[:8])} cannot")
        return Moment(self._line)

    def restore(self, moment: Moment) -> None:
        """Back to a moment of this line, also in time: what follows is what followed then.

        Raises :class:`ConfigError` for one of another line.
        """
        self._check_open()
        if not moment.is_of(self._line):
            raise ConfigError("this moment is of another line: a line goes back to its own only")
        moment.restore()

    # -- drives

    @property
    def drives(self) -> list[Drive]:
        return list(self._drives.values())

    def drive(self, name: str) -> Drive:
        """Raises :class:`ConfigError` for an unknown name."""
        if name not in self._drives:
            raise ConfigError(f"the line has no drive {name!r}; it has {', '.join(self._drives)}")
        return self._drives[name]

    @property
    def devices(self) -> list[Device]:
        return [Device(self, station) for station in self.core.stations if not station.axes]

    def device(self, name: str) -> Device:
        """A device by its name.  Raises :class:`ConfigError`."""
        return Device(self, self.core.device(name))

    @property
    def plant(self) -> PlantReadings:
        """The models behind the stations: ``line.plant.gripper.extended``; raises :class:`ConfigError` without."""
        return PlantReadings(self.core)

    # -- faults

    def inject(self, kind: str, on: str | list[str] = "all", **options: Any) -> Fault:
        """Inject a fault: ``inject("loss", on="axis-*", probability=0.1)``, ``inject("drive-fault", fault=702)``.

        ``options`` are the common fields (``count``, ``for_`` and ``after`` in seconds, ``probability``, ``seed``,
        ``direction``, ``cycles``, ``after_cycles``) and the parameters of the kind (``pnfarm fault kinds``).
        The result ends the injection at the end of a ``with`` statement.  Raises :class:`ConfigError`.
        """
        self._check_open()
        manager = self.core.injections
        injection = manager.inject(fields_of(kind, on, options), self.now_ns)

        def clear(wanted: str) -> None:
            # the line may have gone back to a moment before it
            if any(one is injection for one in manager.list()):
                manager.clear(wanted, self.now_ns)

        return Fault(injection, clear)

    def reset(self) -> None:
        """End every injection."""
        self.core.injections.clear(None, self.now_ns)

    def events(self, text: str | None = None) -> list[LogEntry]:
        """What happened to all drives, oldest first; ``text`` as in :meth:`Drive.events`."""
        found = self.core.log.entries()
        return found if text is None else [entry for entry in found if entry.event == text]

    # -- the controller

    def program(self, name: str) -> AxisProgram:
        """The object of an axis of a program of one's own: its ``inputs``, ``outputs`` and attributes."""
        runner = self._line.programs
        if runner is None:
            raise ConfigError("the controller of this line has no program in Python")
        return runner.program(name)

    def controller(self, name: str) -> dict[str, Any]:
        """The controller's view of a drive, as a row of ``pnfarm plc --json``."""
        for row in self._line.joined.summary():
            if row["name"] == name:
                return row
        raise ConfigError(f"the controller has no drive {name!r}")

    def controller_events(self) -> list[LogEntry]:
        """What the controller has logged, oldest first."""
        return self._plc_log.entries()

    # -- its end

    @property
    def core(self) -> FarmCore:
        """The farm itself, for what this class does not offer; not part of the public interface."""
        return self._line.farm

    def changed(self, station: Axis) -> None:
        """A test changed this drive: let it process the consequences."""
        self.core.settle(station.station, self.now_ns)
        self.core.injections.touch(station.configured_name)

    def close(self) -> None:
        """End the threads of a program in Python; closing twice does nothing."""
        if self._is_open:
            self._is_open = False
            _wait(self._line.close())

    def _check_open(self) -> None:
        if not self._is_open:
            raise ConfigError("the line is closed")

    def __repr__(self) -> str:
        return f"<Line t = {self.now:.3f} s: {first_drives(self.drives)}>"


def _wait(work: Coroutine[Any, Any, _T]) -> _T:
    return at_once(work, ConfigError("a line in memory needs nothing to wait for"))
