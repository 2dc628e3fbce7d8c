"""The engine's thread: what it asks the kernel for, and what it tells of it."""

import os
import socket
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from virtual_pair import Pair

from pnfarm.engine import realtime
from pnfarm.engine.realtime import RealTimeEngine, RealTimeSettings


@contextmanager
def started(settings):
    """An engine at work, and the number of its thread."""
    near, far = socket.socketpair()
    with near, far:
        engine = RealTimeEngine(Pair(drives=1).farm, near, settings)
        with closing(engine):
            engine.start()
            yield engine, engine.thread_id


def niceness(thread: int) -> int:
    return int(Path(f"/proc/self/task/{thread}/stat").read_text().rpartition(")")[2].split()[16])


def test_only_the_engines_thread_is_nicer():
    own = os.getpriority(os.PRIO_PROCESS, 0)
    nicer = min(own + 3, 19)
    with started(RealTimeSettings(fifo_priority=0, nice=nicer)) as (engine, thread):
        assert engine.report.refused == {}
        assert niceness(thread) == nicer
        assert os.getpriority(os.PRIO_PROCESS, 0) == own


def test_a_larger_share_is_granted_or_its_refusal_told():
    own = os.getpriority(os.PRIO_PROCESS, 0)
    with started(RealTimeSettings(fifo_priority=0, nice=-11)) as (engine, thread):
        assert ("nice -11" in engine.report.granted) == (niceness(thread) == -11)
        assert ("nice -11" in engine.report.refused) == (niceness(thread) == own)


@pytest.mark.parametrize("slice_ns", [100_000, None])
def test_what_is_not_asked_for_stays_as_it_was(slice_ns):
    own = os.getpriority(os.PRIO_PROCESS, 0)
    with started(RealTimeSettings(fifo_priority=0, nice=None, slice_ns=slice_ns)) as (engine, thread):
        assert os.sched_getscheduler(thread) == os.SCHED_OTHER
        assert niceness(thread) == own
        assert not any(name.startswith("nice") for name in engine.report.granted)


def test_the_engine_goes_before_what_is_not_real_time_or_its_refusal_is_told():
    with started(RealTimeSettings()) as (engine, thread):
        granted = os.sched_getscheduler(thread) == os.SCHED_FIFO
        assert ("SCHED_FIFO 1" in engine.report.granted) == granted
        assert ("SCHED_FIFO 1" in engine.report.refused) == (not granted)
        shared = "nice -11" in {*engine.report.granted, *engine.report.refused}
        assert shared == (not granted), "a refused priority leaves what the ordinary scheduler has"


def test_an_engine_that_keeps_its_processor_for_itself_is_given_back_to_the_ordinary_scheduler(monkeypatch):
    with started(RealTimeSettings()) as (engine, thread):
        granted = "SCHED_FIFO 1" in engine.report.granted
        assert not any(engine.demote_if_overloaded() for _ in range(2 * realtime.BUSY_LOOKS)), "it has nothing to do"
        monkeypatch.setattr(realtime, "MOST_SHARE", 0.0)
        found = [engine.demote_if_overloaded() for _ in range(2 * realtime.BUSY_LOOKS)]
        said = [place for place, why in enumerate(found) if why]
        assert said == ([realtime.BUSY_LOOKS - 1] if granted else []), "not at once, and once"
        assert os.sched_getscheduler(thread) == os.SCHED_OTHER
        assert "SCHED_FIFO 1" not in engine.report.granted


def test_a_stop_whose_first_wait_is_over_late_waits_again(monkeypatch):
    """As on a machine that stands: the wait's time is over, and the thread has not run."""
    with started(RealTimeSettings(fifo_priority=0)) as (engine, _):
        thread = engine._thread
        waits = []

        def join(timeout):
            waits.append(timeout)
            if len(waits) == 3:
                type(thread).join(thread)

        monkeypatch.setattr(thread, "join", join)
        engine.stop()
        assert len(waits) == 3
        assert not engine.running
