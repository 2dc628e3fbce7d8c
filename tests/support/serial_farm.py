"""A farm on a real line with a controller at its other end."""

from __future__ import annotations

import os
from contextlib import asynccontextmanager

from pnfarm.controller.runtime import Plc
from pnfarm.farm.file.reading import parse_farm
from pnfarm.station.event_log import EventLog

__all__ = ["config", "master", "states"]

FARM = """
farm: dpline{number}
link: {{kind: serial, {way}}}
api: off
realtime: {{nice: 0}}
drives:
  - {{name: 'axis-{{n:02}}', count: {count}, model: moog-msd-dp, address: 11}}
controller:
  name: plc
  cycle: 10ms
  watchdog: {watchdog}
  program: {{kind: constant, speed_rpm: 300, acknowledge_after: 100ms}}
  reconnect: {{after: 200ms}}
"""


def config(way: str, count: int = 4, watchdog: str = "500ms"):
    return parse_farm(FARM.format(number=os.getpid(), way=way, count=count, watchdog=watchdog))


@asynccontextmanager
async def master(config):
    async with Plc(config, log=EventLog(quiet=True)) as plc:
        try:
            yield plc
        finally:
            await plc.release()


def states(farm):
    return [(int(s.handle.axis.drive.state), s.device.slave.state, s.device.connects) for s in farm.core.axes]
