"""stuck-axis: the machine is jammed."""

from __future__ import annotations

from pnfarm.faults.kind import HELD, InjectionKind
from pnfarm.faults.kinds.load import AddedLoad

__all__ = ["KIND"]

KIND = InjectionKind(
    "stuck-axis",
    "drive",
    "The machine is jammed: no torque of the motor turns the shaft.",
    "the jam",
    AddedLoad,
    takes=HELD,
    preset={"torque": 0.0, "inertia": 0.0, "friction": 1e9},
    place=100,
    wire="The actual velocity stays 0 and the current rises; then the drive's own fault in ZSW1.3.",
    reports="The bus reports nothing before the drive's own fault. S7-1500: a positioning axis that watches its "
    "following error stops with technology alarm 521. CODESYS: SoftMotion reports a lag error (assumed).",
)
