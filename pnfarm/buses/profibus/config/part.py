"""PROFIBUS's part of the farm file, as :class:`pnfarm.buses.farm_file.FarmFilePart` asks for it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.farm_file import FarmFilePart
from pnfarm.buses.profibus.config import checks
from pnfarm.buses.profibus.config.controller import ProfibusController
from pnfarm.buses.profibus.config.drive import HIGHEST_ADDRESS, ProfibusDriveConfig, ProfibusDrives

if TYPE_CHECKING:
    from pnfarm.buses.farm_file import Expansion
    from pnfarm.config.drive import DriveConfig
    from pnfarm.config.known import ModelFacts

__all__ = ["PROFIBUS_PART", "ProfibusPart"]


class ProfibusPart(FarmFilePart[ProfibusDrives, ProfibusController]):
    """See the module's docstring."""

    drives = ProfibusDrives
    controller = ProfibusController
    check_name = staticmethod(checks.check_name)
    check_group = staticmethod(checks.check_group)
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


PROFIBUS_PART = ProfibusPart()
