"""Many drives connect in turns: the controller begins no more start-ups at once than answers can come in time for."""

from __future__ import annotations

import pytest
from virtual_line import VirtualLine

from pnfarm.buses.profinet.controller import session_life
from pnfarm.buses.profinet.controller.session import SessionState


class Turns(VirtualLine):
    """A line whose controller begins ``at_once`` start-ups; ``most`` were under way together."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, drives: int, at_once: int) -> None:
        monkeypatch.setattr(session_life, "STARTING", at_once)
        super().__init__(drives)
        self.most = 0

    def add(self, kind: str, on: str = "all", **params: str) -> None:
        self.farm.injections.inject({"kind": kind, "on": on, "params": params}, self.world.now)

    def under_way(self) -> int:
        states = (s.state for s in self.plc.sessions if s.machine is not None)
        return sum(state is SessionState.CONNECT for state in states)

    def look(self) -> bool:
        self.most = max(self.most, self.under_way())
        return self.plc.all_connected


@pytest.mark.parametrize("at_once", [1, 3, 20])
def test_all_drives_connect_and_no_more_start_ups_than_that_are_under_way(monkeypatch, at_once):
    line = Turns(monkeypatch, 12, at_once)
    # a start-up takes some time
    line.add("delay", frames="rpc", delay="20ms")
    assert line.world.run(20.0, until=line.look), line.reasons()
    assert line.most == min(at_once, 12)


def test_a_start_up_that_fails_gives_its_turn_to_the_next_one(monkeypatch):
    line = Turns(monkeypatch, 3, 1)
    line.add("no-application-ready", on=line.farm.axes[0].configured_name)
    failing, *others = line.plc.sessions
    assert line.world.run(60.0, until=lambda: all(session.state is SessionState.DATA for session in others))
    assert failing.measures.refusals >= 1
    line.farm.injections.clear(None, line.world.now)
    assert line.world.run(60.0, until=line.look), line.reasons()


def test_a_drive_that_is_released_while_it_waits_for_its_turn_is_not_connected(monkeypatch):
    line = Turns(monkeypatch, 3, 1)
    waiting = line.plc.sessions[2]
    line.add("no-application-ready")
    assert line.world.run(5.0, until=lambda: waiting.state is SessionState.CONNECT and waiting.machine is None)
    # an observer sees it wait
    assert line.plc.snapshot()[2]["state"] == "CONNECT"
    line.plc.release(line.world.now)
    assert waiting.state is SessionState.STOPPED
    assert line.world.run(5.0, until=lambda: all(s.state is SessionState.STOPPED for s in line.plc.sessions))
    line.run(5.0)
    assert [s.measures.connects for s in line.plc.sessions][1:] == [0, 0]
