"""diagnosis: a diagnosis of a submodule appears."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.profinet.faults.diagnosis import DIAGNOSES
from pnfarm.buses.profinet.faults.own_alarm import ERROR_TYPES, EXT_TYPES, NEVER_BY_ITSELF
from pnfarm.buses.profinet.faults.reported_effect import ReportedEffect
from pnfarm.buses.profinet.faults.slot_effect import SLOT, SUBSLOT
from pnfarm.errors import ConfigError
from pnfarm.faults.errors import InjectionError
from pnfarm.faults.kind import HELD, WORD, InjectionKind, ParamSpec
from pnfarm.protocols.profinet.diagnosis import DiagnosisEntry
from pnfarm.protocols.profinet.gsdml.diagnosis import unit_octets
from pnfarm.protocols.profinet.wire.alarms.notification import AlarmType
from pnfarm.protocols.profinet.wire.records.diagnosis import (
    MANUFACTURER_LAST,
    WHOLE_SUBMODULE,
    Maintenance,
    Qualifier,
    Usi,
)
from pnfarm.vocabulary.quoting import did_you_mean, shown

if TYPE_CHECKING:
    from pnfarm.protocols.profinet.cm.ar import ExpectedKey
    from pnfarm.protocols.profinet.cm.device.events import AlarmConfirmed
    from pnfarm.protocols.profinet.gsdml.diagnosis import DiagnosisCatalogue

__all__ = ["KIND"]

#: In rising order of severity; "advice" takes a qualified coding.
_SEVERITIES = {"advice": 0, "maintenance-required": 1, "maintenance-demanded": 2, "fault": 3}
_MAINTENANCE = {
    "fault": Maintenance.FAULT,
    "maintenance-required": Maintenance.REQUIRED,
    "maintenance-demanded": Maintenance.DEMANDED,
}
#: Of MaintenanceAlarmState in a file.
_SEVERITY_OF = {"D": "fault", "MR": "maintenance-required", "MD": "maintenance-demanded"}
_CODINGS = {"channel": Usi.CHANNEL, "extended": Usi.EXT_CHANNEL, "qualified": Usi.QUALIFIED_CHANNEL, "manufacturer": 0}
_QUALIFIERS = {
    "fault": Qualifier.FAULT,
    "maintenance-demanded": Qualifier.DEMANDED,
    "maintenance-required": Qualifier.REQUIRED,
    "advice": Qualifier.ADVICE,
}


class Diagnosis(ReportedEffect):
    """Confirmed by any alarm on the submodule except a disappearance."""

    diagnoses = DIAGNOSES

    def prepare(self) -> None:
        values = self.values
        if isinstance(values["error"], str):
            values = {**values, **_described(values, self.diagnoses.catalogue)}
        self._entry = _entry(values, self.modules.place(values["slot"], values["subslot"]))

    def _change(self, now: int) -> None:
        self.diagnoses.diagnose(self._entry, now)

    def _restore(self, now: int) -> None:
        self.diagnoses.remove_diagnosis(self._entry, now)

    def _is_about(self, event: AlarmConfirmed) -> bool:
        told = event.alarm_type != AlarmType.DIAGNOSIS_DISAPPEARS
        return told and (event.api, event.slot, event.subslot) == self._entry.place

    def _is_in_diff(self) -> bool:
        _, slot, subslot = self._entry.place
        return self.modules.in_diff_at_connect(slot, subslot, self._standing, diagnosis=True)


def _described(values: dict[str, Any], catalogue: DiagnosisCatalogue | None) -> dict[str, Any]:
    """The parameters of an error that is given by its name in the device's file."""
    name = values["error"]
    if catalogue is None:
        what = f"is {shown(name)}{did_you_mean(name, ERROR_TYPES)}"
        raise InjectionError([("params.error", what, "a ChannelErrorType, by its number or name")])
    try:
        found = catalogue.find(name)
    except ConfigError as exc:
        raise InjectionError([("params.error", str(exc), "")]) from exc
    if found.unit is not None:
        data = values["data"] or unit_octets(found.unit)
        return {"coding": "manufacturer", "usi": found.error_type, "data": data}
    own: dict[str, Any] = {"error": found.error_type}
    if found.ext_error_type:
        own["ext"] = found.ext_error_type
        if values["coding"] == "channel":
            own["coding"] = "extended"
    if values["severity"] is None:
        own["severity"] = next((_SEVERITY_OF[one] for one in found.severities if one in _SEVERITY_OF), None)
    return own


def _entry(values: dict[str, Any], place: ExpectedKey) -> DiagnosisEntry:
    """The diagnosis that the parameters describe; raises :class:`InjectionError` for what no coding can express."""
    severity, coding = values["severity"] or "fault", values["coding"]
    if severity == "advice" and coding != "qualified":
        raise InjectionError(
            [("params.severity", "is 'advice'", "with `coding` qualified; fault and maintenance otherwise")]
        )
    if severity != "fault" and coding == "manufacturer":
        raise InjectionError([("params.severity", f"is {shown(severity)}", "fault, in a manufacturer's coding")])
    try:
        if coding == "manufacturer":
            return DiagnosisEntry(*place, usi=values["usi"], channel=values["channel"], data=values["data"])
        # the lowest bit of the severity's
        qualifier = _QUALIFIERS[severity] & -_QUALIFIERS[severity] if coding == "qualified" else 0
        return DiagnosisEntry(
            *place,
            usi=_CODINGS[coding],
            channel=values["channel"],
            error_type=values["error"],
            ext_error_type=values["ext"],
            ext_add_value=values["add-value"],
            maintenance=Maintenance.QUALIFIED if qualifier else _MAINTENANCE[severity],
            qualifier=qualifier,
        )
    except ValueError as exc:
        raise InjectionError(
            [("params", str(exc), "`coding` extended or qualified for an extended error type")]
        ) from exc


KIND = InjectionKind(
    "diagnosis",
    "alarms",
    "A diagnosis of a submodule appears, and disappears when this ends: alarms, the ModuleDiffBlock, the diagnosis "
    "records, and for a fault the problem indicator of the data status.  It waits for its submodule, and comes back "
    "with it.  " + NEVER_BY_ITSELF,
    "the diagnosis",
    Diagnosis,
    {
        "error": ParamSpec(
            "whole number",
            "ChannelErrorType.  Under a maker's file also a diagnosis by its name there; an extended one, or one in "
            "the maker's own form, then has its coding.",
            default="error",
            words=ERROR_TYPES,
            other="a name in the maker's file",
            low=1,
            high=0xFFFF,
        ),
        "ext": ParamSpec(
            "whole number", "ExtChannelErrorType, where the coding has one.", default=0, words=EXT_TYPES, **WORD
        ),
        "add-value": ParamSpec(
            "whole number", "ExtChannelAddValue, where the coding has one.", default=0, low=0, high=0xFFFF_FFFF
        ),
        "channel": ParamSpec(
            "whole number",
            "ChannelNumber.",
            default="submodule",
            words={"submodule": WHOLE_SUBMODULE},
            low=0,
            high=WHOLE_SUBMODULE,
        ),
        "slot": SLOT,
        "subslot": SUBSLOT,
        "severity": ParamSpec(
            "word",
            "Severity; advice only in the qualified coding.  Left out, a fault, or what the maker's file has for this "
            "error.",
            words=_SEVERITIES,
        ),
        "coding": ParamSpec("word", "Coding of the diagnosis.", "channel", words=_CODINGS),
        "usi": ParamSpec(
            "whole number",
            "UserStructureIdentifier of the manufacturer's coding.",
            default=1,
            low=0,
            high=MANUFACTURER_LAST,
        ),
        "data": ParamSpec("octets", "Data of the manufacturer's coding.", default="", high=128),
    },
    takes=HELD,
    place=30,
    wire="A diagnosis alarm, ZSW1 as before; ProblemIndicator in the data status.",
    reports="S7-1500: OB82 and an entry in the diagnosis buffer. CODESYS: the diagnosis of the device (assumed).",
)
