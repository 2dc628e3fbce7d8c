"""How long the kernel keeps octets of serial lines: an octet over a pty of the farm's own, with the test's clock."""

import asyncio
from contextlib import closing
from pathlib import Path

import pytest

from pnfarm.links.serial.carried import CarriedOctets

MS = 1_000_000
pytestmark = pytest.mark.asyncio


class Probe:
    """A pty under test; ``noted``: the times and delays, ns."""

    def __init__(self):
        self.now = 0
        self.noted = []
        self._is_noted = asyncio.Event()
        #: When the octet under way was sent, 0: none is.
        self.due_ns = 0
        self.carried = CarriedOctets(self, lambda: self.now)

    def note(self, now, late):
        self.noted.append((now, late))
        self._is_noted.set()

    def beat(self, now):
        self.now = now
        self.carried.beat()

    async def came(self, now):
        """Read what the kernel has carried; that is at ``now``."""
        self.now = now
        self._is_noted.clear()
        await asyncio.wait_for(self._is_noted.wait(), 60)

    def close(self):
        self.carried.close()


def open_files():
    return len(list(Path("/proc/self/fd").iterdir()))


async def test_an_octet_that_waited_is_noted_with_its_time():
    with closing(Probe()) as probe:
        probe.beat(MS)
        await probe.came(301 * MS)
        probe.beat(301 * MS)
        await probe.came(301 * MS)
        assert probe.noted == [(301 * MS, 300 * MS), (301 * MS, 0)]


async def test_an_octet_under_way_is_noted_at_each_beat_and_no_other_one_is_sent():
    with closing(Probe()) as probe:
        for late in (0, 100 * MS, 200 * MS):
            probe.beat(MS + late)
        await probe.came(251 * MS)
        assert probe.noted == [(MS + late, late) for late in (100 * MS, 200 * MS, 250 * MS)]


async def test_nothing_of_it_is_left_behind_a_close():
    probe = Probe()
    before = open_files()
    probe.beat(MS)
    probe.close()
    probe.close()
    assert open_files() == before - 2
    await asyncio.sleep(0)  # the turn in which a reader that was left would be called
    assert not probe.noted
