"""The PROFIdrive general state machine, as a table.

States (PROFIdrive 4.x, 6.3.2; AKD PROFINET manual 5.3, whose figure is missing, and 5.9):

====  ========================  ============
S1    switching on inhibited    ZSW1.6
S2    ready for switching on    ZSW1.0
S3    switched on               ZSW1.0, 1
S4    operation                 ZSW1.0, 1, 2
S5    switching off             ZSW1.0, 1
====  ========================  ============

S5 appears three times in the table, because its next state depends on why the axis stops: a ramp stop,
a quick stop, or a fault with a controlled stop.  Events are conditions on STW1, the motor and the fault
buffer; of those that hold in one step, the first in :data:`PRIORITY` for which the table has a row wins.

One function writes the state: :func:`advance`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pnfarm.firmware.transitions import as_array, possible
from pnfarm.table.axis_codes import POWER_ENABLE, POWER_NO_COAST, POWER_NO_QUICK_STOP, POWER_ON
from pnfarm.table.compiling.compiled import compiled, inlined

__all__ = ["PRIORITY", "S5_FAULT", "S5_QUICK", "S5_RAMP", "TRANSITIONS", "advance", "conditions"]


BOOT = 0
S1 = 1
S2 = 2
S3 = 3
S4 = 4
S5_RAMP = 5
S5_QUICK = 6
S5_FAULT = 7
STATES = 8

# Events.
BOOTED = 0  # the drive's start-up is over
COAST = 1  # STW1.1 = 0, coast stop
QUICK = 2  # STW1.2 = 0, quick stop
OFF = 3  # STW1.0 = 0
ON = 4  # STW1.0 = 1
ENABLE = 5  # STW1.3 = 1
DISABLE = 6  # STW1.3 = 0
READY = 7  # STW1.0 = 0, 1 = 1, 2 = 1 and no fault
STANDSTILL = 8  # the axis stands
TRIP = 9  # a fault without a controlled stop
TRIP_STOP = 10  # a fault with a controlled stop
RELEASED = 11  # STW1.2 = 1 again, where the drive stays in its quick stop (Moog MSD manual, table 10.7, transition 10)
EVENTS = 12

#: (state, event) -> next state, row by row as in the profile's figure.
TRANSITIONS: dict[tuple[int, int], int] = {
    (BOOT, BOOTED): S1,
    # switching on inhibited
    (S1, READY): S2,
    # ready for switching on
    (S2, TRIP): S1,
    (S2, TRIP_STOP): S1,
    (S2, COAST): S1,
    (S2, QUICK): S1,
    (S2, ON): S3,
    # switched on
    (S3, TRIP): S1,
    (S3, TRIP_STOP): S1,
    (S3, COAST): S1,
    (S3, QUICK): S1,
    (S3, OFF): S2,
    (S3, ENABLE): S4,
    # operation
    (S4, TRIP): S1,
    (S4, TRIP_STOP): S5_FAULT,
    (S4, COAST): S1,
    (S4, QUICK): S5_QUICK,
    (S4, OFF): S5_RAMP,
    (S4, DISABLE): S3,
    # switching off: ramp stop
    (S5_RAMP, TRIP): S1,
    (S5_RAMP, TRIP_STOP): S5_FAULT,
    (S5_RAMP, COAST): S1,
    (S5_RAMP, QUICK): S5_QUICK,
    (S5_RAMP, ON): S4,
    (S5_RAMP, STANDSTILL): S2,
    (S5_RAMP, DISABLE): S2,
    # switching off: quick stop
    (S5_QUICK, TRIP): S1,
    (S5_QUICK, TRIP_STOP): S5_FAULT,
    (S5_QUICK, COAST): S1,
    (S5_QUICK, STANDSTILL): S1,
    (S5_QUICK, RELEASED): S4,
    (S5_QUICK, DISABLE): S1,
    # switching off: fault reaction
    (S5_FAULT, TRIP): S1,
    (S5_FAULT, COAST): S1,
    (S5_FAULT, STANDSTILL): S1,
}

#: Priority of events that hold together: faults, then the stops from the hardest to the softest.
PRIORITY = (BOOTED, TRIP, TRIP_STOP, COAST, QUICK, OFF, DISABLE, STANDSTILL, RELEASED, READY, ON, ENABLE)

_NEXT = as_array(TRANSITIONS, STATES, EVENTS)
_POSSIBLE = possible(TRANSITIONS, STATES)
_PRIORITY = np.array(PRIORITY, np.int64)


@inlined
def conditions(power: int, faulty: int, reaction: int, standing: int, booted: int) -> int:
    """The events that hold now, as a bit set.

    ``power``: POWER_*; ``faulty``: a fault is active; ``reaction``: 1 = it requires a controlled stop.
    """
    held = 0
    if booted:
        held |= 1 << BOOTED
    if faulty:
        held |= 1 << (TRIP_STOP if reaction else TRIP)
    if not power & POWER_NO_COAST:
        held |= 1 << COAST
    if not power & POWER_NO_QUICK_STOP:
        held |= 1 << QUICK
    held |= 1 << (ON if power & POWER_ON else OFF)
    held |= 1 << (ENABLE if power & POWER_ENABLE else DISABLE)
    if (
        power & (POWER_ON | POWER_NO_COAST | POWER_NO_QUICK_STOP)
    ) == POWER_NO_COAST | POWER_NO_QUICK_STOP and not faulty:
        held |= 1 << READY
    if standing:
        held |= 1 << STANDSTILL
    return held


@compiled
def advance(drive: Any, held: int) -> None:
    """Take at most one transition: the only writer of ``axis.drive.state`` and ``axis.drive.stop``."""
    state = drive.state
    if state == 5:
        state = 4 + drive.stop
    held &= _POSSIBLE[state]
    if held == 0:
        return
    for event in _PRIORITY:
        if held & (1 << event):
            following = _NEXT[state, event]
            if following > 4:
                drive.state = 5
                drive.stop = following - 4
            else:
                drive.state = following
                drive.stop = 0
            return
