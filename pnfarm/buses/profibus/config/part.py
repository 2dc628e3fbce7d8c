"""PROFIBUS's part of the farm file, as :class:`pnfarm.buses.farm_file.FarmFilePart` asks for it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.farm_file import CONTROLLER
from pnfarm.buses.profibus.config import checks
from pnfarm.buses.profibus.config.controller import ProfibusController
from pnfarm.buses.profibus.config.drive import HIGHEST_ADDRESS, ProfibusDriveConfig, ProfibusDrives

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pnfarm.buses.farm_file import Claims, Expansion, PlacedGroup
    from pnfarm.config.drive import DriveConfig
    from pnfarm.config.known import Known, ModelFacts
    from pnfarm.vocabulary.issues import Location, Report

__all__ = ["PROFIBUS_PART", "ProfibusPart"]


class ProfibusPart:
    """See the module's docstring."""

    @property
    def drives(self) -> type[ProfibusDrives]:
        return ProfibusDrives

    @property
    def controller(self) -> type[ProfibusController]:
        return ProfibusController

    @property
    def together(self) -> Mapping[str, Sequence[str]]:
        return {}

    @property
    def judged_by_model(self) -> frozenset[str]:
        return frozenset()

    def check_name(self, at: Location, name: str, report: Report) -> bool:
        return checks.check_name(at, name, report)

    def check_group(self, at: Location, group: ProfibusDrives, report: Report) -> None:
        checks.check_group(at, group, report)

    def check_model(self, at: Location, group: ProfibusDrives, model: ModelFacts, report: Report) -> None:
        """Nothing depends on the model."""

    def check_devices(self, controller: ProfibusController, claims: Claims, report: Report) -> None:
        own = ("profibus", controller.address)
        if (by := claims.claim("address", own, CONTROLLER, controller.name)) is not None:
            what = f"station address {controller.address} belongs to {by} already"
            report(("controller", "address"), what, "each once on the line")
        checks.check_devices(controller, claims, report)

    def check_controller(
        self,
        controller: ProfibusController,
        groups: Sequence[PlacedGroup[ProfibusDrives]],
        known: Known,
        report: Report,
    ) -> None:
        if controller.telegram is None:
            return
        for placed in groups:
            model = known.model(placed.group.model)
            if model is not None and controller.telegram not in model.telegrams:
                numbers = ", ".join(str(number) for number in model.telegrams)
                report(("controller", "telegram"), f"{model.name} has no telegram {controller.telegram}", numbers)
                return

    def drive(
        self,
        common: DriveConfig,
        group: ProfibusDrives,
        step: int,
        model: ModelFacts | None,
        expansion: Expansion,
    ) -> ProfibusDriveConfig:
        del expansion
        switches = group.address + step if group.address <= HIGHEST_ADDRESS else group.address
        control_unit = None if group.control_unit is None else group.control_unit + step
        address: int | None = switches
        if switches > HIGHEST_ADDRESS:
            address = control_unit if control_unit is not None else checks.address_in(common.params, model)
        return ProfibusDriveConfig.extending(common, switches=switches, control_unit=control_unit, address=address)


PROFIBUS_PART = ProfibusPart()
