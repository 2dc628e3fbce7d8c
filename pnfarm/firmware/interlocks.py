"""Interlocks that keep a drive from operation, and its quick stop, where they depart from the profile's state machine.

They only change the set of events that :func:`pnfarm.firmware.state_machine.advance` sees; the table is the same.

* A drive without its hardware enable or with a DC link that is too low coasts to S1 and stays there (Moog MSD manual,
  table 10.7, transitions 1, 8 and 16), as does one whose encoder is parked.
* An input for a controlled stop brakes it along the quick stop ramp and keeps it in S1 (AKD PROFINET manual 5.8.1 and
  5.6; AKD parameter reference, DIN1.MODE 13).
* S3 may be reached by STW1.3 as by STW1.0 (AKD PROFINET manual 7.1.4), and OFF in operation may act without a ramp
  (Moog MSD manual, table 10.7, transition 6).
* S1 may be left with STW1.0 set (transition 2), and S3 only on a rising edge of the enable (transition 4 with
  P-0144 = 0): STW1.0 and 3 together, so that a controller that leaves one of them set, as the profile allows, can start
  the drive.
* The quick stop option codes of table 10.3.
"""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.causes import cause_held
from pnfarm.firmware.faults import acknowledge
from pnfarm.firmware.state_machine import (
    COAST,
    DISABLE,
    ENABLE,
    OFF,
    ON,
    QUICK,
    READY,
    RELEASED,
    STANDSTILL,
)
from pnfarm.table.axis_codes import (
    LACKS_ENABLE,
    LACKS_RELEASE,
    LACKS_SUPPLY,
    POWER_ENABLE,
    POWER_NO_COAST,
    POWER_NO_QUICK_STOP,
    POWER_ON,
    QUICK_STOP_COAST,
    QUICK_STOP_CURRENT,
    QUICK_STOP_PROFILE,
    QUICK_STOP_RAMP,
    QUICK_STOP_STAYS,
    SENSOR_PARKING,
)
from pnfarm.table.compiling.compiled import inlined

__all__ = ["at_once", "enabled_by_hardware", "quick_stop_ramp", "take_interlocks", "torque_free", "with_interlocks"]

NO_STOP = POWER_NO_COAST | POWER_NO_QUICK_STOP
RUN = POWER_ON | POWER_ENABLE
RAMP_STOP = 1  # ``drive.stop``


@inlined
def take_interlocks(axis: Any) -> None:
    """Once in each step, before the events: what the drive lacks, and edges of the hardware enable and of STW1's.

    Every status of hardware enable, stop inputs and supply is derived from ``drive.lacks``.
    """
    lacks = int(axis.drive.settings.interlocks)
    if axis.machine.stop_input:
        lacks |= LACKS_RELEASE
    if axis.drive.settings.enable_acknowledges and int(axis.drive.lacks) & ~lacks & LACKS_ENABLE:
        acknowledge(axis.faults, axis.positioning, True)
    axis.drive.lacks = lacks
    if (int(axis.orders.power) & RUN) != RUN or axis.drive.state < 2 or axis.drive.state > 3:
        axis.drive.enable_rose = 0
    elif int(axis.orders.power_changed) & RUN:
        axis.drive.enable_rose = 1


@inlined
def _stays(drive: Any) -> bool:
    return drive.settings.quick_stop_option > QUICK_STOP_STAYS


@inlined
def _with_quick_stop(drive: Any, orders: Any, held: int) -> int:
    """Apply the option codes: a coast instead of a stop, or a stop in which the drive stays until it is withdrawn."""
    if drive.settings.quick_stop_option == QUICK_STOP_PROFILE:
        return held
    if drive.settings.quick_stop_option == QUICK_STOP_COAST and held & (1 << QUICK):
        held |= 1 << COAST
    if drive.state == 5 and drive.stop == 2:
        # "first reset quick stop request": withdrawing STW1.3 has no effect until then
        held &= ~(1 << DISABLE)
        if _stays(drive):
            held &= ~(1 << STANDSTILL)
            if int(orders.power) & POWER_NO_QUICK_STOP:
                held |= 1 << RELEASED
    return held


@inlined
def with_interlocks(drive: Any, orders: Any, sensor: Any, held: int, power: int, faulty: int) -> int:
    """The events of :func:`~pnfarm.firmware.state_machine.conditions`, as this drive sees them."""
    if drive.settings.ready_with_on and (power & NO_STOP) == NO_STOP and not faulty:
        held |= 1 << READY
    if drive.settings.enable_by_edge and not drive.enable_rose:
        held &= ~(1 << ENABLE)
    if drive.settings.on_by_enable and drive.state < 4 and power & RUN == POWER_ENABLE:
        held = (held | 1 << ON) & ~(1 << OFF | 1 << ENABLE)
    if drive.settings.off_at_once and drive.state == 5 and drive.stop == RAMP_STOP:
        held |= 1 << DISABLE
    if int(drive.lacks) & (LACKS_ENABLE | LACKS_SUPPLY) or sensor.state == SENSOR_PARKING:
        held |= 1 << COAST
        held &= ~(1 << READY)
    if int(drive.lacks) & LACKS_RELEASE:
        held |= 1 << QUICK
        held &= ~(1 << READY)
    return _with_quick_stop(drive, orders, held)


@inlined
def quick_stop_ramp(drive: Any, ramp: Any, usual: float) -> float:
    """The ramp of the present quick stop, rpm/s; ``usual`` is the quick stop ramp."""
    option = int(drive.settings.quick_stop_option)
    if _stays(drive):
        option -= QUICK_STOP_STAYS
    return ramp.down if option == QUICK_STOP_RAMP else usual


@inlined
def at_once(drive: Any) -> bool:
    """Whether the present quick stop has no ramp: speed 0 at the current limit."""
    option = int(drive.settings.quick_stop_option)
    if _stays(drive):
        option -= QUICK_STOP_STAYS
    return option == QUICK_STOP_CURRENT


@inlined
def torque_free(faults: Any) -> bool:
    """Whether safe torque off is requested: the cause of its fault is present."""
    return cause_held(faults, int(faults.settings.sto_fault))


@inlined
def enabled_by_hardware(drive: Any, faults: Any) -> bool:
    """Whether hardware enable and safe stop let the drive run: ZSW1.14 of Moog MSD manual, table 10.8."""
    return not torque_free(faults) and not int(drive.lacks) & LACKS_ENABLE
