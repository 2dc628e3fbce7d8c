"""A farm of drives of one model and the built-in controller in one virtual world, from the text of a farm file."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from pnfarm.controller import line as controller_line
from pnfarm.drives import catalogue
from pnfarm.drives.parameters.memory import VolatileMemory
from pnfarm.farm.file.reading import parse_farm
from pnfarm.station.event_log import EventLog

if TYPE_CHECKING:
    from collections.abc import Sequence

FILE = """
farm: virtual
link: {{kind: memory}}
drives:
  - name: axis-{{n:02}}
    count: {drives}
    model: {model}
    identity: {identity}
    params: {params}
    motion_tasks: {tasks}
    motor: {motor}
    load: {load}
    machine: {machine}
    behaviour: {behaviour}{keys}
    words: {words}
    faults: {faults}
    realism: {realism}
    ip: 10.77.0.11/23
    limits: {limits}
controller:
  name: plc
  ip: 10.77.1.250/23
  cycle: {cycle}
  watchdog_factor: {watchdog}
  startup: {startup}
  telegram: {telegram}
  program: {program}
  reconnect: {{after: 300ms}}
"""


#: A drive on PROFIBUS instead, at its fastest rate; the master asks for parameters within the cyclic connection.
ON_LINE = (
    ("link: {kind: memory}", "link: {kind: memory, baud: 12000000}"),
    ("    ip: 10.77.0.11/23\n", "    address: 11\n"),
    ("  ip: 10.77.1.250/23\n", "  address: 1\n  access: class-1\n"),
    ("  watchdog_factor: {watchdog}\n  startup: {startup}\n", "  watchdog: 100ms\n"),
)


class VirtualLine:
    """``run`` seconds; look at ``farm`` and ``plc``."""

    def __init__(self, drives: int = 1, *, cycle: str = "16ms", limits: str = "strict", watchdog: int = 3,
                 startup: str = "legacy", telegram: int = 1, model: str = "akd-profinet", controller: bool = True,
                 memory: VolatileMemory | None = None, params: str = "{}", tasks: str = "[]",
                 motor: str = "{}", load: str = "{}", machine: str = "{}", behaviour: str = "{}", realism: str = "{}",
                 top: str = "", identity: str = "{}", words: str = "{}", faults: str = "[]", keys: Sequence[str] = (),
                 program: str = "{kind: constant, speed_rpm: 60, acknowledge_after: 200ms}") -> None:  # fmt: skip
        #: Whether it is a line, with a master.
        self.is_on_line = catalogue.model(model).bus == "profibus"
        file = FILE
        for ip, line in ON_LINE if self.is_on_line else ():
            file = file.replace(ip, line)
        text = top + file.format(
            drives=drives,
            cycle=cycle,
            limits=limits,
            watchdog=watchdog,
            startup=startup,
            telegram=telegram,
            model=model,
            identity=identity,
            params=params,
            tasks=tasks,
            motor=motor,
            load=load,
            machine=machine,
            behaviour=behaviour,
            keys="".join(f"\n    {key}" for key in keys),
            realism=realism,
            words=words,
            faults=faults,
            program=program,
        )
        if not controller:
            text = text[: text.index("controller:")]
        self.memory = memory or VolatileMemory()
        self.log = EventLog(quiet=True)
        self.plc_log = EventLog(quiet=True)
        line = asyncio.run(
            controller_line.VirtualLine.create(parse_farm(text), memory=self.memory, log=self.log, plc_log=self.plc_log)
        )
        self.world, self.farm, self.farm_link = line.world, line.farm, line.farm_link
        if controller:
            self.plc = line.plc

    def run(self, seconds: float) -> None:
        self.world.run(seconds)

    def connect(self, within: float = 5.0) -> None:
        assert self.world.run(within, until=lambda: self.plc.all_connected), self.reasons()

    def enable(self, within: float = 5.0) -> None:
        assert self.world.run(within, until=lambda: self.plc.all_running), self.reasons()

    def reasons(self) -> str:
        if self.is_on_line:
            return "; ".join(f"{row['name']} {row['state']} {row['last_reason']}" for row in self.plc.snapshot())
        return "; ".join(f"{s.plan.name} {s.state} {s.measures.last_reason}" for s in self.plc.sessions)

    def events(self, name: str) -> list[str]:
        return [entry.event for entry in self.log.entries(name)]
