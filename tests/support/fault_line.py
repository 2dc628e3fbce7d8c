"""A virtual line with a fault manager, and what its controller sees."""

from __future__ import annotations

from virtual_line import VirtualLine

from pnfarm.table.signals import ZSW1


class FaultLine(VirtualLine):
    """``add`` a fault by its fields, ``run``, look."""

    def __init__(self, drives: int = 1, **options) -> None:
        super().__init__(drives, **options)
        self.faults = self.farm.injections

    def add(self, kind: str, on: object = "all", **fields):
        renamed = {key.rstrip("_"): value for key, value in fields.items()}
        return self.faults.inject({"kind": kind, "on": on, **renamed}, self.world.now)

    def clear(self, fault_id: str | None = None):
        return self.faults.clear(fault_id, self.world.now)

    def until(self, condition, within: float = 5.0) -> bool:
        return self.world.run(within, until=condition)

    def session(self, index: int = 0):
        return self.plc.sessions[index]

    def input_row(self, index: int = 0):
        """The controller's consumer of one drive."""
        return self.plc.columns.cpm[self.session(index).consumer]

    def output_row(self, index: int = 0):
        return self.plc.columns.ppm[self.session(index).provider]

    def drive_row(self, index: int = 0):
        """The drive's consumer."""
        (ar,) = self.farm.axes[index].device.ars.values()
        return self.farm.columns.cpm[ar.consumers[0][0]]

    def seen_zsw1(self, index: int = 0) -> int:
        return int(self.plc.columns.image[index].received[ZSW1]) & 0xFFFF

    def losses(self, index: int = 0) -> int:
        return self.session(index).measures.losses

    def rows_free(self) -> bool:
        """No impairment is left behind."""
        return not self.farm.columns.impairment["kind"].any()


def enabled_line() -> FaultLine:
    """One drive in operation."""
    line = FaultLine()
    line.connect()
    line.enable()
    line.run(0.1)
    return line
