"""Drives on a PROFIBUS line with a master from PyPI, pyprofibus, over a pty, by the GSD file of this project."""

from __future__ import annotations

import asyncio
import os
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from line_peer import peer

from pnfarm.cli.main import main
from pnfarm.farm.farm import Farm
from pnfarm.farm.file.reading import parse_farm
from pnfarm.protocols.profibus.slave import PARAMETERS_AGAIN
from pnfarm.protocols.profibus.wire.dp import DpState
from pnfarm.station.event_log import EventLog

pytest.importorskip("pyprofibus", reason="needs the package pyprofibus")
pytestmark = pytest.mark.asyncio

FIRST = 11
#: Module of the GSD file, and its octets each way.
SPEED, OCTETS = "Standard telegram 1", 4
FARM = """
farm: pyprofibus{number}
link: {{kind: serial, pty: '{path}', baud: 1500000}}
api: off
drives:
  - {{name: 'axis-{{n:02}}', count: {count}, model: {model}, address: {first},
     realism: {{parameter_latency: 50ms}}}}
"""


@asynccontextmanager
async def farm(path: Path, count: int, model: str = "moog-msd-dp"):
    text = FARM.format(number=os.getpid(), path=path, count=count, model=model, first=FIRST)
    async with Farm(parse_farm(text), log=EventLog(quiet=True)) as running:
        yield running


@pytest.fixture(scope="module")
def gsd(tmp_path_factory):
    folder = tmp_path_factory.mktemp("gsd")
    assert main(["gsd", "moog-msd-dp", "-o", str(folder)]) == 0
    (file,) = folder.glob("*.gsd")
    return file


@pytest.mark.parametrize("count", [1, 8])
async def test_pyprofibus_runs_the_axes_of_a_line(tmp_path, gsd, count):
    addresses = range(FIRST, FIRST + count)
    async with farm(tmp_path / "line", count) as running:
        seen = await peer("peer_pyprofibus.py", tmp_path / "line", gsd, SPEED, OCTETS, 30, *addresses)
        stations = running.core.axes
        for station, address in zip(stations, addresses, strict=True):
            told = seen[str(address)]
            assert told["connected"]
            assert told["answers"] > told["operating"] >= 200
            zsw1 = int(told["inputs"][:4], 16)
            assert zsw1 & 0x000F == 0x0007, "in operation, no fault"
            # NSOLL_A was 0x0800
            assert station.handle.axis.motor.velocity > 100
            slave = station.device.slave
            assert (slave.state, slave.master) == (DpState.DATA_EXCH, 2)
            # this master takes a short acknowledgement for that of every slave: it parametrises some of them twice
            assert set(station.device.lost) <= {PARAMETERS_AGAIN}
            assert slave.dropped.total() == 0
        # the master has gone without a word: each watchdog notices, and raises error 32-1
        async with asyncio.timeout(5):
            while {int(station.handle.axis.faults.code[0]) & 0xFFFF for station in stations} != {32}:  # noqa: ASYNC110 - the engine's thread sets no events
                await asyncio.sleep(0.02)
        assert {station.device.watchdog_expirations for station in stations} == {1}
        assert not any(station.device.connected for station in stations)


async def test_pyprofibus_runs_a_profile_drive_by_the_gsd_file_of_this_project(tmp_path):
    assert main(["gsd", "profidrive-dp", "-o", str(tmp_path)]) == 0
    (file,) = tmp_path.glob("*.gsd")
    async with farm(tmp_path / "line", 1, "profidrive-dp") as running:
        (station,) = running.core.axes
        seen = await peer("peer_pyprofibus.py", tmp_path / "line", file, SPEED, OCTETS, 30, FIRST)
        told = seen[str(FIRST)]
        assert told["connected"]
        assert told["answers"] > told["operating"] >= 200
        assert int(told["inputs"][:4], 16) & 0x000F == 0x0007, "in operation, no fault"
        assert station.handle.axis.motor.velocity > 300, "NSOLL_A was 0x0800 of 0x4000, which is 3000 rpm"
        assert station.store.read(922)[0] == 1
        async with asyncio.timeout(5):
            while int(station.handle.axis.faults.code[0]) & 0xFFFF != 9:  # noqa: ASYNC110 - the engine's thread sets no events
                await asyncio.sleep(0.02)


async def test_records_go_over_msac1_and_msac2_with_the_fdl_layer_of_pyprofibus(tmp_path, gsd):
    async with farm(tmp_path / "line", 1) as running:
        seen = await peer("peer_pyprofibus_records.py", tmp_path / "line", gsd, SPEED, OCTETS, FIRST)
        (station,) = running.core.axes
        for way, reference in (("msac1", 4000 + 51), ("msac2", 4000)):
            told = seen[way]
            assert told["before"].startswith("01 01 00 01 43 01 "), "response, one value, a double word"
            assert told["changed"] == "02 02 00 01"
            assert told["after"] == f"03 01 00 01 43 01 {reference.to_bytes(4, 'big').hex(' ')}"
            assert told["never"] == "04 82 00 01 44 02 00 01 00 00", "error 1: the value cannot be changed"
            assert told["refused_before_ready"] >= 1, "9.1: a read before the answer is there is refused"
        assert seen["msac1"]["after"][-11:] == seen["msac2"]["before"][-11:]
        assert seen["manager"] == "56 00 00 64"
        assert seen["initiated"].startswith("57 f0 01 00")
        assert (seen["aborted"], seen["closed"]) == ("ack", 3), "no service behind an Abort"
        assert seen["fdl_status"] == 0
        assert seen["connected"]
        assert station.device.connects == 1
        assert not station.device.slave.class_two.open
