"""The controller's end of base mode parameter access: requests built, responses judged.

Write :func:`~pnfarm.drives.profiles.profidrive.base_mode.emit_request` of a request to the record, read the same record
until it answers (0xB5 means: not yet), and give the parsed response to :func:`results`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.drives.parameters.parameter import ParameterError, ParameterErrorNumber
from pnfarm.drives.profiles.profidrive.base_mode import (
    ATTRIBUTE_DESCRIPTION,
    FORMAT_BYTE,
    FORMAT_DWORD,
    FORMAT_ERROR,
    FORMAT_WORD,
    NEGATIVE,
    REQUEST_CHANGE,
    REQUEST_READ,
    ParameterAddress,
    ParameterRequest,
    ParameterResponse,
    ParameterValues,
)
from pnfarm.errors import DecodeError

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = [
    "change_request",
    "describe_request",
    "read_request",
    "response_error",
    "results",
    "signed_values",
]


def read_request(reference: int, addresses: Sequence[ParameterAddress], axis: int = 0) -> ParameterRequest:
    """A request for values; ``reference`` is 1..255 and differs from that of the request before."""
    return ParameterRequest(reference, REQUEST_READ, axis, tuple(addresses))


def describe_request(reference: int, pnu: int, axis: int = 0) -> ParameterRequest:
    """A request for the whole description of one parameter."""
    return ParameterRequest(reference, REQUEST_READ, axis, (ParameterAddress(pnu, 0, 1, ATTRIBUTE_DESCRIPTION),))


def change_request(
    reference: int, changes: Sequence[tuple[ParameterAddress, ParameterValues]], axis: int = 0
) -> ParameterRequest:
    """A request to change values; negative numbers are given as bit patterns (``value & 0xFFFF``)."""
    return ParameterRequest(reference, REQUEST_CHANGE, axis, tuple(a for a, _ in changes), tuple(v for _, v in changes))


def response_error(entry: ParameterValues) -> ParameterError | None:
    """The error that an entry of a response reports, None for an entry without one."""
    if entry.format != FORMAT_ERROR:
        return None
    number = entry.values[0] if entry.values else ParameterErrorNumber.NUMBER_OF_VALUES
    return ParameterError(number, entry.values[1] if len(entry.values) > 1 else None)


def signed_values(entry: ParameterValues) -> tuple[int, ...]:
    """The values of an entry read as signed numbers of their width."""
    bits = {FORMAT_BYTE: 8, 0x02: 8, FORMAT_WORD: 16, 0x03: 16, FORMAT_DWORD: 32, 0x04: 32}.get(entry.format, 64)
    return tuple(value - (1 << bits) if value >> (bits - 1) else value for value in entry.values)


def results(request: ParameterRequest, response: ParameterResponse) -> list[ParameterValues | ParameterError]:
    """One result for each parameter of ``request``, in order: values, or why not.

    Raises :class:`DecodeError` when the response does not belong to the request (``foreign``) or has another number of
    entries (``bad-count``).
    """
    if response.reference != request.reference or response.response_id & ~NEGATIVE != request.request_id:
        raise DecodeError(
            "foreign",
            f"reference {response.reference}, id 0x{response.response_id:02X} answer to {request.reference}, "
            f"0x{request.request_id:02X}",
        )
    if not response.negative and request.request_id == REQUEST_CHANGE:
        return [ParameterValues(0)] * request.count
    entries = response.entries
    errors = [error for entry in entries if (error := response_error(entry)) is not None]
    if response.negative and len(entries) == 1 and errors:
        # a drive that refuses the whole request may say so once
        return [errors[0]] * request.count
    if len(entries) != request.count:
        raise DecodeError("bad-count", f"{len(entries)} entries for {request.count} parameters")
    return [response_error(entry) or entry for entry in entries]
