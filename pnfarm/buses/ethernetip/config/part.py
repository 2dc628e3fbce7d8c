"""EtherNet/IP's part of the farm file, as :class:`pnfarm.buses.farm_file.FarmFilePart` asks for it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.ethernetip.config import checks, controller_checks
from pnfarm.buses.ethernetip.config.controller import EthernetIpController
from pnfarm.buses.ethernetip.config.drive import EthernetIpDriveConfig, EthernetIpDrives
from pnfarm.config.ip import nth_ip

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pnfarm.buses.farm_file import Claims, Expansion, PlacedGroup
    from pnfarm.config.drive import DriveConfig
    from pnfarm.config.known import Known, ModelFacts
    from pnfarm.vocabulary.issues import Location, Report

__all__ = ["ETHERNETIP_PART", "EthernetIpPart"]


class EthernetIpPart:
    """See the module's docstring."""

    @property
    def drives(self) -> type[EthernetIpDrives]:
        return EthernetIpDrives

    @property
    def controller(self) -> type[EthernetIpController]:
        return EthernetIpController

    @property
    def together(self) -> Mapping[str, Sequence[str]]:
        return {"ip": ("ip", "gateway")}

    @property
    def judged_by_model(self) -> frozenset[str]:
        return frozenset({"rpi"})

    def check_name(self, at: Location, name: str, report: Report) -> bool:
        return checks.check_name(at, name, report)

    def check_group(self, at: Location, group: EthernetIpDrives, report: Report) -> None:
        checks.check_group(at, group, report)

    def check_model(self, at: Location, group: EthernetIpDrives, model: ModelFacts, report: Report) -> None:
        checks.check_model(at, group, model, report)

    def check_devices(self, controller: EthernetIpController, claims: Claims, report: Report) -> None:
        controller_checks.check_devices(controller, claims, report)

    def check_controller(
        self,
        controller: EthernetIpController,
        groups: Sequence[PlacedGroup[EthernetIpDrives]],
        known: Known,
        report: Report,
    ) -> None:
        controller_checks.check_controller(controller, groups, known, report)

    def drive(
        self,
        common: DriveConfig,
        group: EthernetIpDrives,
        step: int,
        model: ModelFacts | None,
        expansion: Expansion,
    ) -> EthernetIpDriveConfig:
        del model
        return EthernetIpDriveConfig.extending(
            common,
            mac=expansion.macs.of(group, common.name, step),
            ip=nth_ip(group, step),
            gateway=group.gateway,
            rpi_ns=group.rpi_ns,
        )


ETHERNETIP_PART = EthernetIpPart()
