"""What PROFINET offers to the house (:class:`pnfarm.buses.bus.Bus`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.profinet.device.channels import channel_rows
from pnfarm.buses.profinet.device.device import ProfinetDevice
from pnfarm.buses.profinet.device.segment import ProfinetSegment
from pnfarm.buses.profinet.device.view import CONNECTION_STATES, USUAL_LOSSES
from pnfarm.buses.profinet.faults import kinds
from pnfarm.buses.profinet.faults.drive import injected_drive
from pnfarm.faults.catalogue import kinds_in

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from pnfarm.buses.bus import DeviceServices, InjectionHost
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
        return CONNECTION_STATES

    @property
    def usual_losses(self) -> Sequence[str]:
        return USUAL_LOSSES

    def channel_rows(self, model: Model) -> int:
        return channel_rows(model.limits.io_controllers)

    def device(self, station: Station, services: DeviceServices) -> ProfinetDevice:
        return ProfinetDevice(station, services)

    def segment(self, devices: Sequence[ProfinetDevice]) -> ProfinetSegment:
        return ProfinetSegment(devices)

    def fault_kinds(self) -> Iterable[InjectionKind]:
        return kinds_in(kinds)

    def injected_drive(self, device: ProfinetDevice, host: InjectionHost) -> InjectedDrive:
        return injected_drive(device, host)


PROFINET = Profinet()
