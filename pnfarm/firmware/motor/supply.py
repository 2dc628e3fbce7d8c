"""The DC link's supply: whether the mains hold its voltage up.

The mains are off while the drive lacks its supply, and while the cause of its undervoltage fault is present.
"""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.causes import cause_held
from pnfarm.table.axis_codes import LACKS_SUPPLY
from pnfarm.table.compiling.compiled import inlined

__all__ = ["bus_below", "mains"]


@inlined
def _supplied(drive: Any, faults: Any, supply: Any) -> bool:
    return not int(drive.settings.interlocks) & LACKS_SUPPLY and not cause_held(
        faults, int(supply.settings.undervoltage_fault)
    )


@inlined
def mains(drive: Any, faults: Any, supply: Any) -> float:
    """The lowest voltage to which the mains let the DC link fall, V; 0 without mains."""
    return float(supply.settings.nominal) if _supplied(drive, faults, supply) else 0.0


@inlined
def bus_below(drive: Any, faults: Any, supply: Any, level: float) -> bool:
    """Whether the DC link's voltage is below ``level``, V; false for a supplied one whose voltage is not modelled."""
    return supply.voltage < level and (supply.voltage > 0.0 or not _supplied(drive, faults, supply))
