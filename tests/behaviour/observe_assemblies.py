"""What readings of the points of drives on EtherNet/IP show."""

from __future__ import annotations

import assembly_points
from open_points import observes


@observes("enable-behind-fault", {"rises-again": False, "switches-on": True})
def enable_behind_fault(name: str, behaviour: str) -> object:
    assert name == assembly_points.NAME
    return assembly_points.enable_behind_fault(behaviour)


@observes("idle-controller", {"coasts": False, "stops": True})
def idle_controller(name: str, behaviour: str) -> object:
    assert name == assembly_points.NAME
    return assembly_points.idle_controller(behaviour)
