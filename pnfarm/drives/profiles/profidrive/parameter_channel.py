"""The drive's end of the parameter channel: a request is written as a record, its response is read from the same.

Record indexes 47 (AKD PROFINET manual 3.6), 0xB02E (local) and 0xB02F (global) lead here; each has its own channel with
one request of each client at a time at each parameter access point (profile 4.1, 8.6): a read while none is pending is
a state conflict (0xB5).

A drive may take its time over a request: until it is over, a read of the answer is that state conflict, too (Moog MSD
manual 9.1: "negative read response", then the data in a later cycle), and so is a second request of the same client
(assumed: the profile's word for an access that is not possible at the moment).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.drives.parameters.parameter import Backing, Parameter, ParameterError, ParameterErrorNumber
from pnfarm.drives.profiles.profidrive.base_mode import (
    ATTRIBUTE_DESCRIPTION,
    ATTRIBUTE_TEXT,
    ATTRIBUTE_VALUE,
    FORMAT_BYTE,
    FORMAT_DWORD,
    FORMAT_OCTET_STRING,
    FORMAT_VISIBLE_STRING,
    FORMAT_WORD,
    FORMAT_ZERO,
    MAX_ELEMENTS,
    MAX_PARAMETERS,
    NEGATIVE,
    REQUEST_CHANGE,
    REQUEST_READ,
    ParameterAddress,
    ParameterRequest,
    ParameterResponse,
    ParameterValues,
    emit_response,
    entry_octets,
    error_values,
    format_octets,
    parse_request,
)
from pnfarm.drives.profiles.profidrive.description import data_type, describe, format_of

if TYPE_CHECKING:
    from collections.abc import Callable, Container, Sequence

    from pnfarm.drives.parameters.store import ParameterStore

__all__ = ["LOCAL", "ParameterChannel"]

#: Base mode parameter access, local: the axis number does not address anything.
LOCAL = 0xB02E
#: Length of an error entry with its two values.
ERROR_OCTETS = 6
HEADER_OCTETS = 4
#: Length of an element's text.
TEXT_OCTETS = 16

#: The access point of a client that has one only.
_ANYWHERE = 0, 0
#: A client and the access point that it uses.
_State = tuple[int, tuple[int, int]]

#: Formats that carry integers: what a parameter takes beside its own data type if the width fits.
_INTEGER_FORMATS = {
    0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x0A, 0x71, 0x72, 0x7B, 0x7C, FORMAT_BYTE, FORMAT_WORD, FORMAT_DWORD,
}  # fmt: skip


class _ParameterAccess:
    """Carries out the requests to one axis, whose axis number is one of ``axes``; None: any.

    With ``strict`` limits a request has at most as many parameters as the drive allows, else as its field can hold.
    """

    __slots__ = ("_axes", "_most", "_store")

    def __init__(self, store: ParameterStore, axes: Container[int] | None, *, strict: bool) -> None:
        self._store = store
        self._axes = axes
        self._most = store.model.limits.max_parameters if strict else MAX_PARAMETERS

    def answer(self, request: ParameterRequest) -> ParameterResponse:
        access = self._store.model.access
        known = request.request_id in {REQUEST_READ, REQUEST_CHANGE}
        if not known and access.unknown_service_id:
            entry = error_values(ParameterError(ParameterErrorNumber.SERVICE_NOT_SUPPORTED))
            return ParameterResponse(request.reference, access.unknown_service_id, request.axis, 1, (entry,))
        if known and request.count > 1 and not access.multi_parameter:
            return self._refused(request, ParameterErrorNumber.MULTI_PARAMETER, 1)
        if known and self._most < request.count <= MAX_PARAMETERS:
            return self._refused(request, ParameterErrorNumber.TOO_MANY_PARAMETERS, 1)
        # the same error for every parameter; one entry when the number of parameters is out of range
        count = request.count if request.addresses else 1
        if request.fault is not None:
            return self._refused(request, request.fault.number, count)
        if self._axes is not None and request.axis not in self._axes:
            return self._refused(request, ParameterErrorNumber.AXIS_NONEXISTENT, count)
        limit = self._store.model.limits.max_response
        entries: list[ParameterValues] = []
        negative = False
        used = HEADER_OCTETS
        for position, address in enumerate(request.addresses):
            # room for the errors of those that follow, so that the response never outgrows its block
            room = limit - used - ERROR_OCTETS * (request.count - position - 1)
            try:
                entry = self._one(request, position, address)
                if entry_octets(entry) > room:
                    raise ParameterError(ParameterErrorNumber.RESPONSE_TOO_LONG)
            except ParameterError as exc:
                negative = True
                entry = error_values(exc if access.error_subindex else ParameterError(exc.number))
            entries.append(entry)
            used += entry_octets(entry)
        if not negative and request.request_id == REQUEST_CHANGE:
            # 3.6.2 shows format 0 and number of values 0 after the header; other drives send the header alone
            entries = [ParameterValues(0)] * request.count if access.change_response_values else []
        response_id = request.request_id | (NEGATIVE if negative else 0)
        return ParameterResponse(request.reference, response_id, request.axis, request.count, tuple(entries))

    @staticmethod
    def _refused(request: ParameterRequest, number: ParameterErrorNumber, count: int) -> ParameterResponse:
        entry = error_values(ParameterError(number))
        return ParameterResponse(
            request.reference, request.request_id | NEGATIVE, request.axis, count, (entry,) * count
        )

    def _one(self, request: ParameterRequest, position: int, address: ParameterAddress) -> ParameterValues:
        handlers: dict[tuple[int, int], Callable[[], ParameterValues]] = {
            (REQUEST_READ, ATTRIBUTE_VALUE): lambda: self._read(address),
            (REQUEST_CHANGE, ATTRIBUTE_VALUE): lambda: self._change(address, request.values[position]),
            (REQUEST_READ, ATTRIBUTE_DESCRIPTION): lambda: self._describe(address),
            (REQUEST_READ, ATTRIBUTE_TEXT): lambda: self._texts(address),
        }
        handler = handlers.get((request.request_id, address.attribute))
        if handler is not None:
            return handler()
        self._row(address)
        refusals = {
            (REQUEST_CHANGE, ATTRIBUTE_DESCRIPTION): ParameterErrorNumber.DESCRIPTION_NOT_CHANGEABLE,
            (REQUEST_CHANGE, ATTRIBUTE_TEXT): ParameterErrorNumber.TEXT_NOT_CHANGEABLE,
        }
        number = refusals.get((request.request_id, address.attribute), ParameterErrorNumber.ADDRESS_IMPERMISSIBLE)
        raise ParameterError(number, address.subindex)

    def _row(self, address: ParameterAddress) -> Parameter:
        """The row of the model, once the address lies within the ranges of 3.6."""
        parameter = self._store.model.parameters.get(address.pnu)
        if parameter is None:
            raise ParameterError(ParameterErrorNumber.IMPERMISSIBLE_PNU)
        least = 0 if self._store.model.access.zero_elements else 1
        if not least <= address.elements <= self._store.model.limits.max_elements or address.subindex > 0xFFFE:
            raise ParameterError(ParameterErrorNumber.ADDRESS_IMPERMISSIBLE)
        return parameter

    @staticmethod
    def _place(parameter: Parameter, address: ParameterAddress) -> tuple[int, int]:
        """Subindex and number of values: 0 elements are one value, whose subindex matters in an array only."""
        if address.elements:
            return address.subindex, address.elements
        return (address.subindex if parameter.elements else 0), 1

    def _read(self, address: ParameterAddress) -> ParameterValues:
        parameter = self._row(address)
        mask = (1 << (8 * parameter.octets)) - 1
        values = self._store.read(address.pnu, *self._place(parameter, address))
        code = format_of(parameter, typed=self._store.model.access.typed_formats)
        return ParameterValues(code, tuple(value & mask for value in values))

    def _change(self, address: ParameterAddress, given: ParameterValues) -> ParameterValues:
        parameter = self._row(address)
        if not parameter.writable:
            raise ParameterError(ParameterErrorNumber.NOT_CHANGEABLE, address.subindex)
        formats = self._store.model.access.formats
        if formats and given.format not in formats:
            raise ParameterError(ParameterErrorNumber.ILLEGAL_FORMAT)
        if given.format not in _INTEGER_FORMATS and given.format != data_type(parameter):
            raise ParameterError(ParameterErrorNumber.INCORRECT_DATA_TYPE)
        # a command takes a value of any width (AKD EtherNet/IP manual 6.6 writes one of one octet and one of four)
        command = parameter.backing is Backing.COMMAND
        if not command and format_octets(given.format) != parameter.octets:
            raise ParameterError(ParameterErrorNumber.INCORRECT_DATA_TYPE)
        subindex, count = self._place(parameter, address)
        if len(given.values) != count:
            raise ParameterError(ParameterErrorNumber.NUMBER_OF_VALUES)
        values = (
            [min(value, parameter.maximum) for value in given.values]
            if command and parameter.maximum == parameter.highest
            else [parameter.wrap(value) for value in given.values]
        )
        self._store.write(address.pnu, subindex, values)
        return ParameterValues(FORMAT_ZERO)

    def _describe(self, address: ParameterAddress) -> ParameterValues:
        parameter = self._row(address)
        if not self._store.model.access.descriptions:
            raise ParameterError(ParameterErrorNumber.NO_DESCRIPTION)
        texts = parameter.pnu in self._store.model.parameter_texts
        octets = describe(parameter, address.subindex, changed=self._store.changed(parameter), texts=texts)
        return ParameterValues(FORMAT_OCTET_STRING, tuple(octets))

    def _texts(self, address: ParameterAddress) -> ParameterValues:
        """The texts of an array's elements, 16 octets each (profile 4.1, 6.2.1.4)."""
        parameter = self._row(address)
        texts = self._store.model.parameter_texts.get(parameter.pnu)
        if texts is None:
            raise ParameterError(ParameterErrorNumber.NO_TEXT_ARRAY, address.subindex)
        subindex, count = self._place(parameter, address)
        if subindex + count > len(texts):
            raise ParameterError(ParameterErrorNumber.FAULTY_SUBINDEX, max(subindex, len(texts)))
        if count * TEXT_OCTETS > MAX_ELEMENTS:
            raise ParameterError(ParameterErrorNumber.RESPONSE_TOO_LONG)
        chosen = texts[subindex : subindex + count]
        octets = b"".join(text.encode("ascii", "replace")[:TEXT_OCTETS].ljust(TEXT_OCTETS) for text in chosen)
        return ParameterValues(FORMAT_VISIBLE_STRING, tuple(octets))


class ParameterChannel:
    """Requests on one record index of one drive.

    ``index`` is the record's; on the local one the axis number is mirrored and ignored: a request is for the axis whose
    access point it came to.  With ``further`` axes, axis number 0 elsewhere is the device, whose parameters are the
    first axis's (assumed), and 1 to n are the axes; a drive with one axis takes the numbers of its model.  ``client``
    is the key of the requesting connection, which alone gets the answer; a read without a connection is client 0, which
    has no request.  ``place`` is the slot and subslot of the access point; requests at two of them do not meet.  There
    are as many states as connections and access points at most: the caller knows which places exist.

    ``strict`` as in :class:`_ParameterAccess`.

    ``latency`` gives the time in ns after which the next request is carried out; None: no delay.
    """

    __slots__ = ("_accesses", "_latency", "_local", "_responses", "_working")

    def __init__(
        self,
        store: ParameterStore,
        index: int = 47,
        *,
        further: Sequence[ParameterStore] = (),
        strict: bool = True,
        latency: Callable[[], int] | None = None,
    ) -> None:
        self._local = index == LOCAL
        numbers: Container[int] | None = range(len(further) + 2) if further else store.model.access.axis
        if self._local:
            numbers = None
        self._accesses = [_ParameterAccess(each, numbers, strict=strict) for each in (store, *further)]
        self._latency = latency
        self._responses: dict[_State, bytes] = {}
        #: Requests that take their time, one of each client and place at most: when they are over, what they ask, and
        #: of which axis.
        self._working: dict[_State, tuple[int, ParameterRequest, int]] = {}

    def pending(self, client: int = 0, place: tuple[int, int] = _ANYWHERE) -> bool:
        """Whether a response waits to be read."""
        return (client, place) in self._responses

    def reset(self, client: int = 0) -> None:
        """The connection went down: drop its requests; one that the drive still works on is not carried out."""
        for states in (self._responses, self._working):
            for state in [state for state in states if state[0] == client]:
                del states[state]

    def next_deadline(self) -> int | None:
        """When a request's time is over."""
        return min(due for due, *_ in self._working.values()) if self._working else None

    def handle_timeout(self, now: int) -> None:
        """Carry out the requests whose time is over, in the order in which it ended."""
        over = sorted((due, state) for state, (due, *_) in self._working.items() if due <= now)
        for _, state in over:
            _, request, point = self._working.pop(state)
            self._responses[state] = self._answer(request, point)

    def write_request(
        self, data: bytes, client: int = 0, now: int = 0, point: int = 0, place: tuple[int, int] = _ANYWHERE
    ) -> bool:
        """Accept a request and carry it out, now or after its latency; it replaces one whose response was not read.

        ``point``: the axis whose access point it came to, from 0.

        False while the drive works on the last one of this client at this place: the record write is a state conflict
        (0xB5).  Raises :class:`~pnfarm.errors.DecodeError` when the data is shorter than a request's header: the record
        write is refused (0xB1, length error).  Everything else is answered by a response.
        """
        self.handle_timeout(now)
        state = client, place
        if state in self._working:
            return False
        request = parse_request(data)
        latency = self._latency() if self._latency is not None else 0
        if latency > 0:
            self._responses.pop(state, None)
            self._working[state] = (now + latency, request, point)
        else:
            self._responses[state] = self._answer(request, point)
        return True

    def read_response(
        self, maximum: int = 0xFFFF, client: int = 0, now: int = 0, place: tuple[int, int] = _ANYWHERE
    ) -> bytes | None:
        """The response, once; None when there is none, or not yet (record error 0xB5, state conflict).

        A response longer than ``maximum`` octets becomes the error "response too long", if that fits.
        """
        self.handle_timeout(now)
        response = self._responses.pop((client, place), None)
        if response is None:
            return None
        if len(response) <= maximum:
            return response
        too_long = error_values(ParameterError(ParameterErrorNumber.RESPONSE_TOO_LONG))
        short = emit_response(ParameterResponse(response[0], response[1] | NEGATIVE, response[2], 1, (too_long,)))
        return short if len(short) <= maximum else None

    def _answer(self, request: ParameterRequest, point: int) -> bytes:
        """Carry out a request on the axis that it is for."""
        number = point if self._local else max(0, request.axis - 1)
        return emit_response(self._accesses[number if number < len(self._accesses) else 0].answer(request))
