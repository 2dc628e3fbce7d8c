"""Tests of a real PLC: `pytest --pnfarm-rig line.pnfarm.yml`, or the URL of a farm that runs.

The farm file has the drives that the PLC expects, on the network card that is wired to it.  Without the option these
tests are skipped.
"""

import pytest


@pytest.fixture
def axis(pnfarm_rig):
    pnfarm_rig.wait_running(within=60)
    return pnfarm_rig.drives[0]


def test_the_plc_stops_a_tripped_axis_and_brings_it_back(axis):
    with axis.inject("f702", count=1):
        axis.wait_for("not stw1.enable_operation or not stw1.on", within="500ms")
    axis.wait_for("state == S4 and fault == 0", within=10)


def test_the_plc_reconnects_to_a_silent_drive(axis):
    with axis.inject("silence", for_=2) as fault:
        axis.wait_for("not connected", within=2)
    assert fault.evidence.confirmed
    axis.wait_for("connected", within=10)


def test_the_other_axes_run_on(pnfarm_rig, axis):
    others = pnfarm_rig.drives[1:]
    before = [drive.snapshot()["connects"] for drive in others]
    with axis.inject("link-down", for_=1):
        axis.wait_for("not connected", within=2)
    axis.wait_for("state == S4", within=20)
    assert [drive.snapshot()["connects"] for drive in others] == before
