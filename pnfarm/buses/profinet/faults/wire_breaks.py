"""The diagnosis of a broken wire: ChannelErrorType 6 of the channel of an input (IEC 61158-6-10, ChannelErrorType)."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.diagnosis import DiagnosisEntry
from pnfarm.protocols.profinet.wire.records.diagnosis import Direction, Maintenance

if TYPE_CHECKING:
    from pnfarm.buses.profinet.faults.diagnosis import Diagnoses
    from pnfarm.buses.profinet.faults.modules import Modules
    from pnfarm.faults.signals import Report
    from pnfarm.signals.signal import Signal

__all__ = ["wire_break_of"]

WIRE_BREAK = 0x0006
#: Of MaintenanceAlarmState in a file, from the most severe.
_SEVERITIES = {"D": Maintenance.FAULT, "MD": Maintenance.DEMANDED, "MR": Maintenance.REQUIRED}


def wire_break_of(diagnoses: Diagnoses, modules: Modules, signal: Signal, channel: int) -> Report | None:
    """How the device reports it; None where its file does not have this error."""
    described = () if diagnoses.catalogue is None else diagnoses.catalogue.described
    found = [one for one in described if one.kind == "channel" and one.error_type == WIRE_BREAK]
    if not found:
        return None
    allowed = {severity for one in found for severity in one.severities}
    entry = DiagnosisEntry(
        *modules.place(signal.slot, signal.subslot),
        channel=channel,
        direction=Direction.INPUT,
        error_type=WIRE_BREAK,
        maintenance=next((_SEVERITIES[one] for one in _SEVERITIES if one in allowed), Maintenance.FAULT),
    )
    return partial(diagnoses.diagnose, entry), partial(diagnoses.remove_diagnosis, entry)
