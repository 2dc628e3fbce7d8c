"""The items of an alarm as text."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.alarms.notification import AlarmType, describe_alarm, describe_item
from pnfarm.protocols.profinet.wire.records.diagnosis import (
    CHANNEL_USIS,
    WHOLE_SUBMODULE,
    ChannelDiagnosis,
    ChannelSpecifier,
    ExtChannelDiagnosis,
    Maintenance,
    MaintenanceItem,
    MaintenanceStatus,
    QualifiedChannelDiagnosis,
    Usi,
    parse_items,
)
from pnfarm.protocols.profinet.wire.records.diagnosis_texts import describe_error_type
from pnfarm.wire.code import words_of

if TYPE_CHECKING:
    from pnfarm.protocols.profinet.wire.alarms.notification import AlarmItem, AlarmNotification
    from pnfarm.protocols.profinet.wire.records.diagnosis import DiagnosisItem

__all__ = ["DiagnosisTexts", "alarm_in_words", "item_in_words", "only_disappears"]


class DiagnosisTexts(Protocol):
    """A device's own texts for its diagnoses; empty where it has none."""

    def error_type(self, api: int, error_type: int, ext_error_type: int) -> str:
        """Text of a ChannelErrorType, and of the ExtChannelErrorType unless that is 0."""

    def unit(self, api: int, user_structure: int, data: bytes) -> str:
        """Text of an item in the maker's own format."""


_KNOWN = CHANNEL_USIS | {Usi.MAINTENANCE}


def _status(status: int) -> str:
    names = [
        name
        for bit, name in (
            (MaintenanceStatus.REQUIRED, "maintenance required"),
            (MaintenanceStatus.DEMANDED, "maintenance demanded"),
        )
        if status & bit
    ]
    rest = status & ~(MaintenanceStatus.REQUIRED | MaintenanceStatus.DEMANDED)
    return ", ".join([*names, *([f"qualifier 0x{rest:08X}"] if rest else [])]) or "no maintenance"


def _entry(item: DiagnosisItem, api: int, texts: DiagnosisTexts | None) -> str:
    match item:
        case ChannelDiagnosis(channel, properties, error_type):
            ext, value = 0, None
        case ExtChannelDiagnosis(channel, properties, error_type, ext, value) | QualifiedChannelDiagnosis(
            channel, properties, error_type, ext, value
        ):
            pass
        case MaintenanceItem(status):
            return _status(status)
        case _:
            return item.data.hex(" ", 2).upper()
    where = "" if channel == WHOLE_SUBMODULE else f"channel {channel} "
    kind = words_of(Maintenance, properties.maintenance, "")
    added = f", value 0x{value:X}" if value else ""
    own = texts.error_type(api, error_type, ext) if texts is not None else ""
    what = own or describe_error_type(error_type, ext, api)
    return f"{where}{what} ({kind}{added}, {words_of(ChannelSpecifier, properties.specifier, '')})"


def item_in_words(item: AlarmItem, api: int = 0, texts: DiagnosisTexts | None = None) -> str:
    """E.g. ``remote mismatch: no peer detected (maintenance demanded, appears)``; octets where nothing is known.

    ``texts`` are the device's own, if its description is available.
    """
    if item.usi not in _KNOWN:
        own = texts.unit(api, item.usi, item.data) if texts is not None else ""
        return own or describe_item(item)
    try:
        return "; ".join(_entry(entry, api, texts) for entry in parse_items(item.data, item.usi))
    except DecodeError:
        return describe_item(item)


def alarm_in_words(alarm: AlarmNotification, texts: DiagnosisTexts | None = None) -> str:
    """One line with what the items say."""
    return describe_alarm(alarm, lambda item: item_in_words(item, alarm.api, texts))


def only_disappears(alarm: AlarmNotification) -> bool:
    """Whether the alarm reports only disappearances.

    Some devices never send "diagnosis disappears": they send AlarmType diagnosis for the end as well, and only
    ChannelProperties.Specifier of its channels shows it.
    """
    if alarm.alarm_type == AlarmType.DIAGNOSIS_DISAPPEARS:
        return True
    if alarm.alarm_type != AlarmType.DIAGNOSIS or not alarm.items:
        return False
    return all(_channels_disappear(item) for item in alarm.items)


def _channels_disappear(item: AlarmItem) -> bool:
    if item.usi not in CHANNEL_USIS:
        return False
    try:
        entries = parse_items(item.data, item.usi)
    except DecodeError:
        return False
    return bool(entries) and all(
        isinstance(entry, ChannelDiagnosis | ExtChannelDiagnosis | QualifiedChannelDiagnosis)
        and entry.properties.specifier != ChannelSpecifier.APPEARS
        for entry in entries
    )
