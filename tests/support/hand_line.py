"""One drive whose controller's words a test writes by hand, frame by frame, over the wire in virtual time."""

from __future__ import annotations

from virtual_line import VirtualLine

from pnfarm.table import signals
from pnfarm.table.signals import STW1


class HandLine(VirtualLine):
    """``send`` a control word and other set points, and look at what the drive's frames bring back."""

    def __init__(self, drives: int = 1, *, cycle: str = "16ms", **options) -> None:
        super().__init__(drives, cycle=cycle, **options)
        self._cycle = float(cycle.removesuffix("ms")) / 1000
        self.connect()
        self.plc.columns.program[0].active = 0
        self.run(4 * self._cycle)

    def send(self, stw1: int, *, frames: int = 4, **words: int) -> int:
        """Write STW1 and set points by their names, and wait so many cycles; ZSW1 as it came back."""
        image = self.plc.columns.image[0]
        image.sent[STW1] = stw1
        for name, value in words.items():
            image.sent[getattr(signals, name)] = value
        self.run(frames * self._cycle)
        return self.zsw1

    def enable_axis(self, word: int) -> None:
        """Walk the states up to operation."""
        for stw1 in (word & ~0x000F, word & ~0x0009, word & ~0x0008, word):
            self.send(stw1)
        assert self.zsw1 & 0x0007 == 0x0007, f"0x{self.zsw1:04X}"

    @property
    def zsw1(self) -> int:
        return self.actual("ZSW1") & 0xFFFF

    def actual(self, name: str) -> int:
        """An actual value as the controller has it."""
        return int(self.plc.columns.image[0].received[getattr(signals, name)])

    def until(self, bits: int, within: float = 20.0) -> float:
        """Virtual seconds until these bits of ZSW1 are set."""
        begun = self.world.now
        assert self.world.run(within, until=lambda: self.zsw1 & bits == bits), f"0x{self.zsw1:04X}"
        return (self.world.now - begun) / 1e9

    @property
    def axis(self):
        return self.farm.columns.axis[0]

    @property
    def place(self) -> float:
        """The machine's position, rev."""
        return float(self.axis.motor.position) - float(self.axis.homing.origin)
