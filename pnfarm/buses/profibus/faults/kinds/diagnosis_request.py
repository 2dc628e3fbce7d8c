"""diagnosis-request and static-diagnosis: the slave has something to tell."""

from __future__ import annotations

from typing import Any

from pnfarm.buses.profibus.faults.slave_effect import SlaveEffect
from pnfarm.faults.kind import HELD, InjectionKind, ParamSpec

__all__ = ["KINDS"]


class DiagnosisRequest(SlaveEffect):
    """Confirmed by a diagnosis that is read."""

    what = "diagnosis"

    def value(self) -> Any:
        # a device related block: its length with the header, the octets of the error
        number: int = self.values["code"]
        return bytes((3,)) + number.to_bytes(2, "big")


class StaticDiagnosis(SlaveEffect):
    """Confirmed by a diagnosis that is read."""

    what = "static"


KINDS = (
    InjectionKind(
        "diagnosis-request",
        "alarms",
        "The slave asks its master to read a diagnosis, which has a block of its own after that of the drive.",
        "the block",
        DiagnosisRequest,
        {"code": ParamSpec("whole number", "Two octets of the block.", default=0x0001, low=0, high=0xFFFF)},
        takes=HELD,
        place=40,
        wire="An answer to Data_Exchange of high priority (DH); the diagnosis has Ext_Diag and the block 03 xx xx.",
        reports="S7: diagnostic interrupt (OB82), coming, and going at the end; CODESYS: a diagnosis (assumed).",
    ),
    InjectionKind(
        "static-diagnosis",
        "alarms",
        "The slave reports that its data are not valid (Stat_Diag), as long as the fault lasts.",
        "the state",
        StaticDiagnosis,
        takes=HELD,
        place=41,
        wire="Answers of high priority; the diagnosis has Stat_Diag, and is read in each cycle.",
        reports="S7: diagnostic interrupt (OB82); the data of the slave are taken for invalid (assumed).",
    ),
)
