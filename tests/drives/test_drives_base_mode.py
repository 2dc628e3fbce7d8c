"""Base mode parameter access: the octets, the drive's channel, the controller's end."""

from __future__ import annotations

import random
from dataclasses import replace
from typing import TYPE_CHECKING

import parameter_requests as requester
import pytest
from drives_kit import Drive, new_drive
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.drives.catalogue import models
from pnfarm.drives.parameters.parameter import ParameterError, ParameterErrorNumber
from pnfarm.drives.parameters.store import ParameterStore
from pnfarm.drives.profiles.profidrive.base_mode import (
    ATTRIBUTE_DESCRIPTION,
    ATTRIBUTE_TEXT,
    FORMAT_BYTE,
    FORMAT_DWORD,
    FORMAT_ERROR,
    FORMAT_WORD,
    FORMAT_ZERO,
    MAX_ELEMENTS,
    REQUEST_CHANGE,
    REQUEST_READ,
    ParameterAddress,
    ParameterRequest,
    ParameterResponse,
    ParameterValues,
    emit_request,
    emit_response,
    entry_octets,
    error_values,
    format_octets,
    parse_request,
    parse_response,
)
from pnfarm.drives.profiles.profidrive.description import format_of
from pnfarm.drives.profiles.profidrive.fault_buffer import active_faults, fault_situations
from pnfarm.drives.profiles.profidrive.parameter_channel import LOCAL, ParameterChannel
from pnfarm.errors import DecodeError
from pnfarm.wire.octets import Reader

if TYPE_CHECKING:
    from collections.abc import Sequence

E = ParameterErrorNumber
#: Octets of the profile's usual block.
MAX_BLOCK = 240
#: AKD PROFINET manual 3.6.2: DRV.OPMODE 2 through PNU 930.
MANUAL_REQUEST = bytes.fromhex("05 02 00 01 10 01 03 A2 00 00 42 01 00 02")
MANUAL_RESPONSE = bytes.fromhex("05 02 00 01 00 00")


def ask(drive: Drive, data: bytes, index: int = 47) -> bytes:
    channel = ParameterChannel(drive.store, index)
    channel.write_request(data)
    response = channel.read_response()
    assert response is not None
    return response


@pytest.fixture(params=sorted(name for name, entry in models().items() if entry.bus == "profinet"))
def drive(request: pytest.FixtureRequest) -> Drive:
    """A drive of each model with PROFIdrive's parameter access."""
    return new_drive(request.param)


def read(drive: Drive, *addresses: ParameterAddress) -> ParameterResponse:
    return parse_response(ask(drive, emit_request(requester.read_request(7, addresses))))


def change(drive: Drive, *changes: tuple[ParameterAddress, ParameterValues]) -> ParameterResponse:
    return parse_response(ask(drive, emit_request(requester.change_request(8, changes))))


def number_of(response: ParameterResponse, position: int = 0) -> int:
    assert response.negative
    error = requester.response_error(response.entries[position])
    assert error is not None
    return error.number


# the manual's examples


def test_the_manuals_example_switches_the_operation_mode(akd: Drive) -> None:
    assert ask(akd, MANUAL_REQUEST) == MANUAL_RESPONSE
    assert akd.axis.drive.settings.opmode == 2


def test_the_manuals_example_is_what_a_requester_sends_and_accepts() -> None:
    request = requester.change_request(5, [(ParameterAddress(930), ParameterValues(FORMAT_WORD, (2,)))])
    assert emit_request(request) == MANUAL_REQUEST
    assert parse_request(MANUAL_REQUEST) == request
    assert requester.results(request, parse_response(MANUAL_RESPONSE)) == [ParameterValues(0)]


def test_other_manuals_examples_are_understood() -> None:
    # Moog MSD manual, tables 9.12 to 9.18
    assert parse_response(bytes.fromhex("00 01 00 01 42 01 00 09")).entries == (ParameterValues(FORMAT_WORD, (9,)),)
    assert parse_response(bytes.fromhex("00 01 00 01 43 01 01 02 03 04")).entries == (
        ParameterValues(FORMAT_DWORD, (0x01020304,)),
    )
    negative = parse_response(bytes.fromhex("00 81 00 01 44 01 00 00"))
    assert number_of(negative) == E.IMPERMISSIBLE_PNU
    request = parse_request(bytes.fromhex("00 02 00 01 10 05 03 93 00 00 42 05 03C7 04F6 04F6 04F6 0000"))
    assert request.addresses == (ParameterAddress(915, 0, 5),)
    assert request.values[0].values == (0x3C7, 0x4F6, 0x4F6, 0x4F6, 0)
    assert parse_response(bytes.fromhex("00 02 00 01")).entries == ()


# reading and changing


def test_each_parameter_is_read_in_its_format(drive: Drive) -> None:
    for parameter in drive.model.parameters.values():
        count = min(max(parameter.elements, 1), MAX_ELEMENTS)
        request = requester.read_request(1, [ParameterAddress(parameter.pnu, 0, count)])
        response = parse_response(ask(drive, emit_request(request)))
        entry = response.entries[0]
        wanted = format_of(parameter, typed=drive.model.access.typed_formats)
        assert (response.response_id, entry.format) == (REQUEST_READ, wanted)
        assert format_octets(entry.format) == parameter.octets
        mask = (1 << 8 * parameter.octets) - 1
        assert list(entry.values) == [value & mask for value in drive.store.read(parameter.pnu, 0, count)]


#: What backs a writable parameter that takes a few values only, each with tests of its own.
NO_VALUES = {
    "home", "enable", "service", "task-continue", "task-load", "task-move", "task-set", "refuse", "telegram",
    "fault-situations", "kept-situations",
}  # fmt: skip


def test_each_writable_parameter_takes_its_limits_over_the_wire(drive: Drive) -> None:
    for parameter in drive.model.parameters.values():
        if not parameter.writable or parameter.elements or parameter.argument in NO_VALUES:
            continue
        mask = (1 << 8 * parameter.octets) - 1
        for value in (parameter.minimum, parameter.maximum):
            values = ParameterValues(format_of(parameter), (value & mask,))
            response = change(drive, (ParameterAddress(parameter.pnu), values))
            assert response.response_id == REQUEST_CHANGE, parameter
            drive.axis.commands.tail = drive.axis.commands.settings.head
        if parameter.maximum < parameter.highest:
            values = ParameterValues(format_of(parameter), ((parameter.maximum + 1) & mask,))
            assert number_of(change(drive, (ParameterAddress(parameter.pnu), values))) == E.LIMIT_EXCEEDED


def test_negative_values_travel_as_twos_complement(akd: Drive) -> None:
    change(akd, (ParameterAddress(1005), ParameterValues(FORMAT_WORD, (0xFF5D,))))
    assert akd.store.read(1005) == [-163]
    assert requester.signed_values(read(akd, ParameterAddress(1005)).entries[0]) == (-163,)


def test_an_odd_number_of_octets_is_filled(akd: Drive) -> None:
    data = ask(akd, emit_request(requester.read_request(1, [ParameterAddress(2135), ParameterAddress(922)])))
    assert data == bytes.fromhex("01 01 00 02 41 01 01 00 42 01 00 01")
    raw = bytes.fromhex("01 02 00 02 10 01 0857 0000 10 01 0840 0000 41 01 02 00 41 01 01 00")
    assert ask(akd, raw)[1] == REQUEST_CHANGE
    assert (akd.store.read(2135), akd.store.read(2112)) == ([2], [0])


@pytest.mark.parametrize(
    ("code", "accepted"),
    [
        (0x42, True),
        (0x06, True),
        (0x03, True),
        (0x7B, True),
        (0x41, False),
        (0x43, False),
        (0x08, False),
        (0x05, False),
        (0x40, False),
        (0x44, False),
    ],
)
def test_a_word_takes_formats_of_two_octets(code: int, accepted: bool) -> None:
    msd = new_drive("moog-msd")
    response = change(msd, (ParameterAddress(283), ParameterValues(code, (1,))))
    if accepted:
        assert msd.store.read(283) == [1]
    else:
        assert number_of(response) == E.INCORRECT_DATA_TYPE
        assert msd.store.read(283) == [2]


@pytest.mark.parametrize("name", ["akd-profinet", "akd-profinet-2012"])
@pytest.mark.parametrize("code", [0x02, 0x03, 0x06, 0x07, 0x08, 0x0A, 0x40, 0x44, 0x71, 0x7B])
def test_akd_5_6_another_format_than_byte_word_and_double_word_is_illegal(name: str, code: int) -> None:
    drive = new_drive(name)
    response = change(drive, (ParameterAddress(930), ParameterValues(code, (2,))))
    assert number_of(response) == E.ILLEGAL_FORMAT
    assert drive.store.read(930) == [1]


@pytest.mark.parametrize("code", [FORMAT_BYTE, FORMAT_WORD, FORMAT_DWORD])
def test_a_command_takes_any_width(akd: Drive, code: int) -> None:
    assert not change(akd, (ParameterAddress(2111), ParameterValues(code, (1,)))).negative
    assert akd.axis.commands.settings.head == 1


def test_the_whole_fault_buffer_fits_one_response(akd: Drive) -> None:
    akd.axis.faults.buffer[63] = 502
    entry = read(akd, ParameterAddress(947, 0, 64)).entries[0]
    assert entry.values[63] == 502
    assert read(akd, ParameterAddress(947, 63, 1)).entries[0].values == (502,)


# errors


@pytest.mark.parametrize(
    ("address", "number", "value"),
    [
        (ParameterAddress(9), E.IMPERMISSIBLE_PNU, None),
        (ParameterAddress(0), E.IMPERMISSIBLE_PNU, None),
        (ParameterAddress(922, 1), E.NO_ARRAY, None),
        (ParameterAddress(922, 0, 2), E.NO_ARRAY, None),
        (ParameterAddress(947, 64), E.FAULTY_SUBINDEX, 64),
        (ParameterAddress(947, 63, 2), E.FAULTY_SUBINDEX, 64),
        (ParameterAddress(922, 0, 0), E.ADDRESS_IMPERMISSIBLE, None),
        (ParameterAddress(922, 0, 235), E.ADDRESS_IMPERMISSIBLE, None),
        (ParameterAddress(947, 0xFFFF), E.ADDRESS_IMPERMISSIBLE, None),
        (ParameterAddress(922, 0, 1, 0x00), E.ADDRESS_IMPERMISSIBLE, None),
        (ParameterAddress(922, 0, 1, 0x80), E.ADDRESS_IMPERMISSIBLE, None),
        (ParameterAddress(922, 0, 1, ATTRIBUTE_TEXT), E.NO_TEXT_ARRAY, None),
        (ParameterAddress(922, 13, 1, ATTRIBUTE_DESCRIPTION), E.FAULTY_SUBINDEX, 13),
        (ParameterAddress(9, 0, 1, ATTRIBUTE_TEXT), E.IMPERMISSIBLE_PNU, None),
    ],
)
def test_a_read_that_cannot_be_says_why(akd: Drive, address: ParameterAddress, number: int, value: int | None) -> None:
    response = read(akd, address)
    assert (response.response_id, response.count) == (0x81, 1)
    error = requester.response_error(response.entries[0])
    assert error is not None
    assert (error.number, error.value) == (number, value)


@pytest.mark.parametrize(
    ("address", "values", "number"),
    [
        (ParameterAddress(944), (1,), E.NOT_CHANGEABLE),
        (ParameterAddress(930), (3,), E.LIMIT_EXCEEDED),
        (ParameterAddress(930), (1, 2), E.NUMBER_OF_VALUES),
        (ParameterAddress(930), (), E.NUMBER_OF_VALUES),
        (ParameterAddress(930, 1), (1,), E.NO_ARRAY),
        (ParameterAddress(915), (1,), E.OPERATING_STATE),
        (ParameterAddress(922), (2,), E.VALUE_IMPERMISSIBLE),
        (ParameterAddress(2127), (1,), E.OPERATING_STATE),
        (ParameterAddress(930, 0, 1, ATTRIBUTE_DESCRIPTION), (1,), E.DESCRIPTION_NOT_CHANGEABLE),
        (ParameterAddress(930, 0, 1, ATTRIBUTE_TEXT), (1,), E.TEXT_NOT_CHANGEABLE),
        (ParameterAddress(9), (1,), E.IMPERMISSIBLE_PNU),
    ],
)
def test_a_change_that_is_refused_says_why(
    akd: Drive, address: ParameterAddress, values: tuple[int, ...], number: int
) -> None:
    before = akd.store.read(930)
    response = change(akd, (address, ParameterValues(FORMAT_WORD, values)))
    assert (response.response_id, number_of(response)) == (0x82, number)
    assert akd.store.read(930) == before


def test_one_bad_parameter_of_several_makes_the_response_negative_and_keeps_the_others(akd: Drive) -> None:
    response = read(akd, ParameterAddress(922), ParameterAddress(9), ParameterAddress(2108))
    assert (response.response_id, response.count) == (0x81, 3)
    assert response.entries[0].values == (1,)
    assert number_of(response, 1) == E.IMPERMISSIBLE_PNU
    assert response.entries[2].values == (10_000_170,)
    word = ParameterValues(FORMAT_WORD, (2,))
    response = change(akd, (ParameterAddress(944), word), (ParameterAddress(930), word))
    assert response.response_id == 0x82
    assert number_of(response, 0) == E.NOT_CHANGEABLE
    assert response.entries[1] == ParameterValues(FORMAT_ZERO)
    assert akd.axis.drive.settings.opmode == 2


@pytest.mark.parametrize(
    ("data", "number", "entries"),
    [
        ("05 03 00 01 10 01 03A2 0000", E.SERVICE_NOT_SUPPORTED, 1),
        ("05 00 00 01 10 01 03A2 0000", E.SERVICE_NOT_SUPPORTED, 1),
        ("05 01 00 00", E.ADDRESS_IMPERMISSIBLE, 1),
        ("05 01 00 28", E.ADDRESS_IMPERMISSIBLE, 1),
        ("05 01 00 02 10 01 03A2 0000", E.ADDRESS_IMPERMISSIBLE, 1),
        ("05 01 03 01 10 01 03A2 0000", E.AXIS_NONEXISTENT, 1),
        ("05 02 00 01 10 01 03A2 0000", E.NUMBER_OF_VALUES, 1),
        ("05 02 00 01 10 01 03A2 0000 42 02 0001", E.NUMBER_OF_VALUES, 1),
        ("05 02 00 01 10 01 03A2 0000 37 01 0001", E.ILLEGAL_FORMAT, 1),
        ("05 02 00 01 10 01 03A2 0000 00 01 0001", E.ILLEGAL_FORMAT, 1),
        ("05 01 03 02 10 01 03A2 0000 10 01 03A2 0000", E.AXIS_NONEXISTENT, 2),
    ],
)
def test_a_broken_request_is_answered_by_an_error(akd: Drive, data: str, number: int, entries: int) -> None:
    response = parse_response(ask(akd, bytes.fromhex(data)))
    assert response.reference == 5
    assert response.response_id & 0x80
    assert [number_of(response, n) for n in range(entries)] == [number] * entries
    assert len(response.entries) == entries


def test_the_local_index_does_not_look_at_the_axis(akd: Drive) -> None:
    data = bytes.fromhex("05 01 03 01 10 01 039A 0000")
    assert ask(akd, data, LOCAL) == bytes.fromhex("05 01 03 01 42 01 0001")
    assert ask(akd, data, 0xB02F)[1] == 0x81


# lengths


def test_39_double_words_fit_a_response(akd: Drive) -> None:
    response = read(akd, *[ParameterAddress(2108)] * 39)
    assert not response.negative
    assert len(emit_response(response)) == 238


def test_what_does_not_fit_240_octets_is_too_long_and_the_rest_is_answered(akd: Drive) -> None:
    response = read(akd, ParameterAddress(947, 0, 64), ParameterAddress(980, 0, 100), ParameterAddress(922))
    assert len(response.entries[0].values) == 64
    assert number_of(response, 1) == E.RESPONSE_TOO_LONG
    assert response.entries[2].values == (1,)
    assert not read(akd, ParameterAddress(980, 0, 117)).negative


@given(
    st.lists(
        st.builds(
            ParameterAddress,
            st.sampled_from([9, 915, 922, 947, 980, 2108, 2135]),
            st.integers(0, 120),
            st.integers(0, 255),
        ),
        min_size=1,
        max_size=39,
    )
)
def test_no_response_outgrows_its_block(addresses: list[ParameterAddress]) -> None:
    response = ask(DRIVE, emit_request(requester.read_request(1, addresses)))
    assert len(response) <= MAX_BLOCK
    assert parse_response(response).count == len(addresses)


# descriptions


def test_a_description_has_type_limits_and_name(akd: Drive) -> None:
    response = parse_response(ask(akd, emit_request(requester.describe_request(1, 2135))))
    entry = response.entries[0]
    assert (response.response_id, entry.format) == (REQUEST_READ, 0x0A)
    reader = Reader(bytes(entry.values))
    assert reader.u16() == 0x0005  # Unsigned8
    assert reader.u16() == 0
    assert reader.f32() == 1.0
    reader.skip(6)
    assert reader.bytes(16) == b"DRV.OPMODE      "
    assert (reader.u32(), reader.u32()) == (0, 2)
    assert reader.remaining == 8
    akd.store.write(2135, 0, [2])
    identifier = read(akd, ParameterAddress(2135, 1, 1, ATTRIBUTE_DESCRIPTION)).entries[0].values
    assert identifier == (0x10, 0x05)
    assert read(akd, ParameterAddress(947, 1, 1, ATTRIBUTE_DESCRIPTION)).entries[0].values == (0x42, 0x06)
    assert read(akd, ParameterAddress(947, 2, 1, ATTRIBUTE_DESCRIPTION)).entries[0].values == (0, 64)


def test_each_parameter_has_a_description_or_the_drive_has_no_such_parameter(drive: Drive) -> None:
    if not drive.model.access.descriptions:
        for pnu in drive.model.parameters:
            response = read(drive, ParameterAddress(pnu, 0, 1, ATTRIBUTE_DESCRIPTION))
            assert number_of(response) == E.NO_DESCRIPTION
        return
    for parameter in drive.model.parameters.values():
        whole = read(drive, ParameterAddress(parameter.pnu, 0, 1, ATTRIBUTE_DESCRIPTION)).entries[0].values
        parts = [
            read(drive, ParameterAddress(parameter.pnu, n, 1, ATTRIBUTE_DESCRIPTION)).entries[0].values
            for n in range(1, 13)
        ]
        assert len(whole) == 46
        assert whole == tuple(octet for part in parts for octet in part)


# the channel


def test_a_response_is_read_once_and_a_read_before_it_is_a_state_conflict(akd: Drive) -> None:
    channel = ParameterChannel(akd.store)
    assert channel.read_response() is None
    channel.write_request(MANUAL_REQUEST)
    assert channel.pending()
    assert channel.read_response() == MANUAL_RESPONSE
    assert channel.read_response() is None
    channel.write_request(MANUAL_REQUEST)
    channel.reset()
    assert channel.read_response() is None


def test_a_new_request_replaces_one_whose_response_was_not_read(akd: Drive) -> None:
    channel = ParameterChannel(akd.store)
    channel.write_request(MANUAL_REQUEST)
    channel.write_request(bytes.fromhex("06 01 00 01 10 01 039A 0000"))
    assert channel.read_response() == bytes.fromhex("06 01 00 01 42 01 0001")


def test_a_request_without_its_header_is_no_request(akd: Drive) -> None:
    channel = ParameterChannel(akd.store)
    for length in range(4):
        with pytest.raises(DecodeError):
            channel.write_request(MANUAL_REQUEST[:length])
    assert not channel.pending()


def test_a_response_longer_than_the_reader_takes_is_too_long(akd: Drive) -> None:
    channel = ParameterChannel(akd.store)
    request = emit_request(requester.read_request(3, [ParameterAddress(947, 0, 64)]))
    channel.write_request(request)
    assert channel.read_response(20) == bytes.fromhex("03 81 00 01 44 01 00 15")
    channel.write_request(request)
    assert channel.read_response(4) is None


def test_a_drive_may_answer_a_change_with_its_header_alone(akd: Drive) -> None:
    described = replace(akd.model, access=replace(akd.model.access, change_response_values=False))
    channel = ParameterChannel(ParameterStore(described, akd.store.handle))
    channel.write_request(MANUAL_REQUEST)
    assert channel.read_response() == MANUAL_RESPONSE[:4]


# the requester


def test_results_belong_to_their_request() -> None:
    request = requester.read_request(5, [ParameterAddress(922), ParameterAddress(930)])
    word = ParameterValues(FORMAT_WORD, (1,))
    error = ParameterValues(FORMAT_ERROR, (2, 7))
    good = ParameterResponse(5, 0x81, 0, 2, (word, error))
    first, second = requester.results(request, good)
    assert first == word
    assert isinstance(second, ParameterError)
    assert (second.number, second.value) == (2, 7)
    for wrong in (
        ParameterResponse(6, 1, 0, 2, (word, word)),
        ParameterResponse(5, 2, 0, 2, (word, word)),
        ParameterResponse(5, 1, 0, 1, (word,)),
    ):
        with pytest.raises(DecodeError):
            requester.results(request, wrong)
    whole = ParameterResponse(5, 0x81, 0, 1, (ParameterValues(FORMAT_ERROR, (0x19,)),))
    assert [e.number for e in requester.results(request, whole) if isinstance(e, ParameterError)] == [0x19, 0x19]
    empty = requester.response_error(ParameterValues(FORMAT_ERROR))
    assert empty is not None
    assert empty.number == E.NUMBER_OF_VALUES
    strange = requester.response_error(ParameterValues(FORMAT_ERROR, (0x65,)))
    assert "manufacturer specific" in str(strange)


def test_error_numbers_carry_the_subindex_where_the_profile_says_so() -> None:
    assert error_values(ParameterError(E.LIMIT_EXCEEDED, 3)).values == (2, 3)
    assert error_values(ParameterError(E.OPERATING_STATE, 3)).values == (0x11,)
    assert error_values(ParameterError(E.LIMIT_EXCEEDED)).values == (2,)
    assert all(number.words for number in E)


# any octets

FORMATS = [0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x08, 0x09, 0x0A, 0x71, 0x72, 0x7B, 0x7C, 0x41, 0x42, 0x43, 0x44]


@st.composite
def entries(draw: st.DrawFn) -> ParameterValues:
    code = draw(st.sampled_from([0, FORMAT_ZERO, *FORMATS]))
    octets = format_octets(code)
    if not octets:
        return ParameterValues(code)
    return ParameterValues(code, tuple(draw(st.lists(st.integers(0, (1 << 8 * octets) - 1), max_size=20))))


addresses = st.builds(
    ParameterAddress, st.integers(0, 0xFFFF), st.integers(0, 0xFFFF), st.integers(0, 255), st.integers(0, 255)
)
octet = st.integers(0, 255)


@given(octet, octet, st.lists(st.tuples(addresses, entries()), min_size=1, max_size=39))
def test_requests_come_back_from_the_wire(
    reference: int, axis: int, parts: Sequence[tuple[ParameterAddress, ParameterValues]]
) -> None:
    change_request = requester.change_request(reference, parts, axis)
    assert parse_request(emit_request(change_request)) == change_request
    read_request = requester.read_request(reference, [address for address, _ in parts], axis)
    assert parse_request(emit_request(read_request)) == read_request


@given(octet, st.sampled_from([1, 2, 0x81, 0x82]), octet, st.lists(entries(), max_size=39))
def test_responses_come_back_from_the_wire(
    reference: int, response_id: int, axis: int, parts: list[ParameterValues]
) -> None:
    response = ParameterResponse(reference, response_id, axis, len(parts), tuple(parts))
    data = emit_response(response)
    assert len(data) == 4 + sum(entry_octets(entry) for entry in parts)
    assert parse_response(data) == response


@given(st.binary(max_size=300))
def test_any_octets_give_a_value_or_a_decode_error(data: bytes) -> None:
    for parse in (parse_request, parse_response):
        reason = None
        try:
            parse(data)
        except DecodeError as exc:
            reason = exc.reason
        assert reason in {None, "short", "bad-format"}


def test_what_cannot_be_on_the_wire_is_not_sent() -> None:
    with pytest.raises(ValueError, match="format"):
        emit_response(ParameterResponse(1, 1, 0, 1, (ParameterValues(0x37, (1,)),)))
    with pytest.raises(ValueError, match="octets"):
        emit_request(ParameterRequest(1, 2, 0, (), (ParameterValues(FORMAT_WORD, (70000,)),)))


DRIVE = new_drive("akd-profinet")


def test_a_hundred_thousand_wild_requests_leave_the_drive_answering() -> None:
    wild = random.Random(1)
    drive = new_drive("akd-profinet")
    channel = ParameterChannel(drive.store)
    numbers = [*drive.model.parameters, 0, 9, 65535]
    for _ in range(100_000):
        count = wild.randint(1, 4)
        head = bytes((wild.randrange(256), wild.choice((1, 2, 2, 3)), 0, count))
        parts = [
            bytes((wild.choice((0x10, 0x10, 0x20, 0x30)), wild.choice((1, 1, 1, 2, 64, 255))))
            + wild.choice(numbers).to_bytes(2, "big")
            + wild.choice((0, 0, 0, 1, 0xFFFF)).to_bytes(2, "big")
            for _ in range(count)
        ]
        data = bytearray(
            head + b"".join(parts) + bytes((wild.choice((0x41, 0x42, 0x43)), 1)) + wild.randbytes(wild.randrange(12))
        )
        for _ in range(wild.randrange(3)):
            data[wild.randrange(len(data))] = wild.randrange(256)
        cut = bytes(data[: wild.randint(0, len(data))] if wild.random() < 0.3 else data)
        try:
            channel.write_request(cut)
        except DecodeError:
            assert len(cut) < 4
            continue
        response = channel.read_response()
        assert response is not None
        assert len(response) <= MAX_BLOCK
        assert parse_response(response).reference == cut[0]
        drive.store.events()
        if wild.random() < 0.1:
            drive.axis.commands.tail = drive.axis.commands.settings.head
    assert drive.store.read(964, 0, 1) == [0x0105]
    drive.store.set("DRV.NVSAVE", 1)
    assert new_drive("akd-profinet").store.restore(drive.store.snapshot()) == []


# the fault buffer


def test_fault_situations_are_shown_newest_first(akd: Drive) -> None:
    akd.axis.faults.code[0] = 702 | 1 << 24
    akd.axis.faults.buffer[0] = 702
    akd.axis.faults.buffer[8] = 502
    akd.axis.faults.buffer[9] = 602
    assert active_faults(akd.axis) == [702]
    assert fault_situations(akd.axis)[:3] == [[702], [502, 602], []]
