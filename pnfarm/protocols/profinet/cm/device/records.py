"""The record services of a device: Read, ReadImplicit and Write calls (IEC 61158-6-10, CMRDR and CMWRR)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.cm.device.events import RecordRefused, RecordWritten
from pnfarm.protocols.profinet.errors import (
    OK,
    CmrpcError,
    ConnectFault,
    ErrorCode,
    RecordError,
    RecordField,
    pnio_error,
)
from pnfarm.protocols.profinet.records.directory import Index
from pnfarm.protocols.profinet.wire.block import VERSION_1_0
from pnfarm.protocols.profinet.wire.records.container import parse_container
from pnfarm.protocols.profinet.wire.records.iod import (
    IOD_HEADER_SIZE,
    NIL_UUID,
    IodReadReqHeader,
    IodReadResHeader,
    IodWriteResHeader,
    emit_read_response,
    emit_write_response,
    parse_write_request,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from uuid import UUID

    from pnfarm.protocols.profinet.cm.ar import Ar
    from pnfarm.protocols.profinet.records.handler import RecordHandler
    from pnfarm.protocols.profinet.wire.records.container import ContainerContent
    from pnfarm.protocols.profinet.wire.records.iod import IodWriteReqHeader, RecordWrite
    from pnfarm.protocols.profinet.wire.rpc.pdu import PnioStatus

__all__ = ["ServedCall", "serve_read", "serve_write"]

#: ErrorCode2 for a header that does not parse, by the reason of the DecodeError.
_HEADER_FIELDS = {"bad-type": RecordField.BLOCK_TYPE, "bad-length": RecordField.BLOCK_LENGTH}


@dataclass(frozen=True, slots=True)
class ServedCall:
    """The answer to a record call; ``ar`` is the AR that it was made on."""

    status: PnioStatus
    payload: bytes = b""
    ar: Ar | None = None
    events: tuple[RecordWritten | RecordRefused, ...] = ()


def _undecodable(service: ErrorCode, exc: DecodeError) -> ServedCall:
    field = _HEADER_FIELDS.get(exc.reason)
    if field is None:
        return ServedCall(pnio_error(service, ConnectFault.CMRPC, CmrpcError.ARGS_LENGTH_INVALID))
    return ServedCall(pnio_error(service, ConnectFault.RECORD, field))


def _fitting(answer: bytes, args_maximum: int) -> bytes:
    """The header that goes with a refusal, left out where the caller accepts less."""
    return answer if len(answer) <= args_maximum else b""


def _version_fault(service: ErrorCode, version: int) -> PnioStatus:
    """OK, or which half of a header's version is not 1.0."""
    if version == VERSION_1_0:
        return OK
    high = version >> 8 != VERSION_1_0 >> 8
    field = RecordField.BLOCK_VERSION_HIGH if high else RecordField.BLOCK_VERSION_LOW
    return pnio_error(service, ConnectFault.RECORD, field)


def _write_response(h: IodWriteReqHeader, status: PnioStatus, length: int = 0) -> IodWriteResHeader:
    return IodWriteResHeader(*h.about, length, status=status)


def _write_one(
    ar: Ar, write: RecordWrite, handler: RecordHandler, now: int
) -> tuple[IodWriteResHeader, list[RecordWritten | RecordRefused]]:
    """The answer for one record, and what was written or refused."""
    h = write.header
    status = _version_fault(ErrorCode.WRITE, h.version)
    if not status.ok:
        return _write_response(h, status), []
    if h.ar_uuid != ar.uuid:
        status = pnio_error(ErrorCode.WRITE, ConnectFault.CMRPC, CmrpcError.AR_UUID_UNKNOWN)
        return _write_response(h, status), []
    error, done = _write(ar, (h.api, h.slot, h.subslot, h.index), write.data, handler, now)
    written = [done]
    if error is None and h.index == Index.COMBINED_OBJECT_CONTAINER:
        error, written = _write_contents(ar, parse_container(write.data), handler, now)
    if error is not None:
        return _write_response(h, error.status(ErrorCode.WRITE)), written
    return _write_response(h, OK), written


def _write_contents(
    ar: Ar, contents: Iterable[ContainerContent], handler: RecordHandler, now: int
) -> tuple[RecordError | None, list[RecordWritten | RecordRefused]]:
    """Write each record of a container; one that fails does not stop the others, the first failure is the answer.

    Assumed: no available source gives the result of a container of which one record is refused.
    """
    failed: RecordError | None = None
    written = []
    for c in contents:
        error, done = _write(ar, (c.api, c.slot, c.subslot, c.index), c.data, handler, now)
        written.append(done)
        failed = failed or error
    return failed, written


def _write(
    ar: Ar, place: tuple[int, int, int, int], data: bytes, handler: RecordHandler, now: int
) -> tuple[RecordError | None, RecordWritten | RecordRefused]:
    """One record at API, slot, subslot, index: its error, and what is reported of it."""
    error = handler.write(ar, *place, data, now)
    if error is None:
        return None, RecordWritten(ar.key, *place, data)
    return error, RecordRefused(ar.key, *place, error.status(ErrorCode.WRITE))


def serve_write(
    payload: bytes,
    find_ar: Callable[[UUID], Ar | None],
    handler: RecordHandler,
    now: int,
    args_maximum: int = 0xFFFFFFFF,
) -> ServedCall:
    """Write the record, or every record of a multiple write; one that fails does not stop the others.

    The call's own status is the single record's; a multiple write succeeds as a call and has the result of
    each record in its header.  Nothing is written when ``args_maximum`` leaves no room for the answer.
    """
    try:
        request = parse_write_request(payload)
    except DecodeError as exc:
        refused = _undecodable(ErrorCode.WRITE, exc).status
        # a refused write, too, answers with its header
        header = IodWriteResHeader(0, NIL_UUID, 0, 0, 0, 0, status=refused)
        return ServedCall(refused, _fitting(emit_write_response((header,)), args_maximum))
    ar = find_ar(request.header.ar_uuid)
    if ar is None:
        unknown = pnio_error(ErrorCode.WRITE, ConnectFault.CMRPC, CmrpcError.AR_UUID_UNKNOWN)
        answer = emit_write_response((_write_response(request.header, unknown),))
        return ServedCall(unknown, _fitting(answer, args_maximum))
    headers_due = len(request.writes) + request.multiple
    if IOD_HEADER_SIZE * headers_due > args_maximum:
        refused = pnio_error(ErrorCode.WRITE, ConnectFault.CMRPC, CmrpcError.ARGS_LENGTH_INVALID)
        answer = emit_write_response((_write_response(request.header, refused),))
        return ServedCall(refused, _fitting(answer, args_maximum), ar)
    headers: list[IodWriteResHeader] = []
    events: list[RecordWritten | RecordRefused] = []
    for write in request.writes:
        header, written = _write_one(ar, write, handler, now)
        headers.append(header)
        events += written
    if not request.multiple:
        return ServedCall(headers[0].status, emit_write_response(headers), ar, tuple(events))
    outer = _write_response(request.header, OK, IOD_HEADER_SIZE * len(headers))
    return ServedCall(OK, emit_write_response((outer, *headers)), ar, tuple(events))


def _read_ar(
    request: IodReadReqHeader, find_ar: Callable[[UUID], Ar | None], *, implicit: bool
) -> tuple[Ar | None, PnioStatus]:
    """The AR that a read is about, and OK or the refusal."""
    known = find_ar(request.ar_uuid)
    if implicit:
        if known is not None:
            return None, pnio_error(ErrorCode.READ, ConnectFault.CMRPC, CmrpcError.AR_UUID_UNKNOWN)
        return find_ar(request.target_ar_uuid), OK
    if request.ar_uuid == NIL_UUID:
        return None, pnio_error(ErrorCode.READ, ConnectFault.RECORD, RecordField.AR_UUID)
    if known is None:
        return None, pnio_error(ErrorCode.READ, ConnectFault.CMRPC, CmrpcError.AR_UUID_UNKNOWN)
    return known, OK


def serve_read(
    payload: bytes,
    args_maximum: int,
    find_ar: Callable[[UUID], Ar | None],
    handler: RecordHandler,
    now: int,
    *,
    implicit: bool,
) -> ServedCall:
    """Read one record; ``implicit`` needs no AR, and may name one whose data it wants, or whose monitoring it triggers.

    The record is no longer than what the request and the call's ``args_maximum`` leave room for.
    """
    try:
        request = IodReadReqHeader.parse(payload)
    except DecodeError as exc:
        return _undecodable(ErrorCode.READ, exc)
    status = _version_fault(ErrorCode.READ, request.version)
    if not status.ok:
        return ServedCall(status)
    ar, status = _read_ar(request, find_ar, implicit=implicit)
    if not status.ok:
        return ServedCall(status)
    header = IodReadResHeader(*request.about)
    room = max(0, min(request.record_data_length, args_maximum - IOD_HEADER_SIZE))
    answer = handler.read(ar, request.api, request.slot, request.subslot, request.index, room, now)
    touched = ar if not implicit or request.index == Index.CONNECTION_MONITORING else None
    if isinstance(answer, RecordError):
        return ServedCall(answer.status(ErrorCode.READ), _fitting(emit_read_response(header), args_maximum), touched)
    if args_maximum < IOD_HEADER_SIZE:
        return ServedCall(pnio_error(ErrorCode.READ, ConnectFault.CMRPC, CmrpcError.ARGS_LENGTH_INVALID), b"", touched)
    return ServedCall(OK, emit_read_response(header, answer), touched)
