"""Records that every PROFINET device has: identity, modules, ARs, diagnosis, I/O data.

:class:`DeviceRecords` serves the AR machine.  It looks an index up in :mod:`directory`, refuses what the
place, the AR or its phase do not allow, and passes the rest to the part of the device that the table names; the
indexes of the user and of profiles go to the application's handler, the drive's parameter access.

What is refused, and how (PNIORW; IEC 61158-6-10, coding of ErrorCode1): no such index, or not at that submodule
0xB0; wrong length of what was written 0xB1; no such slot or subslot 0xB2; no such API 0xB4; a record of an AR
without one, or a write between PrmEnd and ApplicationReady 0xB5; a read-only record, or another AR's submodule
0xB6; an answer longer than the room for it 0xB7; an invalid value 0xB8.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.cm.ar import CmdevState
from pnfarm.protocols.profinet.cm.device.diff import unusable_submodules
from pnfarm.protocols.profinet.cm.device.ownership import expected_keys
from pnfarm.protocols.profinet.diagnosis import DiagnosisStore
from pnfarm.protocols.profinet.errors import AccessError, RecordError
from pnfarm.protocols.profinet.records.diagnosis import diagnosis_record
from pnfarm.protocols.profinet.records.directory import OWN, Access, Index, Part, Record, Scope, find_record
from pnfarm.protocols.profinet.records.fsu import FsuRecords
from pnfarm.protocols.profinet.records.handler import KeptRecords
from pnfarm.protocols.profinet.records.identification import (
    EXPECTED,
    ar_data_record,
    identification_record,
)
from pnfarm.protocols.profinet.records.im import ImRecords, im0_of
from pnfarm.protocols.profinet.records.io import IoData, IoRecords
from pnfarm.protocols.profinet.records.log_book import LogBook
from pnfarm.protocols.profinet.records.pdev import is_pdev_subslot
from pnfarm.protocols.profinet.wire.records.container import parse_container
from pnfarm.protocols.profinet.wire.records.iod import INDEX_MULTIPLE_WRITE

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, MutableMapping

    from pnfarm.protocols.profinet.cm.ar import Ar, ExpectedKey
    from pnfarm.protocols.profinet.description import DeviceDescription, Plugged
    from pnfarm.protocols.profinet.records.handler import RecordHandler
    from pnfarm.protocols.profinet.records.im import TextKey

__all__ = ["DeviceRecords", "Index", "IoData", "im0_of", "owned_submodules"]

#: CMWRR accepts no write here: the parameters are complete, and the application is not ready yet.
_NO_WRITES = frozenset({
    CmdevState.W_CIND,
    CmdevState.W_CRES,
    CmdevState.W_SUCNF,
    CmdevState.W_PERES,
    CmdevState.W_ARDY,
    CmdevState.ABORT,
})  # fmt: skip


def owned_submodules(ar: Ar) -> frozenset[ExpectedKey]:
    """The submodules that the AR has: expected, there, as expected or as a substitute, and not another AR's.

    One that was plugged while data flow is among them, though its data are bad until its parameters have come.
    """
    return frozenset(expected_keys(ar.expected)) - unusable_submodules(ar.expected, ar.module_diff) | ar.pending


class DeviceRecords:
    """The records of one device, a :class:`RecordHandler`.

    ``ars`` gives the present ARs (:attr:`CmDevice.ars`).  ``io_data(slot, subslot, output)`` gives a submodule's
    cyclic data, or None while there is none.  ``pdev`` answers for the physical device.  ``texts`` are its memory of
    I&M1 to I&M4 (:attr:`im`).
    """

    def __init__(
        self,
        description: DeviceDescription,
        plugged: Plugged,
        ars: Callable[[], Iterable[Ar]],
        *,
        application: RecordHandler,
        io_data: Callable[[int, int, bool], IoData | None],
        pdev: RecordHandler,
        texts: MutableMapping[TextKey, bytes],
    ) -> None:
        self.diagnosis = DiagnosisStore()
        self.log_book = LogBook()
        self.im = ImRecords(description, plugged, texts)
        self._own = description.own_records | description.ignored_records
        self._ignored = description.ignored_records
        #: Records that have no effect here.
        self.ignored = KeptRecords(description.ignored_records)
        self._plugged = plugged
        self._ars = ars
        self._application = application
        self._pdev = pdev
        self._io = IoRecords(ars, io_data)
        self._fsu = FsuRecords(ars)

    def read(
        self, ar: Ar | None, api: int, slot: int, subslot: int, index: int, max_length: int, now: int
    ) -> bytes | RecordError:
        """The record's octets, or the error; see the module's docstring."""
        record = self._find(index)
        if record is None or not record.access & Access.READ:
            return RecordError(AccessError.INVALID_INDEX)
        key = api, slot, subslot
        wrong = self._wrong_place(record, ar, key, index)
        if wrong is not None:
            return wrong
        answer = self._read(record, ar, key, index, max_length, now)
        if isinstance(answer, bytes) and len(answer) > max_length:
            return RecordError(AccessError.INVALID_RANGE)
        return answer

    def _read(
        self, record: Record, ar: Ar | None, key: ExpectedKey, index: int, max_length: int, now: int
    ) -> bytes | RecordError:
        if index in self._ignored:
            return self.ignored.read(ar, *key, index, max_length, now)
        match record.part:
            case Part.APPLICATION:
                return self._application.read(ar, *key, index, max_length, now)
            case Part.IDENTIFICATION:
                return identification_record(self._plugged, ar, index, record.scope, key)
            case Part.AR_DATA:
                return ar_data_record(self._plugged, self._ars(), ar, index, key[0])
            case Part.DIAGNOSIS:
                return diagnosis_record(self.diagnosis, index, record.scope, key, self._reported(record.scope, ar))
            case Part.IM:
                if index == Index.IM0_FILTER_DATA:
                    return self.im.filter_data()
                return self.im.read(*key[1:], index)
            case Part.IO_DATA:
                return self._io.read(ar, self._plugged[key[1:]], index)
            case Part.LOG_BOOK:
                return self.log_book.data(now).emit()
            case Part.PDEV:
                return self._pdev.read(ar, *key, index, max_length, now)
            case Part.MONITORING:
                # the call itself is what the controller's timeout waits for
                return b""
            case Part.FAST_STARTUP if ar is not None:
                return self._fsu.read(ar)
            case _:
                return RecordError(AccessError.INVALID_INDEX)

    def write(self, ar: Ar, api: int, slot: int, subslot: int, index: int, data: bytes, now: int) -> RecordError | None:
        """None when the record was accepted, else the error; one that is ignored is kept.

        A container is checked for its shape and place only: the server of the call writes its records, one by one.
        """
        record = self._find(index)
        if record is None:
            return RecordError(AccessError.INVALID_INDEX)
        key = api, slot, subslot
        refused = self._wrong_place(record, ar, key, index) or self._not_writable(record, ar, key)
        if refused is not None:
            return refused
        if index in self._ignored:
            return self.ignored.write(ar, *key, index, data, now)
        match record.part:
            case Part.APPLICATION:
                return self._application.write(ar, *key, index, data, now)
            case Part.IM:
                return self.im.write(slot, subslot, index, data)
            case Part.IO_DATA:
                return self._io.write(ar, self._plugged[slot, subslot], data)
            case Part.PDEV:
                return self._pdev.write(ar, *key, index, data, now)
            case Part.FAST_STARTUP:
                return self._fsu.write(ar, data)
            case Part.CONTAINER:
                return _check_container(data)
            case _:
                # the table allows no write to these
                return RecordError(AccessError.ACCESS_DENIED)

    # errors

    def _find(self, index: int) -> Record | None:
        return find_record(index) or (OWN if index in self._own else None)

    def _wrong_place(self, record: Record, ar: Ar | None, key: ExpectedKey, index: int) -> RecordError | None:
        api, slot, subslot = key
        if record.scope is Scope.AR or index in EXPECTED:
            if ar is None:
                return RecordError(AccessError.STATE_CONFLICT)
            if record.scope is Scope.AR:
                return None
        if record.scope is Scope.DEVICE:
            return None
        if api not in self._plugged.apis():
            return RecordError(AccessError.INVALID_AREA)
        if record.scope is Scope.SLOT:
            module = self._plugged.module(slot)
            if module is None or all(s.api != api for s in module.submodules):
                return RecordError(AccessError.INVALID_SLOT_SUBSLOT)
        elif record.scope is Scope.SUBSLOT:
            if self._plugged.submodule(*key) is None:
                return RecordError(AccessError.INVALID_SLOT_SUBSLOT)
            if record.part is Part.PDEV and not is_pdev_subslot(subslot):
                return RecordError(AccessError.INVALID_INDEX)
        return None

    def _not_writable(self, record: Record, ar: Ar, key: ExpectedKey) -> RecordError | None:
        if not record.access & Access.ANY_WRITE:
            return RecordError(AccessError.ACCESS_DENIED)
        if ar.state in _NO_WRITES:
            return RecordError(AccessError.STATE_CONFLICT)
        if ar.device_access:
            if record.access & Access.WRITE_ACCESS:
                return None
            free = all(key not in owned_submodules(other) for other in self._ars())
            allowed = bool(record.access & Access.WRITE_SHARED) and free
        else:
            allowed = record.scope is Scope.AR or key in owned_submodules(ar)
        return None if allowed else RecordError(AccessError.ACCESS_DENIED)

    def _reported(self, scope: Scope, ar: Ar | None) -> frozenset[ExpectedKey]:
        """The submodules whose diagnosis a record reports: those that are plugged, or those of the AR."""
        if scope is Scope.AR:
            return owned_submodules(ar) if ar is not None else frozenset()
        return frozenset((s.api, s.slot, s.subslot) for m in self._plugged.modules() for s in m.submodules)


def _check_container(data: bytes) -> RecordError | None:
    """Refuse containers and multiple writes inside a container."""
    try:
        contents = parse_container(data)
    except DecodeError:
        return RecordError(AccessError.WRITE_LENGTH_ERROR)
    if any(c.index in {Index.COMBINED_OBJECT_CONTAINER, INDEX_MULTIPLE_WRITE} for c in contents):
        return RecordError(AccessError.INVALID_PARAMETER)
    return None
