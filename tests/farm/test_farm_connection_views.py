"""What is shown of a drive's connection: nothing of one without supply, no time of one that exchanged nothing yet."""

from ipaddress import IPv4Address

import pytest

from pnfarm.farm.views.snapshot import connection_snapshot
from pnfarm.station.device import ConnectionView
from pnfarm.testing import Line

FARM = "{{farm: views, link: {{kind: memory}}, drives: [{{name: drive, {drive}}}], controller: {{name: plc, {plc}}}}}"
LINES = {
    "profinet": ("model: akd-profinet, ip: 10.77.0.11/24", "ip: 10.77.0.1/24, cycle: 16ms"),
    "ethernetip": ("model: akd-ethernetip, ip: 10.77.0.11/24", "ip: 10.77.0.1/24"),
    "profibus": ("model: moog-msd-dp, address: 11", "cycle: 5ms"),
}


@pytest.mark.parametrize("bus", LINES)
def test_a_drive_without_supply_shows_no_connection_and_comes_back_with_one(bus):
    drive, plc = LINES[bus]
    with Line.from_text(FARM.format(drive=drive, plc=plc)) as line:
        line.wait_connected()
        one = line.drive("drive")
        assert one.snapshot()["controller"] is not None
        one.power_off()
        shown = one.snapshot()
        assert (shown["connected"], shown["controller"], shown["connected_seconds"]) == (False, None, None)
        assert not shown["details"].get("connections")
        assert not shown["details"].get("sessions")
        line.run(2)
        one.power_on()
        line.wait_connected()
        assert one.snapshot()["connects"] == 2


@pytest.mark.parametrize(
    "view",
    [ConnectionView("Established", "0xffff-00000001", IPv4Address("10.77.0.1")),
     ConnectionView("WAIT_CFG", "master 1", cyclic=True)],
)  # fmt: skip
def test_a_connection_that_exchanged_nothing_yet_has_no_time(view):
    shown = connection_snapshot(view, 1_000_000_000_000)
    assert shown["controller"]["name"] == view.controller
    assert shown["connected_seconds"] is None
