"""What PROFINET offers to the house (:class:`pnfarm.buses.bus.Bus`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.profinet.faults import kinds
from pnfarm.buses.profinet.faults.drive import injected_drive
from pnfarm.faults.catalogue import kinds_in

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pnfarm.buses.bus import InjectionHost
    from pnfarm.buses.profinet.device.station import DriveStation
    from pnfarm.faults.kind import InjectionKind
    from pnfarm.faults.parts import InjectedDrive

__all__ = ["PROFINET", "Profinet"]


class Profinet:
    """A bus."""

    name = "profinet"

    def fault_kinds(self) -> Iterable[InjectionKind]:
        return kinds_in(kinds)

    def injected_drive(self, device: DriveStation, host: InjectionHost) -> InjectedDrive:
        return injected_drive(device, host)


PROFINET = Profinet()
