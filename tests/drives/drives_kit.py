"""A drive without an engine, for the tests of this folder."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from stepping import pass_time

from pnfarm.drives.axis_handle import AxisHandle
from pnfarm.drives.catalogue import model
from pnfarm.drives.description.model import Model
from pnfarm.drives.parameters.parameter import ParameterError
from pnfarm.drives.parameters.store import ParameterStore
from pnfarm.firmware.axis import AXIS
from pnfarm.table.image import IMAGE, LOST_NOT
from pnfarm.table.signals import NSOLL_A, STW1, ZSW1

if TYPE_CHECKING:
    from collections.abc import Callable

MS = 1_000_000
#: Manuals and captures beside the project; tests skip where they are absent.
SHARED = Path(__file__).resolve().parents[2].parent / "shared"


@dataclass
class Drive:
    """One drive without an engine: its rows of the table and its parameters."""

    model: Model
    axis: Any
    image: Any
    store: ParameterStore
    rows: tuple[Any, Any]

    def pass_time(self, now: int, milliseconds: int, *, frames: bool = True) -> int:
        """One step of the firmware each millisecond, each with a frame of valid set points; the time behind them."""
        return int(pass_time(*self.rows, now, MS, milliseconds, 0, frames))


def new_drive(name: str) -> Drive:
    described = model(name)
    rows = AXIS.allocate(3)[1:2], IMAGE.allocate(3)[1:2]
    axis, image = rows[0][0], rows[1][0]
    store = ParameterStore(described, AxisHandle(axis, image))
    described.apply_motor(axis)
    axis.front = described.front
    store.power_on()
    return Drive(described, axis, image, store, rows)


class Running:
    """A drive whose firmware is stepped by hand: ``send`` as a controller does, look at ``drive.axis``.

    Valid set points arrive each millisecond.
    """

    def __init__(self, name: str) -> None:
        self.drive = new_drive(name)
        self.axis, self.image = self.drive.axis, self.drive.image
        self.axis.powered = 1
        self.now = 0
        self.run(150)

    def run(self, milliseconds: int) -> None:
        self.now = self.drive.pass_time(self.now, milliseconds)

    def send(self, stw1: int, nsoll_a: int = 0, milliseconds: int = 1) -> int:
        """ZSW1 after so many milliseconds."""
        self.image.received[STW1], self.image.received[NSOLL_A] = stw1, nsoll_a
        self.image.valid, self.image.lost = 1, LOST_NOT
        self.run(milliseconds)
        return int(self.image.sent[ZSW1])


def refused(number: int, act: Callable[[], object]) -> ParameterError:
    """What ``act`` is refused with, which has this error number."""
    with pytest.raises(ParameterError) as caught:
        act()
    assert caught.value.number == number
    return caught.value
