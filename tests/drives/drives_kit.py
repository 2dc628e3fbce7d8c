"""A drive without an engine, for the tests of this folder."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pnfarm.drives.axis_handle import AxisHandle
from pnfarm.drives.catalogue import model
from pnfarm.drives.model import Model
from pnfarm.drives.store import ParameterStore
from pnfarm.table.axis import AXIS
from pnfarm.table.image import IMAGE

#: Manuals and captures beside the project; tests skip where they are absent.
SHARED = Path(__file__).resolve().parents[2].parent / "shared"


@dataclass
class Drive:
    """One drive without an engine: its rows of the table and its parameters."""

    model: Model
    axis: Any
    image: Any
    store: ParameterStore


def new_drive(name: str) -> Drive:
    described = model(name)
    axis, image = AXIS.allocate(3)[1], IMAGE.allocate(3)[1]
    store = ParameterStore(described, AxisHandle(axis, image))
    described.apply_motor(axis)
    store.power_on()
    return Drive(described, axis, image, store)
