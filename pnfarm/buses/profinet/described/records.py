"""The parameter records of a maker's file: defaults, what a controller wrote, and what the file does not allow."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING

from pnfarm.buses.profinet.described.events import RecordDoubted, RecordRefused
from pnfarm.protocols.profinet.errors import AccessError, RecordError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.protocols.profinet.cm.ar import Ar
    from pnfarm.protocols.profinet.gsdml.records import ParameterRecord
    from pnfarm.station.event import Event

__all__ = ["DescribedRecords"]

#: Records whose complaints are kept until the next one.
MOST_COMPLAINTS = 64
#: Records that a device keeps, if its file does not allow them.
MOST_RECORDS = 1024


class DescribedRecords:
    """See :class:`pnfarm.buses.profinet.device.kind.ApplicationRecords`.

    A written record is kept and read back until power-off (assumed: the file does not say whether a device stores its
    parameters, and controllers write them in each start-up).  One of a wrong length is refused with "write length
    error", one with a value that its file does not allow with "invalid parameter", another index with "invalid index"
    (assumed: the codes that the standard has for these); without ``strict`` the first :data:`MOST_RECORDS` are kept,
    with a warning in the log.

    ``find`` gives the file's record of (slot, subslot, index), ``own`` has those that the farm file changes.
    """

    def __init__(
        self,
        find: Callable[[int, int, int], ParameterRecord | None],
        note: Callable[[int, Event], None],
        *,
        strict: bool,
        own: Mapping[tuple[int, int, int], bytes] = MappingProxyType({}),
    ) -> None:
        self.error: RecordError | None = None
        self.withhold: Callable[[int], bool] | None = None
        self._find = find
        self._own = own
        self._note = note
        self._strict = strict
        self._written: dict[tuple[int, int, int], bytes] = {}
        #: What is wrong with records that were written lately, by place.
        self.complaints: dict[tuple[int, int, int], str] = {}

    def reset(self, key: int) -> None:
        """Nothing of a connection is pending here."""

    def next_deadline(self) -> int | None:
        """Every request is carried out at once."""
        return None

    def handle_timeout(self, now: int) -> None:
        """See :meth:`next_deadline`."""

    def forget(self) -> None:
        """As at power-on."""
        self._written.clear()

    def read(
        self, ar: Ar | None, api: int, slot: int, subslot: int, index: int, max_length: int, now: int
    ) -> bytes | RecordError:
        """What was written last, else the default."""
        del ar, api, max_length
        if self.error is not None:
            return self.error
        if self.withhold is not None and self.withhold(now):
            return RecordError(AccessError.STATE_CONFLICT)
        place = slot, subslot, index
        found = self._written.get(place)
        if found is not None:
            return found
        record = self._find(*place)
        return RecordError(AccessError.INVALID_INDEX) if record is None else self._own.get(place, record.defaults())

    def write(self, ar: Ar, api: int, slot: int, subslot: int, index: int, data: bytes, now: int) -> RecordError | None:
        """Keep a record, unless it is wrong and the limits are strict."""
        del ar, api
        if self.error is not None:
            return self.error
        place = slot, subslot, index
        wrong = self._wrong(slot, subslot, index, data)
        self.complaints.pop(place, None)
        if wrong is not None:
            code, reason = wrong
            if len(self.complaints) >= MOST_COMPLAINTS:
                self.complaints.clear()
            self.complaints[place] = reason
            full = len(self._written) >= MOST_RECORDS and place not in self._written
            refuses = self._strict or full
            self._note(now, (RecordRefused if refuses else RecordDoubted)(slot, subslot, index, reason))
            if refuses:
                return RecordError(code)
        self._written[place] = data
        return None

    def _wrong(self, slot: int, subslot: int, index: int, data: bytes) -> tuple[int, str] | None:
        record = self._find(slot, subslot, index)
        if record is None:
            return AccessError.INVALID_INDEX, f"the file names no record {index} there"
        complaint = record.complaint(data)
        if complaint is None:
            return None
        code = AccessError.WRITE_LENGTH_ERROR if complaint.ref is None else AccessError.INVALID_PARAMETER
        return code, complaint.text
