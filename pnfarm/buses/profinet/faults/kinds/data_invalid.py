"""data-invalid: the data status says that the data is not valid."""

from __future__ import annotations

from pnfarm.buses.profinet.faults.frames import ProfinetFramesEffect
from pnfarm.faults.kind import FRAMES, InjectionKind
from pnfarm.table.impairment import DATA_INVALID

__all__ = ["KIND"]


class DataInvalid(ProfinetFramesEffect):
    """In each cyclic frame."""

    cyclic = DATA_INVALID


KIND = InjectionKind(
    "data-invalid",
    "cyclic",
    "The data status says that the drive's data is not valid; controllers discard such frames.",
    "a cyclic frame that is changed",
    DataInvalid,
    directions=("out",),
    takes=FRAMES,
    place=20,
    wire="Data status without the bit DataValid (0x04).",
    reports="The frames are discarded; after the watchdog, IO device failure (S7-1500: OB86; CODESYS: the device is "
    "shown as not running (assumed)).",
)
