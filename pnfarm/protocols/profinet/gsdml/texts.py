"""What a device's description calls the diagnoses that it sends, for displays of its alarms."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.wire.records.diagnosis_texts import CHANNEL_ERROR_TYPES

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pnfarm.protocols.profinet.gsdml.document import ChannelDiagnosis, UnitDiagnosis

__all__ = ["DescribedDiagnosis"]


class DescribedDiagnosis:
    """A device's own texts (``DiagnosisTexts``); what its description does not name has none."""

    __slots__ = ("_channels", "_units")

    def __init__(self, channels: Iterable[ChannelDiagnosis], units: Iterable[UnitDiagnosis]) -> None:
        self._channels = {(d.api, d.error_type): d for d in channels}
        self._units = {(d.api, d.user_structure): d for d in units}

    def error_type(self, api: int, error_type: int, ext_error_type: int) -> str:
        """E.g. ``Encoder: line broken``; empty for a ChannelErrorType without a text."""
        known = self._channels.get((api, error_type)) or self._channels.get((None, error_type))
        if known is None:
            return ""
        names = {ext.error_type: ext.name for ext in known.extended}
        # one of the standard's has no name in the file, its extensions have
        name = known.name or (CHANNEL_ERROR_TYPES.get(error_type, "") if ext_error_type in names else "")
        if not ext_error_type or not name:
            return name
        return f"{name}: {names.get(ext_error_type) or f'0x{ext_error_type:04X}'}"

    def unit(self, api: int, user_structure: int, data: bytes) -> str:
        """E.g. ``Fault of the drive (Error number 11)``; empty for a USI without a text."""
        known = self._units.get((api, user_structure)) or self._units.get((None, user_structure))
        if known is None:
            return ""
        fields = [(ref.name, ref.value(data)) for ref in known.fields]
        shown = ", ".join(
            f"{name} {value.hex().upper() if isinstance(value, bytes) else value}"
            for name, value in fields
            if value is not None
        )
        return f"{known.name} ({shown})" if shown else known.name
