"""iops-bad: the provider status of the drive's data is BAD."""

from __future__ import annotations

from pnfarm.buses.profinet.faults.alarms import ALARMS
from pnfarm.buses.profinet.faults.frames import ProfinetFramesEffect
from pnfarm.faults.kind import FRAMES, InjectionKind
from pnfarm.table.impairment import IOPS_BAD

__all__ = ["KIND"]


class IopsBad(ProfinetFramesEffect):
    """When it ends on the same connection, the submodules return (alarm 0x000B)."""

    alarms = ALARMS
    cyclic = IOPS_BAD

    def end(self, now: int) -> None:
        super().end(now)
        last = self.evidence().last_ns
        if last is not None:
            self.alarms.return_of_submodules(last, now)


KIND = InjectionKind(
    "iops-bad",
    "cyclic",
    "The drive's provider status (IOPS) is BAD.  When it is GOOD again during the connection, the drive sends the "
    "alarm 'return of submodule'.",
    "a cyclic frame that is changed",
    IopsBad,
    directions=("out",),
    takes=FRAMES,
    place=30,
    wire="The IOPS of each submodule with input data is 0x40 (BAD by the device) instead of 0x80; submodules without "
    "data keep theirs. At the end an alarm 'return of submodule'.",
    reports="S7-1500: I/O access error (OB122 at direct access), the inputs read 0; the return calls OB83. CODESYS: "
    "`xDataValid` of the controller falls, the input PS of the module is BAD.",
)
