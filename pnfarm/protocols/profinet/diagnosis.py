"""The diagnosis of one device: the present entries, by place, and the alarms for each change.

A :class:`DiagnosisStore` holds :class:`DiagnosisEntry` values.  Each change yields an event with everything that an
AlarmNotification needs (IEC 61158-6-10, AlarmType, AlarmSpecifier, ChannelProperties, MaintenanceStatus); which
AR owns the submodule, and so gets the alarm, is decided elsewhere.  Nothing in the store expires.

An entry is identified by its place, channel, direction and error types, or by its place, channel and USI when it is
coded by the manufacturer.  Adding it again with another severity or value replaces it: it appears again, then the
former one disappears.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.wire.alarms.notification import AlarmSpecifier, AlarmType
from pnfarm.protocols.profinet.wire.block import VERSION_1_1
from pnfarm.protocols.profinet.wire.records.diagnosis import (
    CHANNEL_USIS,
    MANUFACTURER_LAST,
    WHOLE_SUBMODULE,
    ChannelDiagnosis,
    ChannelProperties,
    ChannelSpecifier,
    DiagnosisData,
    Direction,
    ExtChannelDiagnosis,
    Maintenance,
    MaintenanceItem,
    MaintenanceStatus,
    QualifiedChannelDiagnosis,
    Qualifier,
    UserItem,
    Usi,
    emit_items,
)
from pnfarm.protocols.profinet.wire.records.diagnosis_texts import describe_error_type

if TYPE_CHECKING:
    from collections.abc import Callable, Container, Hashable, Iterable, Iterator

    from pnfarm.protocols.profinet.cm.ar import ExpectedKey
    from pnfarm.protocols.profinet.wire.alarms.texts import DiagnosisTexts
    from pnfarm.protocols.profinet.wire.records.diagnosis import DiagnosisItem

__all__ = [
    "DiagnosisAppeared",
    "DiagnosisDisappeared",
    "DiagnosisEntry",
    "DiagnosisEvent",
    "DiagnosisStore",
    "Severity",
    "diagnosis_blocks",
]


class Severity(IntEnum):
    """In rising order.  Advice exists only as a qualifier."""

    ADVICE = 0
    MAINTENANCE_REQUIRED = 1
    MAINTENANCE_DEMANDED = 2
    FAULT = 3


#: An error type of the network has an alarm type of its own, for appearing and disappearing.
_ALARM_TYPES = {
    0x8000: AlarmType.PORT_DATA_CHANGE,
    0x8001: AlarmType.PORT_DATA_CHANGE,
    0x8003: AlarmType.SYNC_DATA_CHANGED,
    0x8004: AlarmType.ISOCHRONOUS_MODE_PROBLEM,
    0x8005: AlarmType.MULTICAST_COMMUNICATION_MISMATCH,
    0x8007: AlarmType.PORT_DATA_CHANGE,
    0x8008: AlarmType.NETWORK_COMPONENT_PROBLEM,
    0x8009: AlarmType.TIME_DATA_CHANGED,
    0x800A: AlarmType.DYNAMIC_FRAME_PACKING_PROBLEM,
}


#: Bit of SubmoduleState for advice; those of the other severities follow in their order.
_ADVICE_BIT = 3
_QUALIFIED = {
    Severity.ADVICE: Qualifier.ADVICE,
    Severity.MAINTENANCE_REQUIRED: Qualifier.REQUIRED,
    Severity.MAINTENANCE_DEMANDED: Qualifier.DEMANDED,
    Severity.FAULT: Qualifier.FAULT,
}
_PLAIN = {
    Maintenance.FAULT: Severity.FAULT,
    Maintenance.REQUIRED: Severity.MAINTENANCE_REQUIRED,
    Maintenance.DEMANDED: Severity.MAINTENANCE_DEMANDED,
}


@dataclass(frozen=True, slots=True)
class DiagnosisEntry:
    """One condition.  ``usi`` is its coding, which determines the later fields that it has.

    Channel-coded entries have ``error_type``; 0x8002 and 0x8003 also ``ext_error_type`` and ``ext_add_value``; 0x8003
    alone ``qualifier``, together with ``maintenance`` QUALIFIED.  A manufacturer's entry has ``data``, and is a fault.
    Raises :class:`ValueError` for anything else.
    """

    api: int
    slot: int
    subslot: int
    usi: int = Usi.CHANNEL
    channel: int = WHOLE_SUBMODULE
    direction: int = Direction.MANUFACTURER_SPECIFIC
    error_type: int = 0
    ext_error_type: int = 0
    ext_add_value: int = 0
    maintenance: Maintenance = Maintenance.FAULT
    qualifier: int = 0
    accumulative: bool = False
    channel_type: int = 0
    data: bytes = b""

    def __post_init__(self) -> None:
        coded = self.channel_coded
        if not coded and not 0 <= self.usi <= MANUFACTURER_LAST:
            raise ValueError(f"USI 0x{self.usi:04X} is neither channel-coded nor a manufacturer's")
        if not 0 <= self.channel <= WHOLE_SUBMODULE:
            raise ValueError(f"channel 0x{self.channel:X} is above 0x8000")
        if coded and (self.data or not self.error_type):
            raise ValueError("a channel-coded entry has an error type and no data")
        if not coded and (self.error_type or self.maintenance is not Maintenance.FAULT):
            raise ValueError("a manufacturer's entry has no error type and is a fault")
        if self.usi not in {Usi.EXT_CHANNEL, Usi.QUALIFIED_CHANNEL} and (self.ext_error_type or self.ext_add_value):
            raise ValueError(f"USI 0x{self.usi:04X} has no extended error type")
        if (self.usi == Usi.QUALIFIED_CHANNEL) != (self.maintenance is Maintenance.QUALIFIED):
            raise ValueError("USI 0x8003 and a severity that is qualified belong together")
        if bool(self.qualifier) != (self.usi == Usi.QUALIFIED_CHANNEL) or self.qualifier & 7:
            raise ValueError("a qualifier needs USI 0x8003, and its bits 0 to 2 are reserved")

    @property
    def place(self) -> ExpectedKey:
        return self.api, self.slot, self.subslot

    @property
    def channel_coded(self) -> bool:
        return self.usi in CHANNEL_USIS

    def in_words(self, texts: DiagnosisTexts | None = None) -> str:
        """What it says: by ``texts``, the device's own, else by the standard's or a profile's; octets at last."""
        if self.channel_coded:
            own = texts.error_type(self.api, self.error_type, self.ext_error_type) if texts is not None else ""
            return own or describe_error_type(self.error_type, self.ext_error_type, self.api)
        own = texts.unit(self.api, self.usi, self.data) if texts is not None else ""
        return own or f"USI 0x{self.usi:04X} {self.data.hex(' ', 2).upper()}".rstrip()

    @property
    def key(self) -> Hashable:
        """Equal for entries of the same condition."""
        if not self.channel_coded:
            return *self.place, self.channel, self.usi
        return *self.at, self.error_type, self.ext_error_type

    @property
    def at(self) -> tuple[int, ...]:
        """The channel: conditions there "remain" when another disappears."""
        return *self.place, self.channel, self.direction, self.accumulative

    @property
    def severities(self) -> frozenset[Severity]:
        """One; a qualifier may say several."""
        if self.maintenance is Maintenance.QUALIFIED:
            return frozenset(s for s, mask in _QUALIFIED.items() if self.qualifier & mask)
        return frozenset({_PLAIN[self.maintenance]})

    def properties(self, specifier: int = ChannelSpecifier.APPEARS) -> ChannelProperties:
        return ChannelProperties(self.channel_type, self.accumulative, self.maintenance, specifier, self.direction)

    def item(self, specifier: int = ChannelSpecifier.APPEARS) -> DiagnosisItem:
        """The entry on the wire."""
        channel = self.channel, self.properties(specifier), self.error_type
        match self.usi:
            case Usi.CHANNEL:
                return ChannelDiagnosis(*channel)
            case Usi.EXT_CHANNEL:
                return ExtChannelDiagnosis(*channel, self.ext_error_type, self.ext_add_value)
            case Usi.QUALIFIED_CHANNEL:
                return QualifiedChannelDiagnosis(*channel, self.ext_error_type, self.ext_add_value, self.qualifier)
            case _:
                return UserItem(self.usi, self.data)


@dataclass(frozen=True, slots=True)
class _Change:
    """A change as an alarm reports it.

    ``alarm_specifier`` holds the flags of the submodule as it is after the change; the AR's flag
    (:meth:`DiagnosisStore.alarm_specifier`) and the sequence number are the AR's.  ``maintenance_status`` is the
    submodule's.
    """

    entry: DiagnosisEntry
    specifier: ChannelSpecifier
    alarm_type: int
    alarm_specifier: int
    maintenance_status: int

    def items(self) -> tuple[DiagnosisItem, ...]:
        """What the alarm carries: the maintenance item, where there is a status to report, then the entry's."""
        item = self.entry.item(self.specifier)
        if self.maintenance_status and self.entry.channel_coded:
            return MaintenanceItem(self.maintenance_status), item
        return (item,)

    def emit_items(self) -> list[tuple[int, bytes]]:
        """:meth:`items` as (USI, octets after it)."""
        return emit_items(self.items())


@dataclass(frozen=True, slots=True)
class DiagnosisAppeared(_Change):
    """An entry is new, or has another severity or value now."""


@dataclass(frozen=True, slots=True)
class DiagnosisDisappeared(_Change):
    """An entry is gone; with the specifier ALL_DISAPPEAR, everything at its channel."""


DiagnosisEvent = DiagnosisAppeared | DiagnosisDisappeared


class DiagnosisStore:
    """See the module's docstring.  ``refused`` counts entries that were refused: the store was ``full``."""

    def __init__(self, maximum: int = 64) -> None:
        self.maximum = maximum
        self.refused: Counter[str] = Counter()
        self._entries: dict[Hashable, DiagnosisEntry] = {}
        self._events: list[DiagnosisEvent] = []

    def __len__(self) -> int:
        return len(self._entries)

    def __iter__(self) -> Iterator[DiagnosisEntry]:
        """By place and USI, within these in the order of their coming."""
        return iter(sorted(self._entries.values(), key=lambda e: (*e.place, e.usi)))

    def events(self) -> list[DiagnosisEvent]:
        drained, self._events = self._events, []
        return drained

    def add(self, entry: DiagnosisEntry) -> bool:
        """Add an entry; whether it is in the store now.  No event if it was there already, unchanged."""
        standing = self._entries.get(entry.key)
        if standing == entry:
            return True
        if standing is None and len(self._entries) >= self.maximum:
            self.refused["full"] += 1
            return False
        self._entries[entry.key] = entry
        self._tell(DiagnosisAppeared, entry, ChannelSpecifier.APPEARS)
        # a manufacturer's new data replace the old ones without a disappearance
        if standing is not None and entry.channel_coded:
            self._tell(DiagnosisDisappeared, standing, ChannelSpecifier.DISAPPEARS_OTHERS_REMAIN)
        return True

    def remove(self, entry: DiagnosisEntry) -> bool:
        """Remove the entry with this one's :attr:`~DiagnosisEntry.key`; False when there is none."""
        standing = self._entries.pop(entry.key, None)
        if standing is None:
            return False
        self._tell(DiagnosisDisappeared, standing, self._remaining(standing))
        return True

    def clear(self, place: ExpectedKey | None = None) -> int:
        """Take away all entries of a submodule, or (None) all of them; how many.  One event for each channel."""
        gone = [e for e in self if place is None or e.place == place]
        for entry in gone:
            del self._entries[entry.key]
        last = {e.at if e.channel_coded else e.key: e for e in gone}
        for entry in last.values():
            self._tell(DiagnosisDisappeared, entry, ChannelSpecifier.ALL_DISAPPEAR)
        return len(gone)

    def forget(self, place: ExpectedKey | None = None) -> None:
        """Empty the store, or a submodule's part of it, without events: the power is off, or it was pulled."""
        for entry in [e for e in self._entries.values() if place in {None, e.place}]:
            del self._entries[entry.key]
        self._events = [e for e in self._events if place is not None and e.entry.place != place]

    # queries

    def submodule_diag_state(self, place: ExpectedKey) -> int:
        """The diagnosis bits of SubmoduleState, to be joined with the rest of it."""
        bits = 0
        for entry in self._at(place):
            for severity in entry.severities:
                bits |= 1 << _ADVICE_BIT + severity
        return bits

    def maintenance_status(self, place: ExpectedKey) -> int:
        """MaintenanceStatus of one submodule: required, demanded, and every qualifier."""
        status = 0
        for entry in self._at(place):
            status |= entry.qualifier
            if Severity.MAINTENANCE_REQUIRED in entry.severities:
                status |= MaintenanceStatus.REQUIRED
            if Severity.MAINTENANCE_DEMANDED in entry.severities:
                status |= MaintenanceStatus.DEMANDED
        return status

    def alarm_specifier(self, place: ExpectedKey, owned: Container[ExpectedKey] = ()) -> int:
        """Flags of AlarmSpecifier for an alarm of ``place`` to an AR that owns the submodules ``owned``."""
        flags = 0
        for entry in self._at(place):
            coded = entry.channel_coded
            flags |= AlarmSpecifier.CHANNEL_DIAGNOSIS if coded else AlarmSpecifier.MANUFACTURER_DIAGNOSIS
            if Severity.FAULT in entry.severities:
                flags |= AlarmSpecifier.SUBMODULE_DIAGNOSIS_STATE
        return flags | (AlarmSpecifier.AR_DIAGNOSIS_STATE if self.has_fault(owned) else 0)

    def has_fault(self, owned: Container[ExpectedKey]) -> bool:
        """Is there a fault in one of these submodules?  (DataStatus: a problem of the station's.)"""
        return any(e.place in owned and Severity.FAULT in e.severities for e in self._entries.values())

    # internal

    def _at(self, place: ExpectedKey) -> Iterator[DiagnosisEntry]:
        return (e for e in self._entries.values() if e.place == place)

    def _remaining(self, gone: DiagnosisEntry) -> ChannelSpecifier:
        others = [e for e in self._at(gone.place) if e.channel_coded and e.at == gone.at]
        if any(e.severities & gone.severities for e in others):
            return ChannelSpecifier.DISAPPEARS_OTHERS_REMAIN
        return ChannelSpecifier.DISAPPEARS if others else ChannelSpecifier.ALL_DISAPPEAR

    def _tell(
        self,
        kind: type[DiagnosisAppeared | DiagnosisDisappeared],
        entry: DiagnosisEntry,
        specifier: ChannelSpecifier,
    ) -> None:
        plain = AlarmType.DIAGNOSIS if kind is DiagnosisAppeared else AlarmType.DIAGNOSIS_DISAPPEARS
        alarm_type = _ALARM_TYPES.get(entry.error_type, plain)
        flags, status = self.alarm_specifier(entry.place), self.maintenance_status(entry.place)
        self._events.append(kind(entry, specifier, alarm_type, flags, status))


def diagnosis_blocks(
    entries: Iterable[DiagnosisEntry],
    wanted: Callable[[DiagnosisEntry], bool] = lambda _: True,
    version: int = VERSION_1_1,
) -> list[DiagnosisData]:
    """One block for each submodule and USI of the wanted entries, and one for each manufacturer's entry."""
    blocks: dict[Hashable, list[DiagnosisEntry]] = {}
    for entry in entries:
        if wanted(entry):
            blocks.setdefault((entry.place, entry.usi) if entry.channel_coded else entry.key, []).append(entry)
    found = []
    for group in blocks.values():
        first = group[0]
        coded = first.channel_coded
        channel = WHOLE_SUBMODULE if coded else first.channel
        properties = ChannelProperties() if coded else first.properties()
        items = tuple(e.item() for e in group)
        found.append(DiagnosisData(*first.place, channel, properties, first.usi, items, version))
    return found
