"""The state tables of compiled machines: where nothing that holds leads anywhere, they are not looked at."""

import numpy as np
import pytest

from pnfarm.firmware import state_machine
from pnfarm.firmware.motion import positioning
from pnfarm.firmware.profidrive import sensor_interface
from pnfarm.firmware.transitions import as_array, possible


@pytest.mark.parametrize("machine", [state_machine, positioning, sensor_interface])
def test_the_events_that_are_possible_in_a_state_are_those_of_its_table(machine):
    table = as_array(machine.TRANSITIONS, machine.STATES, machine.EVENTS)
    sets = possible(machine.TRANSITIONS, machine.STATES)
    for state in range(machine.STATES):
        leading = {event for event in range(machine.EVENTS) if table[state, event] >= 0}
        assert {event for event in range(machine.EVENTS) if sets[state] >> event & 1} == leading
        # each of them is looked at
        assert leading <= set(machine.PRIORITY)


def test_outside_of_operation_positioning_waits_for_its_beginning_and_for_nothing_else():
    sets = possible(positioning.TRANSITIONS, positioning.STATES)
    assert sets[positioning.OUT] == np.int64(1 << positioning.ENTER)
