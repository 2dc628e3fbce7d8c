"""A drive's own faults as diagnosis: raised by the firmware, reported to the controller, removed when acknowledged.

The model's data say which faults are reported and how: ``diagnosis`` gives the ChannelErrorType of a fault,
``diagnosis_coding`` the parameter that selects the format (Moog MSD manual 9.5.2, table 9.22).  A model without its own
formats uses ChannelDiagnosis of the parameter access point.  Of a fault situation, as many faults are reported as the
fault memory keeps (Moog MSD manual 10.9: one).
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.diagnosis import DiagnosisEntry
from pnfarm.protocols.profinet.wire.records.diagnosis import Direction, Usi
from pnfarm.table.axis_codes import FAULT_SLOTS

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.drives.parameters.store import ParameterStore
    from pnfarm.protocols.profinet.cm.ar import ExpectedKey
    from pnfarm.protocols.profinet.diagnosis import DiagnosisStore

__all__ = ["FaultDiagnosis", "fault_entry"]


def fault_entry(store: ParameterStore, number: int, shift: int = 0) -> DiagnosisEntry | None:
    """The diagnosis that an axis reports for a fault now, or None; its slots are ``shift`` after the model's."""
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
    entry = partial(DiagnosisEntry, point.api, point.slot + shift, subslot, direction=Direction.INPUT_OUTPUT)
    match form:
        case "channel":
            return entry(error_type=error_type)
        case "extended":
            return entry(usi=Usi.EXT_CHANNEL, error_type=error_type, ext_add_value=number)
        case "manufacturer":
            assert coding is not None  # this format differs from the plain one
            warning = int(store.handle.axis.warnings.code)
            data = number.to_bytes(4, "big") + warning.to_bytes(4, "big")
            return entry(usi=coding.user_structure, data=data)
        case _:
            return None


class FaultDiagnosis:
    """Diagnosis entries of one axis's faults; its slots are ``shift`` after the model's.

    ``there`` says whether a submodule is plugged: one that is pulled reports nothing.
    """

    __slots__ = ("_count", "_diagnosis", "_entries", "_shift", "_store", "_there")

    def __init__(
        self, store: ParameterStore, diagnosis: DiagnosisStore, shift: int, there: Callable[[ExpectedKey], bool]
    ) -> None:
        self._store = store
        self._diagnosis = diagnosis
        self._shift = shift
        self._there = there
        self._entries: dict[int, DiagnosisEntry] = {}
        #: Faults of the active fault situation.
        self._count = 0

    def raised(self, number: int) -> None:
        """The firmware raised a fault."""
        self._count += 1
        if self._count > (int(self._store.handle.axis.faults.settings.places) or FAULT_SLOTS):
            return
        entry = fault_entry(self._store, number, self._shift)
        if entry is not None:
            self._entries.setdefault(number, entry)
            self.report()

    def report(self) -> None:
        """A fault was raised, or a submodule, whose diagnosis went with it, is there again."""
        for entry in self._entries.values():
            if self._there(entry.place):
                self._diagnosis.add(entry)

    def cleared(self) -> None:
        """All faults were acknowledged."""
        for entry in self._entries.values():
            self._diagnosis.remove(entry)
        self._entries.clear()
        self._count = 0
