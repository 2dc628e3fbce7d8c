"""iocs-bad: the consumer status of the drive is BAD."""

from __future__ import annotations

from pnfarm.buses.profinet.faults.frames import ProfinetFramesEffect
from pnfarm.faults.kind import FRAMES, InjectionKind
from pnfarm.table.impairment import IOCS_BAD

__all__ = ["KIND"]


class IocsBad(ProfinetFramesEffect):
    """Of every submodule that consumes."""

    cyclic = IOCS_BAD


KIND = InjectionKind(
    "iocs-bad",
    "cyclic",
    "The drive's consumer status (IOCS) is BAD: it says that it cannot use the controller's outputs, although it still "
    "does.",
    "a cyclic frame that is changed",
    IocsBad,
    directions=("out",),
    takes=FRAMES,
    wire="Every IOCS in the drive's frames is 0x40 (BAD by the device) instead of 0x80.",
    reports="The connection stays. S7-1500: an access error at the outputs, no diagnostic interrupt (assumed). "
    "CODESYS: `xDataValid` of the controller falls, the output CS of the module is BAD.",
    place=35,
)
