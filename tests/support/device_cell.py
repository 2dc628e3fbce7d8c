"""A farm with devices by the example GSDML files, with its controller, in virtual time."""

import asyncio
from pathlib import Path

from pnfarm.controller.line import VirtualLine
from pnfarm.drives.parameters.memory import VolatileMemory
from pnfarm.farm.file.reading import parse_farm
from pnfarm.station.event_log import EventLog

CONFIGS = Path(__file__).parents[2] / "configs"
ISLAND = "gsdml/GSDML-V2.35-Example-Island-20261127.xml"
SCANNER = "gsdml/GSDML-V2.43-Example-Scanner-20261127.xml"
HEAD = "farm: cell\nlink: {kind: memory}\n"
CONTROLLER = "controller: {name: plc, ip: 10.77.0.1/24, cycle: 16ms, reconnect: {after: 300ms}%s}\n"
ONE = f"""devices:
  - name: island
    gsdml: {ISLAND}
    access_point: DAP 1
    ip: 10.77.0.41/24
    slots: {{1: 16DI, 2: {{module: 8DO, parameters: {{Substitute: hold}}}}, 3: EX-AI-4, 4: FDI4}}
    signals:
      part_present: 1.1.0.3
      pressure: {{at: 3.1.0, type: int16, unit: bar, scale: 0.01}}
"""
DRIVES = "drives:\n  - {name: 'axis-{n}', count: 2, model: akd-profinet, ip: 10.77.0.11/24}\n"


def parse(text):
    return parse_farm(text, CONFIGS / "cell.pnfarm.yml")


class Cell:
    """A farm from the text of its file, with its controller, whose keys ``tail`` has."""

    tail = CONTROLLER
    #: The one that is meant if none is named.
    usual = "island"

    def __init__(self, text, controller="", memory=None):
        """``controller``: more of its keys; None: there is none."""
        self.log = EventLog(quiet=True)
        config = parse(HEAD + text + ("" if controller is None else self.tail % controller))
        self.line = asyncio.run(VirtualLine.create(config, log=self.log, memory=memory or VolatileMemory()))
        self.world, self.farm = self.line.world, self.line.farm
        self.plc = None if controller is None else self.line.plc

    def connect(self, within=10.0):
        reasons = [(row["name"], row["state"], row["last_reason"]) for row in self.plc.snapshot()]
        assert self.world.run(within, until=lambda: self.plc.all_connected), reasons
        self.world.run(0.1)

    def signals(self, name=None):
        return self.farm.station(name or self.usual).signals

    def device(self, name=None):
        return self.farm.station(name or self.usual).device

    def events(self, name="island"):
        return [entry.event for entry in self.log.entries(name)]

    def sent(self, octets, place=0, name="island"):
        """The controller sends these, and a cycle or two pass."""
        self.plc.plain[name][0].write({place: octets})
        self.world.run(0.1)

    def record(self, index, data=None, slot=2, name="island"):
        place = (0, slot, 1, index)
        now = self.world.now
        job = self.plc.read_record(name, place, now) if data is None else self.plc.write_record(name, place, data, now)
        self.world.run(1.0, until=lambda: job.done)
        return job
