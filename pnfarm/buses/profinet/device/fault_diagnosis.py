"""A drive's own faults as diagnosis: raised by the firmware, told to the controller, gone when they are acknowledged.

Which faults, as what, and in which form is data of the model: ``diagnosis`` names the ChannelErrorType of a fault,
``diagnosis_coding`` the parameter that picks the form (Moog MSD manual 9.5.2, table 9.22).  A model without forms of
its own has the plain one: ChannelDiagnosis of the parameter access point.  Of a situation as many faults are told as
the error memory keeps (Moog MSD manual 10.9: one).
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.diagnosis import DiagnosisEntry
from pnfarm.protocols.profinet.wire.diagnosis import Direction, Usi
from pnfarm.table.axis_codes import FAULT_SLOTS

if TYPE_CHECKING:
    from pnfarm.drives.store import ParameterStore
    from pnfarm.protocols.profinet.diagnosis import DiagnosisStore

__all__ = ["FaultDiagnosis", "fault_entry"]


def fault_entry(store: ParameterStore, number: int) -> DiagnosisEntry | None:
    """What this drive tells of a fault now, None for nothing."""
    model = store.model
    error_type = model.diagnoses.get(number)
    if not model.limits.alarms or error_type is None:
        return None
    coding = model.diagnosis_coding
    point = min(
        model.profidrive.telegrams[model.profidrive.default_telegram].module.submodules, key=lambda s: s.subslot
    )
    form, subslot = "channel", point.subslot
    if coding is not None:
        mode = store.raw(coding.mode_parameter)
        if mode >= len(coding.modes):
            return None
        form, subslot = coding.modes[mode], coding.subslots[mode]
    entry = partial(DiagnosisEntry, point.api, point.slot, subslot, direction=Direction.INPUT_OUTPUT)
    match form:
        case "channel":
            return entry(error_type=error_type)
        case "extended":
            return entry(usi=Usi.EXT_CHANNEL, error_type=error_type, ext_add_value=number)
        case "manufacturer":
            assert coding is not None  # the plain form is another one
            warning = int(store.handle.axis.warnings.code)
            data = number.to_bytes(4, "big") + warning.to_bytes(4, "big")
            return entry(usi=coding.user_structure, data=data)
        case _:
            return None


class FaultDiagnosis:
    """What one drive's faults have put into its diagnosis."""

    __slots__ = ("_count", "_diagnosis", "_entries", "_store")

    def __init__(self, store: ParameterStore, diagnosis: DiagnosisStore) -> None:
        self._store = store
        self._diagnosis = diagnosis
        self._entries: dict[int, DiagnosisEntry] = {}
        #: Faults of the active situation.
        self._count = 0

    def raised(self, number: int) -> None:
        """The firmware raised a fault."""
        self._count += 1
        if self._count > (int(self._store.handle.axis.faults.settings.places) or FAULT_SLOTS):
            return
        entry = fault_entry(self._store, number)
        if entry is not None and number not in self._entries and self._diagnosis.add(entry):
            self._entries[number] = entry

    def cleared(self) -> None:
        """Every fault is acknowledged."""
        for entry in self._entries.values():
            self._diagnosis.remove(entry)
        self._entries.clear()
        self._count = 0
