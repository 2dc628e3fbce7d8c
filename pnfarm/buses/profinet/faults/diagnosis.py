"""Diagnosis of a PROFINET drive's submodules."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.errors import ConfigError
from pnfarm.faults.effects.parts import DrivePart, Part

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.buses.profinet.device.device import ProfinetDevice
    from pnfarm.protocols.profinet.diagnosis import DiagnosisEntry
    from pnfarm.protocols.profinet.gsdml.diagnosis import DiagnosisCatalogue

__all__ = ["DIAGNOSES", "Diagnoses"]


class Diagnoses(DrivePart):
    """Of entries with the same key the latest counts; one whose submodule is missing waits for it."""

    def __init__(self, station: ProfinetDevice, settle: Callable[[int], None]) -> None:
        self._station = station
        self._settle = settle
        self._entries: list[DiagnosisEntry] = []

    def refresh(self, now: int) -> None:
        del now
        # a user may have plugged a submodule that a diagnosis waited for
        self.put()

    def in_force(self) -> list[Any]:
        return list(self._entries)

    @property
    def catalogue(self) -> DiagnosisCatalogue | None:
        """Those that the device's file names; None where there is no file."""
        return self._station.kind.diagnoses

    def diagnose(self, entry: DiagnosisEntry, now: int) -> None:
        """Let a diagnosis appear.  Raises :class:`ConfigError` when the drive's store is full."""
        store = self._station.cm.diagnosis
        if len({e.key for e in (*store, *self._entries, entry)}) > store.maximum:
            raise ConfigError(
                f"{self._station.configured_name} holds {store.maximum} diagnoses, its maximum; clear one"
            )
        self._entries.append(entry)
        self.put()
        self._settle(now)

    def remove_diagnosis(self, entry: DiagnosisEntry, now: int) -> None:
        """Remove it."""
        self._entries.remove(entry)
        if any(other.key == entry.key for other in self._entries):
            self.put()
        else:
            self._station.cm.diagnosis.remove(entry)
            # it may have stood in the place of one of the station's own
            self._station.report_diagnosis()
        self._settle(now)

    def put(self) -> None:
        """Write what is in force into the drive's present store; entries that are there already stay."""
        cm = self._station.cm
        for entry in {entry.key: entry for entry in self._entries}.values():
            if cm.plugged.submodule(*entry.place) is not None:
                cm.diagnosis.add(entry)


DIAGNOSES: Part[Diagnoses] = Part("diagnosis of PROFINET")
