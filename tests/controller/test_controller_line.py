"""The farm and the built-in controller, the whole way through, in virtual time."""

import pytest
from virtual_line import VirtualLine


@pytest.mark.parametrize("startup", ["legacy", "advanced"])
def test_controller_finds_addresses_connects_and_runs_a_drive(startup):
    line = VirtualLine(startup=startup)
    line.connect()
    line.enable()
    line.run(1.0)
    axis = line.farm.columns.axis[0]
    assert axis.state == 4
    assert axis.velocity == pytest.approx(60.0, abs=0.3)
    assert "ar established" in line.events("axis-01")
