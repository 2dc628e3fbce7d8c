"""A drive as tests, the API, the page, conditions and the metrics show it: they say the same."""

from __future__ import annotations

import json

from pnfarm.farm.views.overview import Overview
from pnfarm.metrics import FarmCollector
from pnfarm.protocols.profinet.wire.rtc import DataStatus
from pnfarm.station.signals import SIGNALS
from pnfarm.testing import Line


def test_a_drive_that_is_switched_off_says_nothing_wherever_it_is_shown() -> None:
    with Line("a", load={"inertia": 1e-3}) as line:
        metrics, overview = FarmCollector(line.core), Overview(line.core, lambda: line.now_ns)
        axis = line.drive("a")
        line.wait_running()
        line.run(1)
        axis.inject("f702")
        line.run(0.005)
        assert axis.fault == 702
        assert axis.setpoint > 0
        axis.power_off()
        line.run(0.005)
        assert (axis.fault, axis.faults, axis.warning) == (None, [], None)
        assert (axis.stw1, axis.zsw1, axis.setpoint, axis.following_error) == (0, 0, 0, 0)
        shown = axis.snapshot()
        assert (shown["fault"], shown["setpoint_rpm"], shown["following_error_revolutions"]) == (None, 0, 0)
        page = json.loads(overview.since(0))["values"]
        assert (page["fault"], page["setpoint"]) == ([None, [0]], [None, [0]])
        scraped = {one.name: one.samples[0].value for one in metrics.gather().metrics() if one.samples}
        assert scraped["pnfarm_axis_fault_active"] == scraped["pnfarm_axis_setpoint_rpm"] == 0
        assert scraped["pnfarm_axis_following_error_revolutions"] == 0
        # the shaft coasts on, and what was there before is history
        assert axis.velocity == shown["velocity_rpm"] == scraped["pnfarm_axis_velocity_rpm"] != 0
        assert axis.last_fault == 702


def test_a_drive_whose_controller_is_in_stop_is_connected_wherever_it_is_shown() -> None:
    with Line("a") as line:
        metrics = FarmCollector(line.core)
        axis = line.drive("a")
        line.wait_running()
        line._line.plc.columns.ppm[0].data_status &= ~DataStatus.RUN & 0xFF
        line.run(0.3)
        assert not axis.setpoints.valid
        assert axis.connected
        assert axis.snapshot()["connected"]
        assert SIGNALS["connected"].read(line.core.axis("a"))
        (scraped,) = (one for one in metrics.gather().metrics() if one.name == "pnfarm_ar_exchanging")
        assert scraped.samples[0].value == 1
