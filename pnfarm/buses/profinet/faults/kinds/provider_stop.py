"""provider-stop: the data status says STOP."""

from __future__ import annotations

from pnfarm.buses.profinet.faults.frames import ProfinetFramesEffect
from pnfarm.faults.kind import FRAMES, InjectionKind
from pnfarm.table.impairment import PROVIDER_STOP

__all__ = ["KIND"]


class ProviderStop(ProfinetFramesEffect):
    """In each cyclic frame."""

    cyclic = PROVIDER_STOP


KIND = InjectionKind(
    "provider-stop",
    "cyclic",
    "The data status says that the drive's provider is in STOP.",
    "a cyclic frame that is changed",
    ProviderStop,
    directions=("out",),
    takes=FRAMES,
    place=10,
    wire="Data status without the bit ProviderState (0x10): the drive's application is in STOP.",
    reports="S7-1500: I/O access error for the inputs (assumed). CODESYS: the inputs are not updated (assumed).",
)
