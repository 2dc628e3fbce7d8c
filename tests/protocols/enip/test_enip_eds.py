"""EDS files as text: read, written, kept."""

import pytest
from decode_reason import reason
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.errors import DecodeError
from pnfarm.protocols.enip.eds.reader import parse_sheet
from pnfarm.protocols.enip.eds.text import Eds, EdsEntry, EdsGroup, EdsSection, EdsString, emit_eds, parse_eds

SHEET = b"""$ a sheet ; with = marks in its comment
[File]
        DescText = "A \\"drive\\" $ not a comment";
        CreateDate = 12-01-2014;
[Device]
        VendCode = 452;      $ the vendor
        ProdName = "AK" "D";
[Params]
        Param1 =
                0,                      $ reserved
                ,,                      $ no path
                0x0010,
                {1, {2, "x"}},
                "";
[Vendor's Own]
        Anything = a b c;
"""


def test_a_sheet_is_sections_entries_and_fields():
    eds = parse_eds(SHEET)
    assert [section.name for section in eds.sections] == ["File", "Device", "Params", "Vendor's Own"]
    assert eds.section("file").entry("desctext").text(0) == 'A "drive" $ not a comment'
    assert eds.section("Device").entry("VendCode").number(0) == 452
    assert eds.section("Device").entry("ProdName").fields == (EdsString("AKD"),)
    parameter = eds.section("Params").entry("Param1")
    assert parameter.fields == ("0", "", "", "0x0010", EdsGroup(("1", EdsGroup(("2", EdsString("x"))))), EdsString(""))
    assert (parameter.number(3), parameter.number(1), parameter.text(99)) == (16, None, "")
    assert eds.section("Vendor's Own").entry("Anything").text(0) == "a b c"


def test_what_was_read_is_written_and_read_again_whether_it_is_known_or_not():
    eds = parse_eds(SHEET)
    octets = emit_eds(eds, ["written by a test"])
    assert octets.startswith(b"$ written by a test\r\n\r\n[File]\r\n")
    assert parse_eds(octets) == eds


def test_a_comment_of_several_lines_stays_a_comment():
    eds = parse_eds(SHEET)
    octets = emit_eds(eds, ["a note\nof two lines"])
    assert octets.startswith(b"$ a note\r\n$ of two lines\r\n\r\n[File]\r\n")
    assert parse_eds(octets) == eds


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (b"Keyword = 1;", "bad-section"),
        (b"[A]\n Keyword 1;", "bad-entry"),
        (b"[A]\n Keyword = 1", "bad-entry"),
        (b'[A]\n Keyword = "open', "bad-text"),
        (b'[A]\n Keyword = 1 "x";', "bad-entry"),
        (b"[A]\n Keyword = {1;", "bad-entry"),
        (b"[A]\n Keyword = " + b"{" * 50, "bad-entry"),
        (b"[A", "bad-text"),
        (b"[A] = 1;", "bad-section"),
    ],
)
def test_what_is_no_sheet_is_refused(text, why):
    assert reason(parse_eds, text) == why


def test_the_refusal_names_the_line():
    with pytest.raises(DecodeError, match="line 4"):
        parse_eds(b"[A]\n\n Keyword = 1\n Other = 2;")


words = st.text("abcXYZ0189.-_#'", min_size=1, max_size=8)
strings = st.builds(EdsString, st.text(st.characters(min_codepoint=1, max_codepoint=255), max_size=40))
fields = st.recursive(
    st.one_of(st.just(""), words, strings),
    lambda inner: st.builds(EdsGroup, st.lists(inner, min_size=1, max_size=3).map(tuple)),
    max_leaves=4,
)
sheets = st.builds(
    Eds,
    st.lists(
        st.builds(
            EdsSection,
            words,
            st.lists(st.builds(EdsEntry, words, st.lists(fields, min_size=1, max_size=6).map(tuple)), max_size=4).map(
                tuple
            ),
        ),
        max_size=4,
    ).map(tuple),
)


@given(sheets)
def test_any_sheet_is_read_as_it_was_written(eds):
    assert parse_eds(emit_eds(eds)) == eds


@given(st.one_of(st.binary(max_size=200), st.text('[]=,;{}$"\\ aA1\n', max_size=80).map(str.encode)))
def test_any_octets_are_a_sheet_or_refused(data):
    assert reason(parse_eds, data) != ""


DEVICE = """[Device]
        VendCode = 1; ProdType = 12; ProdCode = 1; MajRev = 1; MinRev = 1; ProdName = "Waage";
[Params]
        Param1 = 0,,,0x0000,0xCA,4,"Dämpfung","°C","",0.7,0.9,0.7,,,,,,,,,1;
        Param2 = 0,,,0x0000,0xCA,4,"Weight","","",-3.4028235E+38,3.4028235E+38,0.0,,,,,,,,,1;
"""


def test_a_sheet_that_an_editor_stored_as_utf_8_with_its_mark_is_read():
    marked, plain = (parse_sheet(DEVICE.encode(encoding)) for encoding in ("utf-8-sig", "latin-1"))
    assert marked == plain
    assert (marked.parameters[1].name, marked.parameters[1].unit) == ("Dämpfung", "°C")


def test_a_float_at_its_limit_is_allowed_although_its_octets_have_a_fraction_beside_it():
    parameter = parse_sheet(DEVICE.encode("latin-1")).parameters[1]
    for limit in (0.7, 0.9):
        assert parameter.complaint(parameter.given(limit)) == ""
    assert parameter.complaint(parameter.encode(0.69)).endswith("below 0.7")
    assert parameter.complaint(parameter.encode(0.91)).endswith("above 0.9")


def test_the_limits_of_a_whole_type_as_programs_round_them_are_none():
    parameter = parse_sheet(DEVICE.encode("latin-1")).parameters[2]
    assert (parameter.minimum, parameter.maximum) == (None, None)
    assert parameter.complaint(parameter.given(-3.4028234e38)) == ""
