"""Parameter records: defaults, values by name, and what is wrong with one that a controller wrote."""

import struct

import pytest
from gsdml_examples import ISLAND, example
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.protocols.profinet.gsdml.document import Info
from pnfarm.protocols.profinet.gsdml.languages import Languages
from pnfarm.protocols.profinet.gsdml.parameters import parameter_records
from pnfarm.protocols.profinet.gsdml.records import ParameterConst, ParameterRecord, ParameterRef
from pnfarm.protocols.profinet.gsdml.station import PlugError, PluggedModule, PluggedSubmodule, plug_station

MODULES = {1: "DI16", 2: "DO8", 3: "AI4", 4: "VALVES", 5: "SERIAL", 8: "COUNTER2"}


def record(slot, index=1, subslot=1):
    return plug_station(example(ISLAND), access_point="DAP 1", modules=MODULES).submodule(slot, subslot).record(index)


def changed(slot, values):
    station = plug_station(example(ISLAND), access_point="DAP 1", modules=MODULES)
    return parameter_records(station.module(slot), values, example(ISLAND).languages)


# defaults


@pytest.mark.parametrize(
    ("slot", "index", "octets"),
    [
        (1, 1, "0301"),
        (2, 1, "0000"),
        (3, 1, "020494006c00" * 4),
        (4, 1, "010c0014"),
        (4, 2, "40600000" + "62617200"),
        (5, 1, "00002580" + "02" + "0d"),
    ],
)
def test_a_record_begins_with_the_files_constants_and_defaults(slot, index, octets):
    assert record(slot, index).defaults().hex() == octets
    assert record(slot, index).octets().hex() == octets
    assert record(slot, index).complaint(bytes.fromhex(octets)) is None


TYPES = [
    ("Integer8", "-3", "fd"), ("Unsigned8", "0x1F", "1f"), ("Integer16", "-2", "fffe"), ("Unsigned16", "258", "0102"),
    ("Integer32", "-1", "ffffffff"), ("Unsigned32", "1", "00000001"), ("Integer64", "-1", "ff" * 8),
    ("Unsigned64", "1", "00" * 7 + "01"), ("Float32", "1.5", "3fc00000"), ("Float64", "1.5", "3ff8" + "00" * 6),
    ("Boolean", "true", "01"), ("Unsigned16_S", "3", "0003"),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "default", "octets"), TYPES)
def test_a_default_of_each_type_is_big_endian(kind, default, octets):
    one = ParameterRecord(1, len(octets) // 2, refs=(ParameterRef(kind, default=default, name="x"),))
    assert one.defaults().hex() == octets
    assert one.complaint(bytes.fromhex(octets)) is None


def test_texts_and_octets_are_filled_up_with_zeros():
    refs = (
        ParameterRef("VisibleString", 0, length=3, default="ab"),
        ParameterRef("UnicodeString8", 3, length=3, default="é"),
        ParameterRef("OctetString", 6, length=2, default="0xFF"),
    )
    assert ParameterRecord(1, 8, refs=refs).defaults() == b"ab\0" + "é".encode() + b"\0" + b"\xff\0"


@pytest.mark.parametrize("kind", ["OctetString", "VisibleString", "UnicodeString8", "Unsigned16"])
def test_a_value_without_a_default_leaves_what_constants_put_there(kind):
    refs = (ParameterRef(kind, byte_offset=1, length=2, name="x"), ParameterRef("Unsigned8", 3, name="y", default="9"))
    one = ParameterRecord(1, 4, consts=(ParameterConst(b"\1\2\3\4"),), refs=refs)
    assert (one.defaults(), one.octets()) == (b"\1\2\3\x09", b"\1\2\3\x09")


def test_a_default_that_is_not_supported_leaves_what_constants_put_there():
    refs = (
        ParameterRef("BitArea", 0, bit_offset=6, bit_length=4, default="9"),
        ParameterRef("Date", 2, length=7, default="today"),
        ParameterRef("Unsigned8", 1, default="7"),
    )
    one = ParameterRecord(1, 9, consts=(ParameterConst(b"\xaa\xbb\xcc"),), refs=refs)
    assert one.defaults() == b"\xaa\x07\xcc" + bytes(6)


# what was written


@pytest.mark.parametrize(
    ("slot", "index", "octets", "sentence"),
    [
        (1, 1, "03", "record 1 has 1 octets, shorter than its 2"),
        (1, 1, "030100", "record 1 has 3 octets, longer than its 2"),
        (1, 1, "0501", "record 1, Input delay: 5 is written, allowed is 0..4"),
        (3, 1, "020494006c00" * 3 + "040494006c00", "record 1, Range 3: 4 is written, allowed is 0..3"),
        (3, 1, "020394006c00" + "020494006c00" * 3, "record 1, Smoothing 0: 3 is written, allowed is 1 2 4 8 16 32"),
        (4, 2, "41200001" + "62617200", "record 2, Least pressure: 10 is written, allowed is 0.0..10.0"),
        (4, 2, "7fc00000" + "62617200", "record 2, Least pressure: nan is written, allowed is 0.0..10.0"),
        (5, 1, "00002581" + "02" + "0d", "record 1, Bit rate: 9601 is written, allowed is 1200 2400 4800 9600"),
    ],
)
def test_a_written_record_is_held_against_the_file(slot, index, octets, sentence):
    complaint = record(slot, index).complaint(bytes.fromhex(octets))
    assert str(complaint).startswith(sentence)
    assert (complaint.ref is None) == ("octets," in sentence)


def test_octets_that_no_value_covers_are_the_controllers():
    assert record(2).complaint(b"\x01\xff") is None
    assert record(5).complaint(bytes.fromhex("00002580" + "fe" + "00")) is None


@given(st.binary(max_size=30), st.sampled_from([(1, 1), (3, 1), (4, 1), (4, 2), (5, 1)]))
def test_any_octets_are_taken_or_have_one_complaint(octets, place):
    one = record(*place)
    complaint = one.complaint(octets)
    if len(octets) != one.length:
        assert complaint.ref is None
    elif complaint is not None:
        assert complaint.ref in one.refs


# values by name


@pytest.mark.parametrize(
    ("slot", "values", "found"),
    [
        (2, {"Substitute": "hold"}, {(1, 1): "0100"}),
        (2, {"ersatzwert": "HALTEN"}, {(1, 1): "0100"}),
        (2, {"Substitute": 2, "Substitute value": 0xA5}, {(1, 1): "02a5"}),
        (1, {"Wire break check": False}, {(1, 1): "0300"}),
        (1, {"Drahtbruchprüfung": "true", "Input delay": "15 ms"}, {(1, 1): "0401"}),
        (4, {"Least pressure": 2.5, "Coil check time": "100"},
         {(1, 2): "40200000" + "62617200", (1, 1): "010c0064"}),
        (8, {"2/Edge": "both"}, {(2, 1): "03"}),
        (8, {"1.1/Edge": 2, "2.1.0.0/Flanke": "fallend"}, {(1, 1): "02", (2, 1): "02"}),
        (5, {"Terminator": "0x0A"}, {(1, 1): "00002580" + "02" + "0a"}),
    ],
)  # fmt: skip
def test_parameters_are_given_by_name_and_value_or_text_in_any_language(slot, values, found):
    assert {place: octets.hex() for place, octets in changed(slot, values).items()} == found


@pytest.mark.parametrize(
    ("slot", "values", "sentence"),
    [
        (2, {"Subst": 1}, r"slot 2 has no parameter 'Subst', it has Substitute, Substitute value, did you mean Subst"),
        (2, {"Substitute": "hald"}, r"slot 2, Substitute: 'hald' is given, allowed is a number \(off, hold, value\)"),
        (2, {"Substitute": 7}, r"slot 2, Substitute: '7' is given, allowed is 0\.\.2 \(off, hold, value\)"),
        (8, {"Edge": 1}, r"slot 8 has 2 parameters 'Edge', choose one by .*: 1\.1\.0\.0/Edge, 2\.1\.0\.0/Edge"),
        (4, {"Least pressure": "high"}, "slot 4, Least pressure: 'high' is given, allowed is a number"),
        (4, {"Unit": "mmHg!"}, "slot 4, Unit: 'mmHg!' is given, allowed is at most 4 octets"),
    ],
)
def test_parameters_that_the_file_does_not_allow_are_refused_with_what_it_does(slot, values, sentence):
    with pytest.raises(PlugError, match=sentence) as caught:
        changed(slot, values)
    assert caught.value.slot == slot


def test_a_value_is_read_with_its_meaning():
    (substitute, _) = record(2).refs
    assert substitute.value(b"\x01\x00") == 1
    assert dict(substitute.texts)["1"] == "hold"


@pytest.mark.parametrize(
    ("ref", "octets", "value"),
    [
        (ParameterRef("BitArea", bit_length=0), b"\xff", 0),
        (ParameterRef("BitArea", bit_length=0, byte_offset=1), b"\xff", None),
        (ParameterRef("Bit", bit_offset=7, bit_length=2), b"\x80", 1),
        (ParameterRef("Boolean", bit_offset=3), b"\x01", 1),
    ],
)
def test_odd_lengths_and_offsets_of_bits_are_read_as_they_are_written(ref, octets, value):
    assert ref.value(octets) == value
    if value is not None:
        written = bytearray(len(octets))
        ref.put(written, str(value), checked=False)
        assert ref.value(bytes(written)) == value


@pytest.mark.parametrize("limit", ["0.7", "0.9", "-3.4028235E+38", "3.4028235E+38"])
def test_a_float_at_its_limit_is_allowed_although_its_octets_have_a_fraction_beside_it(limit):
    ref = ParameterRef("Float32", default=limit, allowed="-3.4028235E+38 0.7..0.9 3.4028235E+38", name="Filter")
    one = ParameterRecord(1, 4, refs=(ref,))
    octets = one.octets({"Filter": limit})
    assert octets == one.defaults()
    assert one.complaint(octets) is None
    assert one.complaint(struct.pack(">f", 0.69)).text == (
        f"record 1, Filter: 0.69 is written, allowed is {ref.allowed}"
    )


@pytest.mark.parametrize("key", ["5/2 Valve", "1.1.0/5/2 valve", "1.1.1.0/5/2 valve"])
def test_a_parameter_whose_name_begins_like_a_place_is_found_by_its_name(key):
    names = ("5/2 valve", "Other") if key[0] == "5" else ("5/2 valve", "5/2 valve")
    refs = tuple(ParameterRef("Unsigned8", byte_offset=at, name=name) for at, name in enumerate(names))
    submodule = PluggedSubmodule(1, 1, 1, 1, records=(ParameterRecord(1, 2, refs=refs),))
    at = int(key.startswith("1.1.1"))
    octets = parameter_records(PluggedModule(1, 1, "", Info(), (submodule,)), {key: 3}, Languages())[1, 1]
    assert octets == bytes((0, 3) if at else (3, 0))


@given(st.floats(allow_nan=False, width=32), st.integers(0, 0xFFFF))
def test_values_are_read_back_as_they_were_put(pressure, time):
    allowed = 0.0 <= pressure <= 10.0 and 5 <= time <= 1000
    values = {"Least pressure": repr(pressure), "Coil check time": time}
    if not allowed:
        with pytest.raises(PlugError):
            changed(4, values)
        return
    octets = changed(4, values)
    assert struct.unpack(">f", octets[1, 2][:4]) == (pressure,)
    assert int.from_bytes(octets[1, 1][2:], "big") == time
