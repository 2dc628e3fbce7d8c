"""EtherNet/IP's part of the farm file, as :class:`pnfarm.buses.farm_file.FarmFilePart` asks for it."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING

from pnfarm.buses.devices import DevicesPart
from pnfarm.buses.ethernetip.config import checks, controller_checks
from pnfarm.buses.ethernetip.config.controller import EthernetIpController
from pnfarm.buses.ethernetip.config.device import EthernetIpDeviceConfig, EthernetIpDevices
from pnfarm.buses.ethernetip.config.drive import EthernetIpDriveConfig, EthernetIpDrives
from pnfarm.buses.farm_file import FarmFilePart
from pnfarm.config.ip import nth_ip

if TYPE_CHECKING:
    from pnfarm.buses.farm_file import Expansion
    from pnfarm.config.device import DeviceConfig
    from pnfarm.config.drive import DriveConfig
    from pnfarm.config.ip import Macs
    from pnfarm.config.known import ModelFacts

__all__ = ["ETHERNETIP_PART", "EthernetIpPart"]


class EthernetIpPart(FarmFilePart[EthernetIpDrives, EthernetIpController], DevicesPart):
    """See the module's docstring."""

    drives = EthernetIpDrives
    controller = EthernetIpController
    together = MappingProxyType({"ip": ("ip", "gateway")})
    judged_by_model = frozenset({"rpi"})
    check_name = staticmethod(checks.check_name)
    check_group = staticmethod(checks.check_group)
    check_model = staticmethod(checks.check_model)
    check_devices = staticmethod(controller_checks.check_devices)
    check_controller = staticmethod(controller_checks.check_controller)

    def drive(
        self, common: DriveConfig, group: EthernetIpDrives, step: int, model: ModelFacts | None, expansion: Expansion
    ) -> EthernetIpDriveConfig:
        del model
        return EthernetIpDriveConfig.extending(
            common,
            mac=expansion.macs.of(group, common.name, step),
            ip=nth_ip(group, step),
            gateway=group.gateway,
            rpi_ns=group.rpi_ns,
        )

    # -- devices by their files (pnfarm.buses.devices) ----------------------------------------------------------------

    devices = EthernetIpDevices
    file_reader = "pnfarm.buses.ethernetip.described.from_file"
    check_devices_group = staticmethod(checks.check_group)

    def device(self, common: DeviceConfig, group: EthernetIpDevices, step: int, macs: Macs) -> EthernetIpDeviceConfig:
        return EthernetIpDeviceConfig.of(common, group, step, macs, rpi_ns=group.rpi_ns)


ETHERNETIP_PART = EthernetIpPart()
