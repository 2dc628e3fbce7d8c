"""module-wrong: the slot has another module than the controller expects."""

from __future__ import annotations

from pnfarm.buses.profinet.faults.slot_effect import ONE_SUBSLOT, SLOT, SlotEffect
from pnfarm.faults.kind import HELD, WORD, InjectionKind, ParamSpec

__all__ = ["KIND"]

KIND = InjectionKind(
    "module-wrong",
    "connection",
    "The slot has another module, or submodule, than the controller expects. A connected controller gets the alarm "
    "'wrong submodule plugged' and BAD data, one that connects finds it in the ModuleDiffBlock.",
    "plugging the wrong module",
    SlotEffect,
    {
        "slot": SLOT,
        "subslot": ONE_SUBSLOT,
        "telegram": ParamSpec("whole number", "The module of this telegram of the model.", **WORD),
        "ident": ParamSpec(
            "whole number",
            "A module ident, with `subslot` a submodule ident; left out, one that the drive does not have.",
            low=1,
            high=0xFFFF_FFFF,
        ),
        "substitute": ParamSpec("yes or no", "It works in place of the expected one.", default=False),
    },
    takes=HELD,
    preset={"missing": False},
    place=80,
    wire="ModuleDiffBlock with 'wrong module'; an alarm 'plug wrong submodule' on a running connection.",
    reports="S7-1500: OB83 and 'wrong module'. CODESYS: a mismatch of the configuration (assumed).",
)
