"""The toy bus's part of the farm file: a drive has a node number, and neither an IP address nor a MAC of its choice."""

from __future__ import annotations

from dataclasses import dataclass

from pydantic import Field

from pnfarm.buses.farm_file import FarmFilePart
from pnfarm.config.drive import DriveConfig, DriveGroup


class ToyDrives(DriveGroup):
    """Keys of a group on the toy bus."""

    node: int | None = Field(default=None, ge=0, le=126, description="Node number of the first drive; counts up.")


@dataclass(frozen=True, slots=True, kw_only=True)
class ToyDrive(DriveConfig):
    node: int | None

    def claims(self):
        return [] if self.node is None else [("node", self.node, str(self.node))]


class ToyPart(FarmFilePart):
    drives = ToyDrives

    def check_name(self, at, name, report):
        return True

    def check_group(self, at, group, report):
        if group.node is not None and group.node + group.count - 1 > 126:
            report((*at, "node"), "counts past the last node", "0 to 126")

    def drive(self, common, group, step, model, expansion):
        mac = expansion.macs.auto(common.name)
        return ToyDrive.extending(common, mac=mac, node=None if group.node is None else group.node + step)
