"""PROFINET's part of the farm file, as :class:`pnfarm.buses.farm_file.FarmFilePart` asks for it."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING

from pnfarm.buses.devices import DevicesPart
from pnfarm.buses.farm_file import FarmFilePart
from pnfarm.buses.profinet.config import checks
from pnfarm.buses.profinet.config.controller import ProfinetController
from pnfarm.buses.profinet.config.device import ProfinetDeviceConfig, ProfinetDevices
from pnfarm.buses.profinet.config.drive import ProfinetDriveConfig, ProfinetDrives
from pnfarm.buses.profinet.config.send_clock import own_cycle_ns
from pnfarm.config.drive import AxisConfig
from pnfarm.config.ip import check_addresses, nth_ip

if TYPE_CHECKING:
    from pnfarm.buses.farm_file import Expansion
    from pnfarm.config.device import DeviceConfig
    from pnfarm.config.drive import DriveConfig
    from pnfarm.config.ip import Macs
    from pnfarm.config.known import ModelFacts

__all__ = ["PROFINET_PART", "ProfinetPart"]

_CLOCK = ("cycle", "send_clock_factor", "reduction_ratio", "watchdog_factor")


class ProfinetPart(FarmFilePart[ProfinetDrives, ProfinetController], DevicesPart):
    """See the module's docstring."""

    drives = ProfinetDrives
    controller = ProfinetController
    together = MappingProxyType(
        {"ip": ("ip", "gateway"), "cycle": _CLOCK, "send_clock_factor": _CLOCK, "reduction_ratio": _CLOCK}
    )
    judged_by_model = frozenset({"telegram", "supplementary", "cycle"})
    check_name = staticmethod(checks.check_name)
    check_group = staticmethod(check_addresses)
    check_model = staticmethod(checks.check_model)
    check_devices = staticmethod(checks.check_devices)
    check_controller = staticmethod(checks.check_controller)

    def drive(
        self,
        common: DriveConfig,
        group: ProfinetDrives,
        step: int,
        model: ModelFacts | None,
        expansion: Expansion,
    ) -> ProfinetDriveConfig:
        controller = expansion.controller if isinstance(expansion.controller, ProfinetController) else None
        several = tuple(
            AxisConfig.of(
                axis,
                common,
                telegram=group.telegram if axis.telegram is None else axis.telegram,
                supplementary=group.supplementary if axis.supplementary is None else axis.supplementary,
                slot=axis.slot,
            )
            for axis in group.axes
        )
        return ProfinetDriveConfig.extending(
            common,
            several=several,
            mac=expansion.macs.of(group, common.name, step),
            ip=nth_ip(group, step),
            gateway=group.gateway,
            telegram=group.telegram,
            supplementary=group.supplementary,
            ignores_clock=group.isochronous == "ignore",
            hello=group.hello,
            maker=group.described,
            cycle_ns=own_cycle_ns(group, controller, model),
        )

    # -- devices by their files (pnfarm.buses.devices) ----------------------------------------------------------------

    devices = ProfinetDevices
    file_reader = "pnfarm.buses.profinet.described.from_file"
    check_devices_group = staticmethod(check_addresses)

    def device(self, common: DeviceConfig, group: ProfinetDevices, step: int, macs: Macs) -> ProfinetDeviceConfig:
        return ProfinetDeviceConfig.of(
            common, group, step, macs, hello=group.hello, cycle_ns=group.cycle_ns, cycles=group.cycles
        )


PROFINET_PART = ProfinetPart()
