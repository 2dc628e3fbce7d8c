"""The end of a farm: each part of it is closed, whatever another one raises."""

import pytest

from pnfarm.farm.farm import Farm
from pnfarm.farm.file.reading import parse_farm
from pnfarm.station.event_log import EventLog

FILE = """
farm: ending
link: {kind: memory}
drives: [{name: axis-01, model: akd-profinet, ip: 10.77.0.11/24}]
"""


@pytest.mark.asyncio
async def test_a_drive_that_cannot_take_its_leave_does_not_keep_the_others_running(monkeypatch):
    farm = Farm(parse_farm(FILE), log=EventLog(quiet=True))
    await farm.open()
    done = []
    close = farm.driver.close

    def broken(now):
        raise ZeroDivisionError("a drive is broken")

    async def closed():
        await close()
        done.append("time stands still")

    async def action():
        done.append("what is beside is closed")

    monkeypatch.setattr(farm.core, "stop", broken)
    monkeypatch.setattr(farm.driver, "close", closed)
    farm.on_close.append(action)
    with pytest.raises(ZeroDivisionError, match="a drive is broken"):
        await farm.close()
    assert done == ["time stands still", "what is beside is closed"]
