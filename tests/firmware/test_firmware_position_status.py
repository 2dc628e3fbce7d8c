"""What position mode tells of rest and direction: ZSW1.13 and POS_ZSW2, where no profile and the shaft disagree."""

from __future__ import annotations

import pytest
from test_firmware_positioning import HOME, HOMED, ON_TARGET, STOPPED, Positioner

FORWARDS, BACKWARDS = 0x0010, 0x0020


@pytest.mark.parametrize("distance", [-0.5, 0.0, 0.5])
def test_5_10_3_bits_10_11_and_13_stay_0_until_homing_is_over_also_where_it_turns_at_the_mark(distance):
    """AKD PROFINET manual 5.10.3: false while homing runs, true when it is finished."""
    drive = Positioner(homed=False)
    drive.axis.home_distance = distance
    # CS.VTHRESH: what counts as rest
    drive.axis.standstill = 100.0
    drive.stand_at(0.4)
    seen = drive.stw(HOME)
    while not seen & HOMED:
        assert not seen & (ON_TARGET | STOPPED)
        drive.run(1)
        seen = drive.zsw1
        assert drive.now < 10e9
    drive.until(ON_TARGET | HOMED | STOPPED)
    assert drive.axis.position == pytest.approx(1.0 + distance, abs=0.01)
