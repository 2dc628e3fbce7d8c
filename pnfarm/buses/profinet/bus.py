"""What PROFINET offers to the house (:class:`pnfarm.buses.bus.Bus`).

What needs the compiled engine is imported where it is used: a command that only reads files waits for no compiler.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.profinet.faults import kinds
from pnfarm.faults.catalogue import kinds_in

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from pnfarm.buses.bus import DeviceServices, InjectionHost
    from pnfarm.buses.profinet.device.device import ProfinetDevice
    from pnfarm.buses.profinet.device.segment import ProfinetSegment
    from pnfarm.drives.model import Model
    from pnfarm.faults.kind import InjectionKind
    from pnfarm.faults.parts import InjectedDrive
    from pnfarm.station.station import Station

__all__ = ["PROFINET", "Profinet"]


class Profinet:
    """A bus."""

    name = "profinet"

    @property
    def connection_states(self) -> Sequence[str]:
        from pnfarm.buses.profinet.device.view import CONNECTION_STATES

        return CONNECTION_STATES

    @property
    def usual_losses(self) -> Sequence[str]:
        from pnfarm.buses.profinet.device.view import USUAL_LOSSES

        return USUAL_LOSSES

    def channel_rows(self, model: Model) -> int:
        from pnfarm.buses.profinet.device.channels import channel_rows

        return channel_rows(model.limits.io_controllers)

    def device(self, station: Station, services: DeviceServices) -> ProfinetDevice:
        from pnfarm.buses.profinet.device.device import ProfinetDevice

        return ProfinetDevice(station, services)

    def segment(self, devices: Sequence[ProfinetDevice]) -> ProfinetSegment:
        from pnfarm.buses.profinet.device.segment import ProfinetSegment

        return ProfinetSegment(devices)

    def fault_kinds(self) -> Iterable[InjectionKind]:
        return kinds_in(kinds)

    def injected_drive(self, device: ProfinetDevice, host: InjectionHost) -> InjectedDrive:
        from pnfarm.buses.profinet.faults.drive import injected_drive

        return injected_drive(device, host)


PROFINET = Profinet()
