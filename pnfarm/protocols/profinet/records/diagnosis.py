"""Diagnosis records: the entries for each index, as DiagnosisData blocks (IEC 61158-6-10, field Index)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.diagnosis import Severity, diagnosis_blocks
from pnfarm.protocols.profinet.records.identification import in_scope

if TYPE_CHECKING:
    from collections.abc import Container, Iterable

    from pnfarm.protocols.profinet.cm.ar import ExpectedKey
    from pnfarm.protocols.profinet.diagnosis import DiagnosisEntry
    from pnfarm.protocols.profinet.records.directory import Scope

__all__ = ["diagnosis_record"]

#: Low octet of the index -> severity (None: every one), only channel-coded entries.
_SELECTIONS: dict[int, tuple[Severity | None, bool]] = {
    0x0A: (Severity.FAULT, True),
    0x0B: (Severity.FAULT, False),
    0x0C: (None, False),
    0x10: (Severity.MAINTENANCE_REQUIRED, True),
    0x11: (Severity.MAINTENANCE_DEMANDED, True),
    0x12: (Severity.MAINTENANCE_REQUIRED, False),
    0x13: (Severity.MAINTENANCE_DEMANDED, False),
}


def diagnosis_record(
    entries: Iterable[DiagnosisEntry],
    index: int,
    scope: Scope,
    asked: ExpectedKey,
    present: Container[ExpectedKey],
) -> bytes:
    """The entries of the submodules that are ``present`` (for the scope of an AR: that it owns); empty for none."""
    severity, coded_only = _SELECTIONS[index & 0xFF]

    def wanted(entry: DiagnosisEntry) -> bool:
        return (
            entry.place in present
            and in_scope(scope, asked, entry.place)
            and (severity is None or severity in entry.severities)
            and (entry.channel_coded or not coded_only)
        )

    return b"".join(block.emit() for block in diagnosis_blocks(entries, wanted))
