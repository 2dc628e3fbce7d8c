"""A step of the machine's wall clock, by NTP or by hand."""

import time

import pytest

from pnfarm.testing import Line


@pytest.mark.parametrize("step", [3600.0, -3600.0])
def test_a_step_of_the_wall_clock_is_one_in_the_log_alone(monkeypatch, step):
    wall = time.time
    with Line("axis-01") as line:
        line.wait_running()
        fault = line.inject("silence", "axis-01", **{"for": "1s"})
        monkeypatch.setattr(time, "time", lambda: wall() + step)
        begin = line.now
        line.wait_until(lambda: fault.state == "ended", within=5)
        assert line.now - begin == pytest.approx(1.0, abs=0.02)
        line.wait_running()
        entries = line.events()
    assert [entry.now_ns for entry in entries] == sorted(entry.now_ns for entry in entries)
    assert abs(entries[-1].wall - entries[0].wall) == pytest.approx(abs(step), abs=60)
