"""What the device's AR machine reports: frozen values, named in the past tense."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ipaddress import IPv4Address
    from uuid import UUID

    from pnfarm.protocols.profinet.cm.ar import ExpectedKey, IocrLayout
    from pnfarm.protocols.profinet.diagnosis import DiagnosisEvent
    from pnfarm.protocols.profinet.wire.rpc.pdu import PnioStatus

__all__ = [
    "AlarmConfirmed",
    "ApplicationReadyConfirmed",
    "ArAborted",
    "ArConnected",
    "ArEstablished",
    "ArReleased",
    "CmEvent",
    "ConnectRefused",
    "DiagnosisChanged",
    "PrmEndReceived",
    "RecordRefused",
    "RecordWritten",
    "SubmodulesChanged",
]


@dataclass(frozen=True, slots=True)
class ArConnected:
    """Connect was answered positively: the cyclic channels start now, in both start-up modes.

    ``unusable`` are the expected submodules that the device does not have so (:data:`ExpectedKey`).  All IOPS and IOCS
    are BAD until the first :class:`SubmodulesChanged`; those of ``unusable`` stay so.  ``iocrs`` is empty for an
    acyclic AR (``device_access``).
    """

    ar_key: int
    uuid: UUID
    initiator_name: str
    initiator_ip: IPv4Address
    initiator_mac: bytes
    iocrs: tuple[IocrLayout, ...]
    unusable: frozenset[ExpectedKey]
    advanced_startup: bool
    device_access: bool


@dataclass(frozen=True, slots=True)
class ConnectRefused:
    """``detail`` is the text of ``status``, with the cause.

    Name and MAC address of the initiator are empty where its request was refused before they were read.
    """

    initiator_ip: IPv4Address
    status: PnioStatus
    detail: str
    initiator_name: str = ""
    initiator_mac: bytes = b""


@dataclass(frozen=True, slots=True)
class PrmEndReceived:
    """The parameters are complete; the application may now report that it is ready.

    ``sequence``: None for the whole AR, the plug alarm's for the parameters of one plugged submodule.
    """

    ar_key: int
    sequence: int | None = None


@dataclass(frozen=True, slots=True)
class ApplicationReadyConfirmed:
    """``sequence`` as in :class:`PrmEndReceived`."""

    ar_key: int
    sequence: int | None = None


@dataclass(frozen=True, slots=True)
class SubmodulesChanged:
    """A submodule came or went during the AR; ``unusable`` as in :class:`ArConnected`, as it is now.

    ``starting``: the application is ready for the first time, and the data of all others become good.
    """

    ar_key: int
    unusable: frozenset[ExpectedKey]
    starting: bool = False


@dataclass(frozen=True, slots=True)
class AlarmConfirmed:
    """The controller's AlarmAck came; ``status`` says whether it accepted the alarm.

    ``number`` is the device's own for this alarm, ``sequence`` the one that its AlarmSpecifier carried.
    """

    ar_key: int
    alarm_type: int
    api: int
    slot: int
    subslot: int
    number: int
    sequence: int
    high: bool
    status: PnioStatus


@dataclass(frozen=True, slots=True)
class ArEstablished:
    """CMDEV is in DATA."""

    ar_key: int


@dataclass(frozen=True, slots=True)
class ArAborted:
    """The AR is over without a release.  ``by_peer``: the controller's ERR-RTA ended it.

    The numbers are ErrorCode1 and ErrorCode2; ``reason`` is their text.
    """

    ar_key: int
    error_code1: int
    error_code2: int
    reason: str
    by_peer: bool


@dataclass(frozen=True, slots=True)
class ArReleased:
    """The controller released the AR."""

    ar_key: int


@dataclass(frozen=True, slots=True)
class RecordWritten:
    """A record was written and accepted."""

    ar_key: int
    api: int
    slot: int
    subslot: int
    index: int
    data: bytes


@dataclass(frozen=True, slots=True)
class RecordRefused:
    """A record was written and refused."""

    ar_key: int
    api: int
    slot: int
    subslot: int
    index: int
    status: PnioStatus


@dataclass(frozen=True, slots=True)
class DiagnosisChanged:
    """A diagnosis appeared or disappeared; the controllers that own the submodule got an alarm."""

    change: DiagnosisEvent


CmEvent = (
    ArConnected
    | ConnectRefused
    | PrmEndReceived
    | ApplicationReadyConfirmed
    | ArEstablished
    | ArAborted
    | ArReleased
    | RecordWritten
    | RecordRefused
    | SubmodulesChanged
    | AlarmConfirmed
    | DiagnosisChanged
)
