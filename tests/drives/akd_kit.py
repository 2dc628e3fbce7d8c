"""The AKD of manual edition M under its firmware: enabled, in position mode, and what it refuses."""

from __future__ import annotations

import pytest
from drives_kit import Running

from pnfarm.drives.parameters.parameter import ParameterError, ParameterErrorNumber
from pnfarm.table.signals import MDI_ACC, MDI_DEC, MDI_MOD, MDI_TARPOS, MDI_VELOCITY, SATZANW

NAME = "akd-profinet"
E = ParameterErrorNumber


def enable(drive: Running, word: int = 0x047F, nsoll_a: int = 0) -> None:
    for stw1 in (word & ~0x000F, word & ~0x0009, word & ~0x0008, word):
        drive.send(stw1, nsoll_a)
    drive.send(word, nsoll_a)
    assert drive.axis.drive.state == 4


def refused(number: int, store: object, name: str | int, value: int = 1) -> None:
    with pytest.raises(ParameterError) as caught:
        store.set(name, value)  # type: ignore[attr-defined]
    assert caught.value.number == number


class Positioning(Running):
    """In position mode, operation enabled, telegram 9; homed at its position."""

    def __init__(self, *, homed: bool = True) -> None:
        super().__init__(NAME)
        self.drive.store.plug_telegram(9)
        self.drive.store.set("DRV.OPMODE", 2)
        enable(self, 0x043F)
        if homed:
            self.send(0x0C3F, milliseconds=5)
            assert self.send(0x043F) & 0x0800
        received = self.image.received
        received[SATZANW], received[MDI_MOD] = 0x8000, 1
        received[MDI_VELOCITY], received[MDI_ACC], received[MDI_DEC] = 2**32 // 20, 40, 40

    def move(self, counts: int, milliseconds: int = 3000) -> int:
        self.image.received[MDI_TARPOS] = counts
        self.send(0x047F, milliseconds=20)
        return self.send(0x043F, milliseconds=milliseconds)
