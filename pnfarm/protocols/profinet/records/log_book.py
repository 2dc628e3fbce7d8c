"""The log book: the device's last connections and how they ended (IEC 61158-6-10, LogBook ASE)."""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.cm.device.events import ArAborted, ArConnected, ArReleased, ConnectRefused
from pnfarm.protocols.profinet.errors import OK, ErrorCode, ErrorDecode, PnioStatus
from pnfarm.protocols.profinet.wire.records.iod import NIL_UUID
from pnfarm.protocols.profinet.wire.records.log_book import LogData, LogEntry

if TYPE_CHECKING:
    from uuid import UUID

    from pnfarm.protocols.profinet.cm.device.events import CmEvent

__all__ = ["LogBook", "LogDetail"]


class LogDetail(IntEnum):
    """EntryDetail: defined by the maker; these are this device's."""

    CONNECTED = 1
    RELEASED = 2
    ABORTED_BY_DEVICE = 3
    ABORTED_BY_CONTROLLER = 4
    CONNECT_REFUSED = 5


class LogBook:
    """A ring of the last ``size`` entries.  Times are nanoseconds of the caller's ``now``."""

    def __init__(self, size: int = 32) -> None:
        self._size = size
        self._entries: list[LogEntry] = []
        self._uuids: dict[int, UUID] = {}

    def record(self, ar_uuid: UUID, status: PnioStatus, detail: int, now: int) -> None:
        self._entries = [*self._entries, LogEntry(now, ar_uuid, status, detail)][-self._size :]

    def note(self, event: CmEvent, now: int) -> None:
        """Record an event of the AR machine, if the log book has a code for it."""
        match event:
            case ArConnected():
                self._uuids[event.ar_key] = event.uuid
                self.record(event.uuid, OK, LogDetail.CONNECTED, now)
            case ArReleased():
                self.record(self._uuids.pop(event.ar_key, NIL_UUID), OK, LogDetail.RELEASED, now)
            case ArAborted():
                status = PnioStatus(ErrorCode.RTA_ERROR, ErrorDecode.PNIO, event.error_code1, event.error_code2)
                detail = LogDetail.ABORTED_BY_CONTROLLER if event.by_peer else LogDetail.ABORTED_BY_DEVICE
                self.record(self._uuids.pop(event.ar_key, NIL_UUID), status, detail, now)
            case ConnectRefused():
                self.record(NIL_UUID, event.status, LogDetail.CONNECT_REFUSED, now)

    def data(self, now: int) -> LogData:
        """The log book as a record."""
        return LogData(now, tuple(self._entries))
