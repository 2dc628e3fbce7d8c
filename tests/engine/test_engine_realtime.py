"""The engine's thread: what it asks the kernel for, and what it tells of it."""

import os
import socket
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from virtual_pair import Pair

from pnfarm.engine.realtime import RealTimeEngine, RealTimeSettings


def threads() -> set[int]:
    return {int(path.name) for path in Path("/proc/self/task").iterdir()}


@contextmanager
def started(settings):
    """An engine at work, and the number of its thread."""
    near, far = socket.socketpair()
    with near, far:
        engine = RealTimeEngine(Pair(drives=1).farm, near, settings)
        with closing(engine):
            before = threads()
            engine.start()
            (thread,) = threads() - before
            yield engine, thread


def niceness(thread: int) -> int:
    return int(Path(f"/proc/self/task/{thread}/stat").read_text().rpartition(")")[2].split()[16])


def test_only_the_engines_thread_is_nicer():
    own = os.getpriority(os.PRIO_PROCESS, 0)
    nicer = min(own + 3, 19)
    with started(RealTimeSettings(nice=nicer)) as (engine, thread):
        assert engine.report.refused == {}
        assert niceness(thread) == nicer
        assert os.getpriority(os.PRIO_PROCESS, 0) == own


def test_a_larger_share_is_granted_or_its_refusal_told():
    own = os.getpriority(os.PRIO_PROCESS, 0)
    with started(RealTimeSettings(nice=-11)) as (engine, thread):
        assert ("nice -11" in engine.report.granted) == (niceness(thread) == -11)
        assert ("nice -11" in engine.report.refused) == (niceness(thread) == own)


@pytest.mark.parametrize("settings", [RealTimeSettings(nice=None), RealTimeSettings(nice=None, slice_ns=None)])
def test_what_is_not_asked_for_stays_as_it_was(settings):
    own = os.getpriority(os.PRIO_PROCESS, 0)
    with started(settings) as (engine, thread):
        assert niceness(thread) == own
        assert not any(name.startswith("nice") for name in engine.report.granted)
