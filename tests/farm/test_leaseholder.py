"""What a farm does as its lease comes and goes, with a database that only says so."""

import asyncio
from types import SimpleNamespace

import pytest

from pnfarm.controller.line import VirtualLine
from pnfarm.drives.parameters.memory import VolatileMemory
from pnfarm.errors import EnvironmentError_
from pnfarm.farm.file.reading import parse_farm
from pnfarm.farm.lease import LeaseChanged, LeaseState
from pnfarm.farm.leaseholder import Leaseholder
from pnfarm.faults.effects.wire import WIRE
from pnfarm.station.event_log import EventLog

FILE = """
farm: leased
link: {kind: memory}
drives: [{name: "axis-{n}", count: 2, model: akd-profinet, ip: 10.77.0.11/24}]
"""


class Database:
    """A lease as :class:`~pnfarm.farm.memory.postgres.PostgresState` shows it."""

    def __init__(self):
        self.lease = None
        self.ready = True
        self.standing = SimpleNamespace(reason="no answer", waiting_for=None)
        self.told = []

    def check(self):
        told, self.told = self.told, []
        return told

    def attended(self, *, watched=True):
        pass


class Rig:
    def __init__(self, memory):
        self.memory = memory
        self.database = Database()
        self.failed = []

    async def __aenter__(self):
        self.log = EventLog(quiet=True)
        self.line = await VirtualLine.create(parse_farm(FILE), memory=self.memory, log=self.log)
        self.holder = Leaseholder(self.database, self.log, lambda: self.line.world.now)
        self.holder.start(self.line.farm, lambda: None, self.failed.append)
        return self

    async def __aexit__(self, *_):
        self.holder.stop()

    def wires(self):
        core = self.line.farm
        return [core.injections.drive(one.configured_name).find(WIRE).in_force() for one in core.stations]

    async def tell(self, *changes):
        self.database.told += changes
        self.database.news()
        # the leaseholder's callback is the loop's next one
        await asyncio.sleep(0)


@pytest.mark.parametrize("anew", [False, True])
def test_cables_are_pulled_while_the_lease_is_lost_and_drives_boot_where_others_had_them(anew):
    async def run():
        async with Rig(VolatileMemory()) as rig:
            await rig.tell(LeaseChanged(LeaseState.LOST))
            assert rig.wires() == [["cable"], ["cable"]]
            await rig.tell(LeaseChanged(LeaseState.HELD, anew))
            assert rig.wires() == [[], []]
            booted = [entry.drive for entry in rig.log.entries() if entry.event == "power on"]
            assert booted == (["axis-1", "axis-2"] if anew else [])
            assert not rig.failed

    asyncio.run(run())


def test_a_memory_that_others_damaged_ends_the_farm_instead_of_leaving_its_drives_mute():
    memory = VolatileMemory()

    async def run():
        async with Rig(memory) as rig:
            await rig.tell(LeaseChanged(LeaseState.WAITING))
            memory.save("axis-1", {"name": 7})
            await rig.tell(LeaseChanged(LeaseState.HELD, anew=True))
            (why,) = rig.failed
            assert isinstance(why, EnvironmentError_)
            assert "memory is damaged" in str(why)

    asyncio.run(run())
