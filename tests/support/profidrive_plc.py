"""A PLC program for the drive that is the PROFIdrive profile alone."""

from __future__ import annotations

from hand_plc import HandPlc

#: STW1 in operation; of positions without and with the edge that starts a task.
RUN, TASK, MOVE = 0x047F, 0x043F, 0x047F
#: 100 % of a signal.
FULL = 0x4000
#: Of ZSW1.
REACHED, ACKNOWLEDGED = 0x0400, 0x1000


def running(telegram: int, **setpoints: int) -> HandPlc:
    """In operation at the speed of the set points."""
    plc = HandPlc("profidrive", telegram)
    plc.put(**setpoints)
    plc.switch_on(operation=RUN)
    plc.wait_for(lambda: bool(plc["ZSW1"] & REACHED))
    return plc
