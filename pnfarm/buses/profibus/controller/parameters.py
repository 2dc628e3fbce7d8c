"""A drive's parameters over records: base mode parameter access (Moog MSD manual 9.1 to 9.4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Protocol

from pnfarm.drives.profiles.profidrive.base_mode import (
    FORMAT_BYTE,
    FORMAT_DWORD,
    FORMAT_ERROR,
    FORMAT_WORD,
    NEGATIVE,
    REQUEST_CHANGE,
    REQUEST_READ,
    ParameterAddress,
    ParameterRequest,
    ParameterValues,
    emit_request,
    format_octets,
    parse_response,
)
from pnfarm.errors import DecodeError
from pnfarm.protocols.profibus.record_request import RecordRequest
from pnfarm.protocols.profibus.wire.dpv1 import MOST_USER_DATA, ErrorCode1

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["Addressed", "ParameterJob"]

INDEX: Final = 47
_FORMATS: Final = {1: FORMAT_BYTE, 2: FORMAT_WORD, 4: FORMAT_DWORD}


class Addressed(Protocol):
    """What a request needs of a parameter; ``elements`` is 0 unless it is an array."""

    @property
    def pnu(self) -> int: ...
    @property
    def elements(self) -> int: ...
    @property
    def octets(self) -> int: ...


@dataclass(slots=True, eq=False)
class ParameterJob:
    """One value that is read, or written where ``wanted`` is a number; ``value`` is what was read, as on the wire.

    ``format``: of what was read; ``wanted_format``: of what is written, 0: by its octets; ``refused``: the number of
    the drive's error.

    A request is written, then its answer is read again and again while the drive says that it is not ready.
    """

    parameter: Addressed
    subindex: int
    wanted: int | None
    due_ns: int
    reference: int = 1
    value: int | None = None
    done: bool = False
    error: str = ""
    format: int = 0
    wanted_format: int = 0
    refused: int | None = None
    _record: RecordRequest | None = None

    @property
    def ok(self) -> bool:
        return self.done and not self.error

    def advance(self, ask: Callable[[RecordRequest], None], now: int) -> None:
        """Go on as far as possible; ``ask`` sends a request for a record."""
        while not self.done:
            record = self._record
            if record is None:
                self._record = RecordRequest.write(0, INDEX, self._request())
                ask(self._record)
                return
            if not record.done:
                return
            if record.refused is not None and record.refused[0] == ErrorCode1.STATE_CONFLICT and now < self.due_ns:
                # it works on it still
                again = RecordRequest.read(0, INDEX, MOST_USER_DATA) if record.data == b"" else None
                self._record = again or RecordRequest.write(0, INDEX, self._request())
                ask(self._record)
                return
            if record.error:
                self._end(record.error)
            elif record.data == self._request():
                self._record = RecordRequest.read(0, INDEX, MOST_USER_DATA)
                ask(self._record)
                return
            else:
                self._take(record.data)

    def _request(self) -> bytes:
        address = ParameterAddress(self.parameter.pnu, self.subindex, 1 if self.parameter.elements else 0)
        if self.wanted is None:
            return emit_request(ParameterRequest(self.reference, REQUEST_READ, 0, (address,)))
        code = self.wanted_format or _FORMATS[self.parameter.octets]
        octets = format_octets(code) or 0
        values = ParameterValues(code, (self.wanted & (1 << 8 * octets) - 1,))
        return emit_request(ParameterRequest(self.reference, REQUEST_CHANGE, 0, (address,), (values,)))

    def _take(self, data: bytes) -> None:
        try:
            response = parse_response(data)
        except DecodeError as exc:
            self._end(f"an answer that cannot be read: {exc}")
            return
        first = response.entries[0] if response.entries else None
        if response.response_id & NEGATIVE:
            number = first.values[0] if first is not None and first.format == FORMAT_ERROR and first.values else 0
            self.refused = number
            self._end(f"error 0x{number:02X}")
            return
        if self.wanted is None and first is not None and first.values:
            self.value, self.format = first.values[0], first.format
        self._end("")

    def _end(self, error: str) -> None:
        self.done, self.error = True, error
