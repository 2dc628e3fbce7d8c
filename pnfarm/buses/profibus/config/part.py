"""PROFIBUS's part of the farm file, as :class:`pnfarm.buses.farm_file.FarmFilePart` asks for it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.devices import DevicesPart
from pnfarm.buses.farm_file import FarmFilePart
from pnfarm.buses.profibus.config import checks
from pnfarm.buses.profibus.config.controller import ProfibusController
from pnfarm.buses.profibus.config.device import ProfibusDeviceConfig, ProfibusDevices
from pnfarm.buses.profibus.config.drive import HIGHEST_ADDRESS, ProfibusDriveConfig, ProfibusDrives
from pnfarm.errors import InternalError

if TYPE_CHECKING:
    from pnfarm.buses.farm_file import Expansion
    from pnfarm.config.device import DeviceConfig
    from pnfarm.config.drive import DriveConfig
    from pnfarm.config.ip import Macs
    from pnfarm.config.known import ModelFacts
    from pnfarm.vocabulary.issues import Location, Report

__all__ = ["PROFIBUS_PART", "ProfibusPart"]


class ProfibusPart(FarmFilePart[ProfibusDrives, ProfibusController], DevicesPart):
    """See the module's docstring."""

    drives = ProfibusDrives
    controller = ProfibusController
    check_name = staticmethod(checks.check_name)
    check_group = staticmethod(checks.check_group)
    check_model = staticmethod(checks.check_model)
    check_devices = staticmethod(checks.check_devices)
    check_controller = staticmethod(checks.check_controller)

    def drive(
        self, common: DriveConfig, group: ProfibusDrives, step: int, model: ModelFacts | None, expansion: Expansion
    ) -> ProfibusDriveConfig:
        del expansion
        switches = group.address + step if group.address <= HIGHEST_ADDRESS else group.address
        control_unit = None if group.control_unit is None else group.control_unit + step
        address: int | None = switches
        if switches > HIGHEST_ADDRESS:
            address = control_unit if control_unit is not None else checks.address_in(common.params, model)
        return ProfibusDriveConfig.extending(common, switches=switches, control_unit=control_unit, address=address)

    # -- devices by their files (pnfarm.buses.devices) ----------------------------------------------------------------

    devices = ProfibusDevices
    file_reader = "pnfarm.buses.profibus.described.from_file"

    def check_devices_group(self, at: Location, group: ProfibusDevices, report: Report) -> None:
        checks.check_count(at, "address", group.address, group.count, report)

    def device(self, common: DeviceConfig, group: ProfibusDevices, step: int, macs: Macs) -> ProfibusDeviceConfig:
        del macs
        if group.described is None:
            raise InternalError(f"devices {group.name} are made before their file is read")
        address = None if group.address is None else group.address + step
        return ProfibusDeviceConfig.extending(
            common, kinds=group.described.kinds, described=group.described, address=address
        )


PROFIBUS_PART = ProfibusPart()
