"""A start-up that is interrupted: every phase ends in seconds, and nothing is sent to a drive without a connection."""

from __future__ import annotations

import pytest
from virtual_line import VirtualLine

from pnfarm.buses.profinet.controller.session import SessionState
from pnfarm.buses.profinet.device.modules import plug_module, pull_module
from pnfarm.farm.file.reading import FarmFileError, parse_farm
from pnfarm.protocols.profinet.cm.controller.cmctl import CmctlState

SECOND = 1_000_000_000


class StartUpLine(VirtualLine):
    """One drive whose start-up can be broken at any point."""

    def __init__(self, **options: object) -> None:
        super().__init__(1, **options)  # type: ignore[arg-type]  # the options are the line's own
        self.faults = self.farm.injections
        self.session = self.plc.sessions[0]

    def add(self, kind: str, **fields: object) -> None:
        self.faults.inject({"kind": kind, "on": "all", **fields}, self.world.now)

    def until_state(self, state: CmctlState) -> None:
        def there() -> bool:
            return self.session.machine is not None and self.session.machine.state is state

        assert self.world.run(5.0, until=there), self.reasons()

    def frames_sent(self) -> int:
        return int(self.plc.columns.ppm["sent"].sum())


def waiting_for_ready(**options: object) -> StartUpLine:
    """A start-up whose ApplicationReady the drive withholds, before the drive's first cyclic frame."""
    line = StartUpLine(**options)
    line.add("no-application-ready")
    line.add("loss", params={"frames": "cyclic"}, direction="out")
    line.until_state(CmctlState.W_ARDY)
    return line


def test_a_drive_that_vanishes_before_its_first_frame_is_given_up_within_seconds() -> None:
    line = waiting_for_ready()
    line.add("link-down")
    assert line.world.run(4.0, until=lambda: line.session.state is SessionState.WAIT)
    assert "no input data" in line.session.measures.last_reason
    line.faults.clear(None, line.world.now)
    line.connect(within=5.0)


def test_nothing_is_sent_to_a_drive_that_gave_its_start_up_up() -> None:
    line = waiting_for_ready()
    # the drive ends the connection without a notice
    line.add("loss", direction="out")
    line.farm.axes[0].device.cm.abort_all(0x0D, line.world.now)
    line.farm.settle(line.farm.axes[0].station, line.world.now)
    line.run(4.0)
    before = line.frames_sent()
    line.run(1.0)
    assert line.frames_sent() == before
    line.faults.clear(None, line.world.now)
    line.connect(within=5.0)


@pytest.mark.parametrize(("given", "seconds"), [("", 20.0), ("application_ready: 5s", 5.0)])
def test_a_drive_that_is_never_ready_is_given_up_after_the_files_time(given: str, seconds: float) -> None:
    line = StartUpLine(startup=f"legacy\n  {given}")
    line.add("no-application-ready")
    line.until_state(CmctlState.W_ARDY)
    begun = line.world.now
    assert line.world.run(seconds + 1.0, until=lambda: line.session.state is SessionState.WAIT)
    assert (line.world.now - begun) / SECOND == pytest.approx(seconds, abs=0.1)
    assert f"no ApplicationReady from the device within {seconds:g} s" in line.session.measures.last_reason


def test_a_long_time_for_application_ready_is_given_to_the_drive_and_waited_for() -> None:
    line = StartUpLine(startup="legacy\n  application_ready: 60s")
    line.add("late-application-ready", params={"delay": "50s"})
    line.until_state(CmctlState.W_ARDY)
    (ar,) = line.farm.axes[0].device.cm.ars
    assert ar.activity_timeout_ns == 60 * SECOND
    line.connect(within=55.0)
    assert line.session.measures.refusals == 0


@pytest.mark.parametrize("value", ["0s", "100ms", "65536s", "5"])
def test_a_time_that_no_device_can_have_is_refused(value: str) -> None:
    with pytest.raises(FarmFileError, match="application_ready"):
        parse_farm(f"controller: {{ip: 10.0.0.1/24, interface: eth1, application_ready: '{value}'}}")


def test_a_plugged_module_whose_parameters_are_not_answered_ends_the_connection_and_is_back_with_the_next() -> None:
    line = StartUpLine()
    line.connect()
    station = line.farm.axes[0]
    pull_module(station.device, 1, None, line.world.now)
    line.farm.settle(station.station, line.world.now)
    line.run(0.2)
    line.add("rpc-silence")
    plug_module(station.device, 1, line.world.now)
    line.farm.settle(station.station, line.world.now)
    assert line.world.run(10.0, until=lambda: line.session.state is not SessionState.DATA)
    line.faults.clear(None, line.world.now)
    line.connect(within=10.0)
    assert line.session.unusable == {}


def test_a_module_that_is_ready_late_after_a_plug_is_used() -> None:
    line = StartUpLine()
    line.connect()
    station = line.farm.axes[0]
    pull_module(station.device, 1, None, line.world.now)
    line.farm.settle(station.station, line.world.now)
    line.run(0.2)
    station.device.connections.ready_delay = lambda *_: 30 * SECOND
    plug_module(station.device, 1, line.world.now)
    line.farm.settle(station.station, line.world.now)
    line.run(25.0)
    assert line.session.state is SessionState.DATA
    assert set(line.session.unusable.values()) == {"no ApplicationReady from the device within 20 s"}
    line.connect(within=6.0)
    assert line.session.unusable == {}
    assert line.session.measures.losses == 0
