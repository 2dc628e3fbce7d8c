"""Base mode parameter access of the Moog MSD: each row of tables 9.6 and 9.7 of its manual, octet by octet."""

from __future__ import annotations

import struct

import pytest
from drives_kit import Drive

from pnfarm.drives.profiles.profidrive.parameter_channel import LOCAL, ParameterChannel
from pnfarm.errors import DecodeError


def ask(drive: Drive, text: str, index: int = LOCAL) -> str:
    channel = ParameterChannel(drive.store, index)
    channel.write_request(bytes.fromhex(text))
    response = channel.read_response()
    assert response is not None
    return response.hex(" ").upper()


def error(drive: Drive, request: str, index: int = LOCAL) -> int:
    """The error's number; the response is negative and mirrors reference and axis."""
    octets = bytes.fromhex(request)
    answer = bytes.fromhex(ask(drive, request, index))
    assert answer[:3] == bytes([octets[0], octets[1] | 0x80, octets[2]])
    assert answer[4] == 0x44
    return int.from_bytes(answer[6:8], "big")


# table 9.6: the fields


@pytest.mark.parametrize("reference", [0x00, 0x01, 0x7F, 0xFF])
def test_the_reference_is_mirrored(msd: Drive, reference: int) -> None:
    """Table 9.6, request reference; 0 is reserved there, and the examples of 9.4 use it."""
    assert ask(msd, f"{reference:02X} 01 00 01 10 01 03 96 00 00") == f"{reference:02X} 01 00 01 42 01 00 7E"


@pytest.mark.parametrize("identifier", [0x00, 0x03, 0x3F, 0x40, 0x7F, 0x80, 0xFF])
def test_reserved_request_identifiers_are_not_supported(msd: Drive, identifier: int) -> None:
    """Table 9.6, request ID; the number is the profile's, table 9.7 ends below it."""
    answer = ask(msd, f"07 {identifier:02X} 00 01 10 01 03 96 00 00")
    assert answer == f"07 {identifier | 0x80:02X} 00 01 44 01 00 21"


@pytest.mark.parametrize("axis", [0x00, 0x01, 0xFE, 0xFF])
def test_the_axis_is_mirrored_and_counts_on_the_global_index_only(msd: Drive, axis: int) -> None:
    """Table 9.6, axis no.; table 9.7, 0x19.  The drive's own index, 0xB02E, is the local one (9.1)."""
    request = f"07 01 {axis:02X} 01 10 01 03 96 00 00"
    assert ask(msd, request) == f"07 01 {axis:02X} 01 42 01 00 7E"
    if axis:
        assert error(msd, request, 0xB02F) == 0x19


@pytest.mark.parametrize(("count", "number"), [(0x00, 0x16), (0x28, 0x16), (0xFF, 0x16), (0x02, 0x16)])
def test_the_number_of_parameters_is_1_to_39_and_as_many_as_there_are(msd: Drive, count: int, number: int) -> None:
    assert error(msd, f"07 01 00 {count:02X} 10 01 03 96 00 00") == number


@pytest.mark.parametrize("attribute", [0x00, 0x11, 0x40, 0x70, 0x80, 0xF0, 0xFF])
def test_reserved_attributes_are_no_address(msd: Drive, attribute: int) -> None:
    """Table 9.6, attribute; the drive has none of the maker's own (0x80 to 0xF0)."""
    assert error(msd, f"07 01 00 01 {attribute:02X} 01 03 96 00 00") == 0x16


def test_elements_are_1_to_234(msd: Drive) -> None:
    """Table 9.6, no. of elements: P-1289 has as many characters, 0xEB is no address."""
    assert ask(msd, "07 01 00 01 10 05 05 09 00 00") == "07 01 00 01 41 05 44 52 49 56 45 00"
    assert ask(msd, "07 01 00 01 10 EA 05 09 00 00").startswith("07 01 00 01 41 EA 44 52 49")
    assert error(msd, "07 01 00 01 10 EB 05 09 00 00") == 0x16


@pytest.mark.parametrize("number", [0x0000, 0x0009, 0xFFFF])
def test_numbers_without_a_parameter_are_not_allowed(msd: Drive, number: int) -> None:
    assert error(msd, f"07 01 00 01 10 01 {number:04X} 00 00") == 0x00


@pytest.mark.parametrize(
    ("format_", "number"),
    [
        ("42", None),
        ("06", None),  # Unsigned16
        ("03", None),  # Integer16
        ("41", 0x05),
        ("43", 0x05),
        ("07", 0x05),
        ("40", 0x05),  # zero
        ("00", 0x17),
        ("37", 0x17),
        ("45", 0x17),
        ("FF", 0x17),
    ],
)
def test_formats_are_those_of_the_table(msd: Drive, format_: str, number: int | None) -> None:
    """Table 9.6, format; a data type of the value's width serves for it."""
    width = {"41": "07 00", "43": "00 00 00 07", "07": "00 00 00 07"}.get(format_, "00 07")
    request = f"07 02 00 01 10 01 03 96 00 00 {format_} 01 {width}"
    if number is None:
        assert ask(msd, request) == "07 02 00 01"
        assert msd.store.get("P-0918") == 7
    else:
        assert error(msd, request) == number


def test_a_response_of_several_parameters_has_each_ones_values_or_error(msd: Drive) -> None:
    """Tables 9.4 and 9.5: the first parameter to the n-th, addresses before values."""
    addresses = "10 01 03 96 00 00 10 01 00 09 00 00 10 03 03 B7 00 01"
    assert ask(msd, f"07 01 00 03 {addresses}") == ("07 81 00 03 42 01 00 7E 44 01 00 00 42 03 E6 79 E6 7A E6 7B")
    changes = "10 01 03 96 00 00 10 01 05 03 00 00 42 01 00 05 43 01 00 00 00 09"
    assert ask(msd, f"08 02 00 02 {changes}") == "08 02 00 02"
    assert (msd.store.get("P-0918"), msd.store.get("P-1283")) == (5, 9)


def test_less_than_a_header_is_no_request(msd: Drive) -> None:
    with pytest.raises(DecodeError):
        ParameterChannel(msd.store, LOCAL).write_request(bytes(3))


# table 9.7: the errors


@pytest.mark.parametrize(
    ("request_", "number"),
    [
        ("01 00 01 10 01 00 09 00 00", 0x00),
        ("02 00 01 10 01 03 B0 00 00 42 01 00 01", 0x01),
        ("02 00 01 10 01 05 07 00 00 42 01 07 D1", 0x02),  # P-1287 above 2000
        ("01 00 01 10 01 03 B7 00 14", 0x03),
        ("01 00 01 10 01 03 96 00 01", 0x04),
        ("02 00 01 10 01 03 96 00 00 43 01 00 00 00 07", 0x05),
        ("02 00 01 10 01 03 B8 00 00 42 01 00 05", 0x06),
        ("02 00 01 20 01 03 96 00 01 42 01 00 05", 0x07),
        ("01 00 01 30 01 03 96 00 00", 0x0F),
        ("02 00 01 10 01 03 93 00 00 42 01 03 C7", 0x11),
        ("02 00 01 10 01 03 9A 00 00 42 01 12 67", 0x14),
        ("01 00 01 10 01 03 96 FF FF", 0x16),
        ("02 00 01 10 01 03 96 00 00 45 01 00 05", 0x17),
        ("02 00 01 10 02 04 E7 00 00 42 01 00 05", 0x18),
        ("02 00 01 30 01 03 96 00 00 42 01 00 05", 0x20),
    ],
)
def test_each_error_with_a_reason_is_reported(msd: Drive, request_: str, number: int) -> None:
    assert error(msd, f"07 {request_}") == number


def test_the_channel_cannot_change_a_set_point_that_the_telegram_carries(msd: Drive) -> None:
    """Table 9.7, 0x0B."""
    msd.store.plug_telegram(1)
    msd.image.valid = 1
    assert error(msd, "07 02 00 01 10 01 03 C7 00 00 42 01 04 7F") == 0x0B


def test_a_response_that_does_not_fit_the_block_is_too_long(msd: Drive) -> None:
    """Table 9.7, 0x15; 15, P-0974: 378 octets."""
    answer = bytes.fromhex(ask(msd, "07 01 00 02" + " 10 75 03 D4 00 00" * 2))
    assert answer[1] == 0x81
    assert answer[-4:] == bytes.fromhex("44 01 00 15")
    assert len(answer) <= 378


# attributes 0x20 and 0x30


def test_a_description_has_46_octets_and_its_elements_are_read_alone(msd: Drive) -> None:
    """9.3, sub index: the descriptive element accessed; profile 6.2.1.3."""
    whole = bytes.fromhex(ask(msd, "07 01 00 01 20 01 05 03 00 00"))
    assert whole[:6] == bytes.fromhex("07 01 00 01 0A 2E")
    body = whole[6:]
    assert struct.unpack(">HHfH4x16sII8x", body) == (7, 0, 1.0, 0, b"COM_DP_Bus_Timeo", 0, 0xFFFFFFFF)
    parts = [bytes.fromhex(ask(msd, f"07 01 00 01 20 01 05 03 00 {place:02X}"))[6:] for place in range(1, 13)]
    assert (
        b"".join(part[:width] for part, width in zip(parts, (2, 2, 4, 2, 4, 16, 4, 4, 2, 2, 2, 2), strict=True)) == body
    )
    assert error(msd, "07 01 00 01 20 01 05 03 00 0D") == 0x03


@pytest.mark.parametrize(
    ("pnu", "identifier", "factor"),
    [(338, 7, 1.0), (918, 6, 1.0), (1261, 4, 100 / 0x40000000), (1293, 0x0309, 1.0)],
)
def test_the_factor_and_its_bit_are_those_of_the_parameter_channel(
    msd: Drive, pnu: int, identifier: int, factor: float
) -> None:
    """8.2.4, tables 8.15 and 8.16: bit 8 is that of a data type of which nothing is calculated."""
    body = bytes.fromhex(ask(msd, f"07 01 00 01 20 01 {pnu:04X} 00 00"))[6:]
    assert struct.unpack(">HHf", body[:8])[::2] == (identifier, pytest.approx(factor, rel=1e-6))


def test_only_p_0951_has_texts(msd: Drive) -> None:
    """9.3, attribute: text; table 9.7, 0x0F and 0x20; 10.9 speaks of those of P-0951 alone."""
    for pnu in sorted(set(msd.model.parameters) - {951}):
        assert error(msd, f"07 01 00 01 30 01 {pnu:04X} 00 00") == 0x0F


@pytest.mark.parametrize(
    ("pnu", "element", "code", "value"),
    [
        (167, 0, "08", "42 48 00 00"),  # a FloatingPoint in its own format
        (284, 0, "09", "41 00"),  # a character of a VisibleString
    ],
)
def test_table_8_17_a_value_is_written_in_the_format_of_its_data_type(
    msd: Drive, pnu: int, element: int, code: str, value: str
) -> None:
    """Table 9.6: formats 0x01 to 0x36 are the data types, of which the parameter's description tells one."""
    assert ask(msd, f"01 02 00 01 10 01 {pnu:04x} {element:04x} {code} 01 {value}") == "01 02 00 01"
    assert msd.store.read(pnu, element, 1) == [int(value.replace(" ", "")[: 2 if code == "09" else 8], 16)]


@pytest.mark.parametrize(
    ("pnu", "code", "value"),
    [(271, "08", "3f 80 00 00"), (918, "09", "41 00"), (167, "09", "41 00")],
)
def test_table_8_17_a_value_is_not_written_in_the_format_of_another_data_type(
    msd: Drive, pnu: int, code: str, value: str
) -> None:
    assert ask(msd, f"01 02 00 01 10 01 {pnu:04x} 0000 {code} 01 {value}") == "01 82 00 01 44 01 00 05"
