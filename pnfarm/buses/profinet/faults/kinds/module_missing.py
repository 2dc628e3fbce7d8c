"""module-missing: a module, or one submodule of it, is not there."""

from __future__ import annotations

from pnfarm.buses.profinet.faults.slot_effect import ONE_SUBSLOT, SLOT, SlotEffect
from pnfarm.faults.kind import HELD, InjectionKind

__all__ = ["KIND"]

KIND = InjectionKind(
    "module-missing",
    "connection",
    "A module, or one submodule of it, is not there.  A connected controller gets a pull alarm and BAD data; one that "
    "connects finds it in the ModuleDiffBlock.  A plug alarm reports its return.",
    "pulling the module",
    SlotEffect,
    {"slot": SLOT, "subslot": ONE_SUBSLOT},
    takes=HELD,
    preset={"missing": True},
    place=70,
    wire="ModuleDiffBlock with 'no module'; an alarm 'pull' on a running connection.",
    reports="S7-1500: OB83 and 'module removed'. CODESYS: the module is shown as missing (assumed).",
)
