"""Farms on the event loop of `pnfarm up`, where polls are answered between two of its turns."""

import asyncio
import os
import random
from contextlib import asynccontextmanager

import anyio
from serial_farm import config, master, states
from waiting import reached

from pnfarm.farm.farm import Farm
from pnfarm.farm.views.snapshot import line_snapshot
from pnfarm.links.joined import lines_of
from pnfarm.links.serial.eager_loop import LOOKING
from pnfarm.protocols.profibus.wire.dp import DpState
from pnfarm.station.event_log import EventLog


def on_looking_loop(task):
    return anyio.run(task, backend_options=LOOKING)


def counted(link):
    """How many polls the link answered at once from now on."""
    count, answer = [0], link._answer

    def counting(octets, length, now):
        found = answer(octets, length, now)
        count[0] += found is not None
        return found

    link._answer = counting
    return count


@asynccontextmanager
async def running(way, drives):
    """A farm with its controller, and the count of polls that were answered at once."""
    asked = config(way, drives)
    async with Farm(asked, log=EventLog(quiet=True)) as farm, master(asked):
        yield farm, counted(next(iter(lines_of(farm.link).values())))


def test_drives_start_up_run_and_tell_their_diagnosis_where_polls_are_answered_at_once(tmp_path):
    async def task():
        async with running(f"pty: {tmp_path}/line, baud: 1500000", 4) as (farm, count):
            await reached(lambda: [state for state, *_ in states(farm)] == [4] * 4)
            await reached(lambda: count[0] > 200)
            # an injection of one drive takes all polls off the fastest path, and its end brings them back
            farm.core.injections.inject({"kind": "diagnosis-request", "on": "axis-01"}, farm.now())
            diagnoses = farm.core.line_counts("profibus")["diagnosis"]
            await reached(lambda: farm.core.line_counts("profibus")["diagnosis"] > diagnoses)
            farm.core.injections.clear(None, farm.now())
            before = count[0]
            await reached(lambda: count[0] > before + 100)
            assert [state for _, state, _ in states(farm)] == [DpState.DATA_EXCH] * 4
            # both ends agree about what they counted
            line = line_snapshot(farm.core, "profibus")
            received = sum(station.device.image.counts.received for station in farm.core.axes)
            assert received > count[0]
            assert line["telegrams_received"] >= line["telegrams_sent"] >= received

    on_looking_loop(task)


def test_noise_between_polls_is_counted_and_the_drives_run_on(tmp_path):
    async def task():
        async with running(f"pty: {tmp_path}/line", 2) as (farm, count):
            await reached(lambda: count[0] > 50)
            fd = os.open(f"{tmp_path}/line", os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
            chance = random.Random(1)
            try:
                for _ in range(100):
                    os.write(fd, chance.randbytes(chance.randrange(1, 40)))
                    # between polls, not all before the next one
                    await asyncio.sleep(0.001)
            finally:
                os.close(fd)
            assert sum(line_snapshot(farm.core, "profibus")["dropped"].values()) > 0
            await reached(lambda: [state for _, state, _ in states(farm)] == [DpState.DATA_EXCH] * 2)
            before = count[0]
            await reached(lambda: count[0] > before + 50)

    on_looking_loop(task)


def test_the_loops_timers_and_other_threads_calls_are_not_held_up_by_polls(tmp_path):
    async def task():
        async with running(f"pty: {tmp_path}/line", 1) as (_, count):
            await reached(lambda: count[0] > 50)
            loop, called = asyncio.get_running_loop(), asyncio.Event()
            await asyncio.to_thread(loop.call_soon_threadsafe, called.set)
            async with asyncio.timeout(20):
                await called.wait()

    on_looking_loop(task)
