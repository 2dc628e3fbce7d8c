"""diagnosis-request and static-diagnosis: the slave has something to report."""

from __future__ import annotations

from typing import Any

from pnfarm.buses.profibus.faults.slave_effect import SlaveEffect
from pnfarm.errors import ConfigError
from pnfarm.faults.errors import InjectionError
from pnfarm.faults.kind import HELD, InjectionKind, ParamSpec

__all__ = ["KINDS"]


class DiagnosisRequest(SlaveEffect):
    """Confirmed by a diagnosis that is read."""

    what = "diagnosis"

    def prepare(self) -> None:
        code = self.values["code"]
        if not isinstance(code, str):
            # a device related block: its length with the header, the octets of the error
            self._blocks = bytes((3,)) + code.to_bytes(2, "big")
            return
        try:
            self._blocks = self.slave.described_diagnosis(code, self.values["slot"], self.values["channel"])
        except ConfigError as exc:
            raise InjectionError([("params.code", str(exc), "")]) from exc

    def value(self) -> Any:
        return self._blocks


class StaticDiagnosis(SlaveEffect):
    """Confirmed by a diagnosis that is read."""

    what = "static"


KINDS = (
    InjectionKind(
        "diagnosis-request",
        "alarms",
        "The slave asks its master to read a diagnosis, which has a further block after the drive's.",
        "the block",
        DiagnosisRequest,
        {
            "code": ParamSpec(
                "whole number",
                "Two octets of the block.  For a device also a diagnosis by its name in the maker's file, or an "
                "error of a channel by its name.",
                default=0x0001,
                other="a name in the device's file",
                low=0,
                high=0xFFFF,
            ),
            "slot": ParamSpec("whole number", "Module of a channel's error.", default=1, low=1, high=64),
            "channel": ParamSpec("whole number", "Channel that has an error.", default=0, low=0, high=63),
        },
        takes=HELD,
        place=40,
        wire="An answer to Data_Exchange of high priority (DH); the diagnosis has Ext_Diag and the block 03 xx xx, or "
        "those of the name.",
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
