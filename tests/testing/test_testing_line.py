"""``pnfarm.testing`` as a tester uses it: one import."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

import pnfarm
from pnfarm.errors import ConfigError, PnfarmError
from pnfarm.testing import Line, NotInTime

PROGRAMS = Path(__file__).parents[2] / "configs" / "programs"


@pytest.mark.parametrize(
    ("model", "fault", "number"),
    [
        ("akd-profinet", 702, 702),
        ("moog-msd", "32-1", "32-1"),
        ("hiwin-e1", "AL.FB1", None),
        ("moog-msd-dp", "32-1", "32-1"),
    ],
)
def test_a_fault_reads_as_the_manual_writes_it_and_the_drive_comes_back(model, fault, number):
    with Line("axis-01", model=model) as line:
        axis = line.drive("axis-01")
        line.wait_running()
        with axis.inject("drive-fault", fault=fault, count=1) as injected:
            line.wait_until(lambda: axis.fault == fault, within=0.1)
            assert number is None or axis.fault.number == number
            assert axis.zsw1.fault_present
            assert axis.state != "S4"
        assert injected.state == "ended"
        assert injected.evidence.activations == 1
        assert line.wait_until(lambda: axis.state == "S4", within=5) > 0.1
        assert axis.fault is None
        assert axis.last_fault == fault
        assert [entry.event for entry in axis.events("fault")] == ["fault"]


def test_signals_words_and_parameters_have_names_and_units():
    with Line("axis-01", model="hiwin-e1") as line:
        axis = line["axis-01"]
        line.wait_running()
        line.run(1)
        assert axis.setpoints.nsoll_b == pytest.approx(60, abs=0.1)
        assert axis.actuals.nist_b == pytest.approx(60, abs=1) == axis.actuals.velocity
        assert axis.stw1.enable_operation
        assert axis.zsw1.operation_enabled
        assert axis.velocity == pytest.approx(60, abs=1)
        with pytest.raises(PnfarmError, match=r"no parameter 'NO.SUCH'"):
            axis.parameter("NO.SUCH")
    with Line("axis-01") as line:
        axis = line["axis-01"]
        line.wait_connected()
        assert axis.parameter("DRV.OPMODE") == axis.parameter(930) or axis.parameter("DRV.OPMODE") in {0, 1, 2}


def test_a_wait_in_vain_shows_the_drives_and_leaves_no_time_over():
    with Line("axis-01", program=None) as line:
        with pytest.raises(NotInTime, match=r"did not hold within 0\.25 s .*axis-01 S1, not connected"):
            line.wait_until(lambda: False, within=0.25)
        assert line.now == pytest.approx(0.25)


def test_ten_minutes_pass_at_once():
    with Line("axis-01") as line:
        line.wait_running()
        line.run(600)
        assert line["axis-01"].state == "S4"
        assert line.now > 600


def test_a_program_may_be_a_class_of_the_test_and_be_looked_at():
    class Mine(pnfarm.AxisProgram):
        def __init__(self):
            self.count = 0

        def cycle(self, inputs, outputs, now):
            self.count += 1

    with Line("a", "b", program=Mine, cycle="16ms") as line:
        line.run(2)
        assert line.program("a").count == line.controller("a")["program"]["calls"]
        assert line.program("a").count > 100
        assert line["b"].state == "S1"


def test_what_a_test_gets_wrong_is_one_sentence():
    with Line("axis-01") as line:
        with pytest.raises(ConfigError, match="no drive 'axis-1'; it has axis-01"):
            line.drive("axis-1")
        with pytest.raises(ConfigError, match="silense"):
            line.inject("silense")
        with pytest.raises(ConfigError, match="no program in Python"):
            line.program("axis-01")
    with pytest.raises(ConfigError, match="the line is closed"):
        line.run(1)
    line.close()
    with pytest.raises(ConfigError, match="no-such"):
        Line("axis-01", model="no-such")


def test_power_and_faults_with_an_end_and_reset():
    with Line("axis-01", "axis-02") as line:
        axis = line["axis-01"]
        line.wait_running()
        axis.power_off()
        assert axis.state == "off"
        axis.power_on()
        line.wait_running(30)
        fault = line.inject("silence", on="axis-02", for_=0.5)
        line.run(0.6)
        assert fault.state == "ended"
        fault.clear()
        line.wait_running(30)
        line.inject("silence", on="all")
        line.reset()
        line.run(1)
        line.wait_running(30)


def test_a_line_is_made_inside_of_a_running_loop_too():
    async def inside() -> str:
        with Line("axis-01", program=PROGRAMS / "right.py") as line:
            line.wait_running()
            return line["axis-01"].state

    assert asyncio.run(inside()) == "S4"


@pytest.mark.parametrize("seconds", [float("inf"), float("nan"), -1])
def test_a_time_that_is_none_is_refused_with_what_is_allowed(seconds):
    with Line("axis-01") as line, pytest.raises(ConfigError, match=r"fault\.for: .* is not a duration; allowed"):
        line.inject("silence", for_=seconds)
