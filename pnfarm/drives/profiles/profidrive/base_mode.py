"""Base mode parameter access: the PDUs of PROFIdrive's acyclic channel, both directions.

AKD PROFINET manual 3.6 (layout, ranges, example), Moog MSD manual 9.2-9.4 (formats, error numbers, examples),
PROFIdrive profile 4.1, 6.2.3.  Every number is big-endian; values of one octet are filled to an even length.

A request travels as a record write, its response as a record read; both begin with the same reference.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from pnfarm.drives.parameters.parameter import ParameterError, ParameterErrorNumber
from pnfarm.errors import DecodeError
from pnfarm.wire.octets import Reader, Writer

__all__ = [
    "ATTRIBUTE_DESCRIPTION",
    "ATTRIBUTE_TEXT",
    "ATTRIBUTE_VALUE",
    "FORMAT_BYTE",
    "FORMAT_DWORD",
    "FORMAT_ERROR",
    "FORMAT_OCTET_STRING",
    "FORMAT_VISIBLE_STRING",
    "FORMAT_WORD",
    "FORMAT_ZERO",
    "MAX_ELEMENTS",
    "MAX_PARAMETERS",
    "REQUEST_CHANGE",
    "REQUEST_READ",
    "ParameterAddress",
    "ParameterRequest",
    "ParameterResponse",
    "ParameterValues",
    "emit_request",
    "emit_response",
    "entry_octets",
    "error_values",
    "format_octets",
    "parse_request",
    "parse_response",
]

# Request and response identifiers (3.6, "Record data fields").
REQUEST_READ = 0x01
REQUEST_CHANGE = 0x02
NEGATIVE = 0x80

# Attributes (Moog MSD manual, table 9.6).
ATTRIBUTE_VALUE = 0x10
ATTRIBUTE_DESCRIPTION = 0x20
ATTRIBUTE_TEXT = 0x30

# Formats (Moog MSD manual, table 9.6); below 0x40 the data types of the profile.
FORMAT_VISIBLE_STRING = 0x09
FORMAT_OCTET_STRING = 0x0A
FORMAT_ZERO = 0x40
FORMAT_BYTE = 0x41
FORMAT_WORD = 0x42
FORMAT_DWORD = 0x43
FORMAT_ERROR = 0x44

#: Octets of one value by format: Boolean, Integer8/16/32, Unsigned8/16/32, FloatingPoint, VisibleString, OctetString,
#: and the profile's N2, N4, X2, X4 (profile 4.1, 5.4; data types of IEC 61158-5).
_OCTETS = {
    0x01: 1, 0x02: 1, 0x03: 2, 0x04: 4, 0x05: 1, 0x06: 2, 0x07: 4, 0x08: 4, 0x09: 1, 0x0A: 1,
    0x71: 2, 0x72: 4, 0x7B: 2, 0x7C: 4,
    FORMAT_ZERO: 0, FORMAT_BYTE: 1, FORMAT_WORD: 2, FORMAT_DWORD: 4, FORMAT_ERROR: 2,
}  # fmt: skip

#: 3.6: number of parameters 0x01..0x27, number of elements 0x01..0xEA; both come from a block of 240 octets.
MAX_PARAMETERS = 39
MAX_ELEMENTS = 234

HEADER = 4
ADDRESS = 6


def format_octets(code: int) -> int | None:
    """Octets of one value in this format, None for a format that is not known."""
    return _OCTETS.get(code)


@dataclass(frozen=True, slots=True)
class ParameterAddress:
    """What one parameter of a request asks for."""

    pnu: int
    subindex: int = 0
    elements: int = 1
    attribute: int = ATTRIBUTE_VALUE


@dataclass(frozen=True, slots=True)
class ParameterValues:
    """Format and values of one parameter; values are unsigned bit patterns, an error's first value is its number."""

    format: int
    values: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class RequestFault:
    """A request whose header is readable but whose body is not: every parameter gets this error."""

    number: ParameterErrorNumber
    detail: str


@dataclass(frozen=True, slots=True)
class ParameterRequest:
    """A request; ``values`` belongs to a change only, one entry for each address.

    ``fault`` is set by :func:`parse_request` when the body does not follow the format; then only the header counts.
    """

    reference: int
    request_id: int
    axis: int
    addresses: tuple[ParameterAddress, ...]
    values: tuple[ParameterValues, ...] = ()
    count: int = field(default=-1)
    fault: RequestFault | None = None

    def __post_init__(self) -> None:
        if self.count < 0:
            object.__setattr__(self, "count", len(self.addresses))


@dataclass(frozen=True, slots=True)
class ParameterResponse:
    """A response; ``entries`` is empty for a positive answer to a change that carries its header alone."""

    reference: int
    response_id: int
    axis: int
    count: int
    entries: tuple[ParameterValues, ...]

    @property
    def negative(self) -> bool:
        return bool(self.response_id & NEGATIVE)


def _parse_values(reader: Reader) -> ParameterValues:
    code, count = reader.u8(), reader.u8()
    octets = _OCTETS.get(code)
    if octets is None:
        # format 0 with no values is how some drives say "nothing follows" (AKD PROFINET manual 3.6.2)
        if code == 0 and count == 0:
            return ParameterValues(0)
        raise DecodeError("bad-format", f"format 0x{code:02X} is not known")
    if octets == 1:
        data = reader.bytes(count)
        if count % 2:
            reader.skip(min(1, reader.remaining))
        return ParameterValues(code, tuple(data))
    if octets == 0:
        return ParameterValues(code)
    return ParameterValues(code, tuple(reader.u16() if octets == 2 else reader.u32() for _ in range(count)))


def _emit_values(writer: Writer, entry: ParameterValues) -> None:
    octets = _OCTETS.get(entry.format)
    if octets is None and (entry.format or entry.values):
        raise ValueError(f"format 0x{entry.format:02X} is not known")
    writer.u8(entry.format).u8(len(entry.values) if octets else 0)
    for value in entry.values if octets else ():
        if octets == 1:
            writer.u8(value)
        elif octets == 2:
            writer.u16(value)
        else:
            writer.u32(value)
    if octets == 1 and len(entry.values) % 2:
        writer.u8(0)


def parse_request(data: bytes) -> ParameterRequest:
    """A request as a drive gets it; :class:`DecodeError` if not even its header is there.

    A body that breaks the format gives a request with ``fault``, because the profile answers it with a response.
    """
    reader = Reader(data)
    reference, request_id, axis, count = reader.u8(), reader.u8(), reader.u8(), reader.u8()

    def faulty(number: ParameterErrorNumber, detail: str) -> ParameterRequest:
        return ParameterRequest(reference, request_id, axis, (), (), count, RequestFault(number, detail))

    if request_id not in {REQUEST_READ, REQUEST_CHANGE}:
        return faulty(ParameterErrorNumber.SERVICE_NOT_SUPPORTED, f"request id 0x{request_id:02X}")
    if not 1 <= count <= MAX_PARAMETERS:
        return faulty(
            ParameterErrorNumber.ADDRESS_IMPERMISSIBLE, f"{count} parameters; 1 to {MAX_PARAMETERS} are allowed"
        )
    addresses: list[ParameterAddress] = []
    try:
        for _ in range(count):
            attribute, elements, pnu, subindex = reader.u8(), reader.u8(), reader.u16(), reader.u16()
            addresses.append(ParameterAddress(pnu, subindex, elements, attribute))
    except DecodeError:
        return faulty(
            ParameterErrorNumber.ADDRESS_IMPERMISSIBLE, f"{count} parameters announced, {len(addresses)} there"
        )
    values: list[ParameterValues] = []
    if request_id == REQUEST_CHANGE:
        try:
            values += [_parse_values(reader) for _ in range(count)]
        except DecodeError as exc:
            illegal = exc.reason == "bad-format"
            return faulty(
                ParameterErrorNumber.ILLEGAL_FORMAT if illegal else ParameterErrorNumber.NUMBER_OF_VALUES, exc.detail
            )
    return ParameterRequest(reference, request_id, axis, tuple(addresses), tuple(values), count)


def emit_request(request: ParameterRequest) -> bytes:
    """A request as a controller sends it; whatever can be built is sent, right or wrong."""
    writer = Writer()
    writer.u8(request.reference).u8(request.request_id).u8(request.axis).u8(request.count)
    for address in request.addresses:
        writer.u8(address.attribute).u8(address.elements).u16(address.pnu).u16(address.subindex)
    for entry in request.values:
        _emit_values(writer, entry)
    return writer.getvalue()


def parse_response(data: bytes) -> ParameterResponse:
    """A response as a controller gets it; :class:`DecodeError` if it does not follow the format.

    Octets after the last entry are padding of the record and are left out.
    """
    reader = Reader(data)
    reference, response_id, axis, count = reader.u8(), reader.u8(), reader.u8(), reader.u8()
    entries: list[ParameterValues] = []
    if not (response_id == REQUEST_CHANGE and reader.remaining == 0):
        entries += [_parse_values(reader) for _ in range(count)]
    return ParameterResponse(reference, response_id, axis, count, tuple(entries))


def emit_response(response: ParameterResponse) -> bytes:
    """A response as a drive sends it."""
    writer = Writer()
    writer.u8(response.reference).u8(response.response_id).u8(response.axis).u8(response.count)
    for entry in response.entries:
        _emit_values(writer, entry)
    return writer.getvalue()


def error_values(error: ParameterError) -> ParameterValues:
    """An error as an entry of a response: its number, and the subindex if the profile requires it."""
    with_subindex = error.number in {number for number in ParameterErrorNumber if number.tells_subindex}
    if with_subindex and error.value is not None:
        return ParameterValues(FORMAT_ERROR, (error.number & 0xFFFF, error.value & 0xFFFF))
    return ParameterValues(FORMAT_ERROR, (error.number & 0xFFFF,))


def entry_octets(entry: ParameterValues) -> int:
    """Length of an entry on the wire."""
    octets = _OCTETS.get(entry.format) or 0
    length = octets * len(entry.values)
    return 2 + length + length % 2
