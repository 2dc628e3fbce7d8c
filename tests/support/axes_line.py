"""A farm file with its controller in virtual time, whose drives have several axes."""

import asyncio

from pnfarm.controller import line as controller_line
from pnfarm.drives.parameters.memory import VolatileMemory
from pnfarm.farm.file.reading import parse_farm
from pnfarm.station.event_log import EventLog


class AxesLine:
    def __init__(self, text):
        self.log, self.memory = EventLog(quiet=True), VolatileMemory()
        self.line = asyncio.run(
            controller_line.VirtualLine.create(
                parse_farm(text), memory=self.memory, log=self.log, plc_log=EventLog(quiet=True)
            )
        )
        self.farm, self.world = self.line.farm, self.line.world
        self.plc = self.line.plc

    def run(self, seconds):
        self.world.run(seconds)

    def connected(self):
        self.run(3.0)
        assert all(station.device.connected for station in self.farm.stations)
        return self

    def axis(self, name):
        return self.farm.axis(name)

    def states(self):
        return [int(axis.handle.axis.drive.state) for axis in self.farm.axes]

    def events(self, name):
        return [entry.what for entry in self.log.entries(name)]
