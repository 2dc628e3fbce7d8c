"""wrong-ident: the slave has another ident number."""

from __future__ import annotations

from typing import Any

from pnfarm.buses.profibus.faults.slave_effect import SlaveEffect
from pnfarm.faults.kind import HELD, WORD, InjectionKind, ParamSpec

__all__ = ["KIND"]


class WrongIdent(SlaveEffect):
    """Confirmed by a Set_Prm that it refuses, or a diagnosis that gives the number."""

    what = "ident"

    def value(self) -> Any:
        return self.values["ident"]


KIND = InjectionKind(
    "wrong-ident",
    "connection",
    "The slave has another ident number, as one of another maker at its address.",
    "the change",
    WrongIdent,
    {"ident": ParamSpec("whole number", "The ident number.", **{**WORD, "default": 0xFFFF})},
    takes=HELD,
    place=74,
    wire="The diagnosis has the number; Set_Prm with the right one is refused (Prm_Fault).",
    reports="S7: wrong type of slave, station failure (OB86); CODESYS: the slave does not match (assumed).",
)
