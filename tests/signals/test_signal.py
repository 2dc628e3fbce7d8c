"""A named value in cyclic data: types, bits, scales, byte orders, and a user's text for it."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.config.device import SignalPlace
from pnfarm.signals.signal import Signal, place_signal
from pnfarm.vocabulary.problem import Problem
from pnfarm.wire.value_types import read_type


def signal(kind="uint8", octet=0, bit=None, **more):
    return Signal("pressure", "input", 3, 1, octet, read_type(kind), bit, **more)


def written(one, value, size=9):
    octets = bytearray(b"\xaa" * size)
    one.write(octets, value)
    return octets.hex()


# octets


@pytest.mark.parametrize(
    ("kind", "value", "big", "little"),
    [
        ("int8", -1, "ff", "ff"),
        ("uint16", 0x0102, "0102", "0201"),
        ("int16", -2, "fffe", "feff"),
        ("uint24", 0x010203, "010203", "030201"),
        ("int24", -2, "fffffe", "feffff"),
        ("uint40", 1, "0000000001", "0100000000"),
        ("int48", -1, "ff" * 6, "ff" * 6),
        ("uint56", 0x01020304050607, "01020304050607", "07060504030201"),
        ("int64", -(1 << 63), "80" + "00" * 7, "00" * 7 + "80"),
        ("float32", 1.5, "3fc00000", "0000c03f"),
        ("float64", -0.5, "bfe0" + "00" * 6, "00" * 6 + "e0bf"),
        ("octets[3]", b"\x01\x02\x03", "010203", "010203"),
        ("text[4]", "ab", "61620000", "61620000"),
        ("bool", True, "ff", "ff"),
    ],
)
def test_a_value_of_each_type_is_written_and_read_in_both_orders(kind, value, big, little):
    for order, octets in (("big", big), ("little", little)):
        one = signal(kind, 1, order=order)
        assert written(one, value) == "aa" + octets + "aa" * (8 - len(octets) // 2)
        assert one.read(bytes.fromhex("aa" + octets)) == value


def test_a_bit_is_written_beside_the_others():
    one = signal("bool", 1, 3)
    octets = bytearray(b"\x00\xf0")
    one.write(octets, True)
    assert octets == b"\x00\xf8"
    assert one.read(octets) is True
    one.write(octets, False)
    assert octets == b"\x00\xf0"
    assert (one.place, one.read(octets)) == ("3.1.1.3", False)


@pytest.mark.parametrize(("octets", "value"), [("00", False), ("01", True), ("ff", True)])
def test_a_bool_of_its_own_octet_is_true_for_any_bit(octets, value):
    assert signal("bool").read(bytes.fromhex(octets)) is value


def test_a_scaled_value_is_in_units():
    one = signal("int16", scale=0.01, unit="bar")
    assert written(one, 6.25, 2) == "0271"
    assert one.read(bytes.fromhex("0271")) == pytest.approx(6.25)
    assert one.show(one.read(bytes.fromhex("0271"))) == "6.25"
    assert written(signal("float32", scale=0.5), 3.0, 4) == "40c00000"


@pytest.mark.parametrize(
    ("one", "value", "sentence"),
    [
        (signal("uint8"), 256, "256 is outside of uint8; allowed: 0 to 255"),
        (signal("int8"), -129, "-129 is outside of int8; allowed: -128 to 127"),
        (signal("uint8"), 1.5, "1.5 is not a whole number; allowed: a whole number, 0 to 255"),
        (signal("uint8"), math.nan, "nan is not a whole number"),
        (signal("uint8"), True, "true is not a number"),
        (signal("uint8"), "3", "'3' is not a number"),
        (signal("int16", scale=0.01, unit="bar"), 400,
         "400 is outside of int16 scaled by 0.01; allowed: -327.68 to 327.67 bar"),
        (signal("int16", scale=0.01), math.inf, "inf is not a finite number; allowed: -327.68 to 327.67"),
        (signal("float32"), 1e39, "1e+39 is outside of float32; allowed: -3.40282e+38 to 3.40282e+38"),
        (signal("bool", bit=1), 2, "2 is neither true nor false"),
        (signal("bool", bit=1), "on", "'on' is neither true nor false"),
        (signal("octets[2]"), b"abc", "has 3 octets; allowed: up to 2"),
        (signal("octets[2]"), 5, "5 are not octets"),
        (signal("text[2]"), "äb", "has 3 octets; allowed: up to 2"),
        (signal("text[2]"), 5, "5 is not a text"),
    ],
)  # fmt: skip
def test_a_value_that_does_not_fit_is_refused_and_changes_nothing(one, value, sentence):
    octets = bytearray(8)
    with pytest.raises(Problem) as caught:
        one.write(octets, value)
    assert str(caught.value).startswith(sentence)
    assert octets == bytes(8)


def test_data_that_are_too_short_are_reported():
    with pytest.raises(Problem, match="pressure ends with octet 9 of its submodule; allowed: places in its 8 octets"):
        signal("int16", 8).read(bytes(8))


# texts


@pytest.mark.parametrize(
    ("kind", "text", "value"),
    [
        *[("bool", word, True) for word in ("true", "True", "1", "on", " ON ")],
        *[("bool", word, False) for word in ("false", "0", "off", "Off")],
        ("int16", "-12", -12), ("int16", "0x1F", 31), ("int16", "-0x10", -16), ("int16", "12.0", 12.0),
        ("float32", "1.5", 1.5), ("float32", "1e3", 1000.0), ("float32", "7", 7),
        ("octets[4]", "00 ff", b"\x00\xff"), ("octets[4]", "0x00FF", b"\x00\xff"), ("octets[4]", "", b""),
        ("text[4]", "ab ", "ab "),
    ],
)  # fmt: skip
def test_a_users_text_is_a_value(kind, text, value):
    assert signal(kind).parse(text) == value


@pytest.mark.parametrize(
    ("kind", "text", "sentence"),
    [
        ("bool", "2", "'2' is not a switch; allowed: true, false, on, off, 1 or 0"),
        ("uint8", "x", "'x' is not a number; allowed: a number such as 12, 0x1F or 1.5"),
        ("uint8", "300", "300 is outside of uint8; allowed: 0 to 255"),
        ("uint8", "1.5", "1.5 is not a whole number"),
        ("uint8", "9" * 70, "'999"),
        ("octets[2]", "0g", "'0g' is not hexadecimal; allowed: octets such as '00 01 ff'"),
        ("octets[2]", "010203", "has 3 octets; allowed: up to 2"),
    ],
)
def test_a_text_that_is_no_value_is_refused_with_what_is_allowed(kind, text, sentence):
    with pytest.raises(Problem) as caught:
        signal(kind).parse(text)
    assert str(caught.value).startswith(sentence)


def test_values_of_single_precision_are_shown_with_the_digits_they_have():
    one = signal("float32")
    assert one.show(one.read(bytes.fromhex("3dcccccd"))) == "0.1"
    assert one.show(math.nan) == "nan"


KINDS = st.sampled_from([f"{sign}int{8 * n}" for sign in ("", "u") for n in range(1, 9)]
                        + ["bool", "float32", "float64", "octets[5]", "text[9]"])  # fmt: skip


@given(KINDS, st.sampled_from(["big", "little"]), st.sampled_from([1.0, 0.01, -2.5]), st.binary(min_size=9, max_size=9))
def test_what_is_read_is_shown_parsed_and_written_back(kind, order, scale, octets):
    scale = scale if read_type(kind).is_number else 1.0
    one = signal(kind, order=order, scale=scale)
    value = one.read(octets)
    if isinstance(value, float) and not math.isfinite(value):
        return
    if kind == "text[9]" and "?" in value:
        return
    try:
        again = one.parse(one.show(value))
        back = bytearray(9)
        one.write(back, again)
    except Problem:
        # twelve digits of a scaled value at the end of a wide range
        assert scale != 1
        return
    found = one.read(back)
    if scale == 1:
        assert found == value
    else:
        assert found == pytest.approx(value, rel=1e-9, abs=abs(scale))


def test_a_text_of_octets_that_are_none_can_be_written_as_it_is_read():
    one, octets = signal("text[4]"), bytearray(4)
    assert one.read(b"a\xff\xfe\xff") == "a???"
    one.write(octets, one.read(b"a\xff\xfe\xff"))
    assert bytes(octets) == b"a???"


@given(KINDS, st.text(max_size=12))
def test_any_text_is_a_value_that_can_be_written_or_is_refused(kind, text):
    one = signal(kind)
    try:
        value = one.parse(text)
    except Problem:
        return
    one.write(bytearray(9), value)


# types


@pytest.mark.parametrize("scale", [0.1, 0.01, 0.3, -0.1, 3.0, 7e11, 1e-12])
@pytest.mark.parametrize("name", ["uint64", "int64", "uint56", "int56", "uint48", "int32"])
def test_the_limits_of_a_scaled_number_can_be_written_as_they_are_read(name, scale):
    one = signal(name, scale=scale)
    least, most = one.type.limits
    for raw, beyond in ((least, least - most // 50), (most, most + most // 50)):
        octets = bytearray(one.type.encode(raw))
        value = one.read(octets)
        one.write(octets, value)
        assert one.read(octets) == value
        with pytest.raises(Problem, match=r"is outside of"):
            one.write(octets, beyond * scale)


@pytest.mark.parametrize("name", ["bool", "int8", "uint24", "int64", "float32", "octets[1]", "text[1440]"])
def test_a_type_has_one_name(name):
    assert read_type(name).name == name


@pytest.mark.parametrize(("text", "near"), [("int61", "int16"), ("word", ""), ("octets[0]", ""), ("text[1441]", "")])
def test_a_type_that_is_not_there_is_refused(text, near):
    with pytest.raises(Problem, match=r"is not a type.*; allowed: bool, int8 to int64") as caught:
        read_type(text)
    assert ("did you mean" in str(caught.value)) >= bool(near)


# places of the farm file


def placed(place, inputs=8, outputs=0):
    return place_signal("part_present", SignalPlace.model_validate(place), inputs, outputs)


def test_a_place_is_an_input_where_the_submodule_has_inputs():
    assert placed({"at": "1.1.0.3"}).direction == "input"
    assert placed({"at": "1.1.0.3"}, 0, 2).direction == "output"
    assert placed({"at": "1.1.0.3", "direction": "output"}, 8, 2).direction == "output"
    one = placed({"at": "3.1.0", "type": "int16", "unit": "bar", "scale": 0.01})
    assert (one.type.name, one.unit, one.scale, one.bit, one.name) == ("int16", "bar", 0.01, None, "part_present")


@pytest.mark.parametrize(
    ("place", "sizes", "sentence"),
    [
        ({"at": "1.1.8.0"}, (8, 0),
         "slot 1, subslot 1 has 8 octets of inputs, 1.1.8.0 ends after them; allowed: octets 0 to 7"),
        ({"at": "3.1.7", "type": "int16"}, (8, 0),
         "slot 3, subslot 1 has 8 octets of inputs, 3.1.7 ends after them; allowed: octets 0 to 6"),
        ({"at": "3.1.0", "direction": "output"}, (8, 0),
         ("slot 3, subslot 1 has 0 octets of outputs, 3.1.0 ends after them; it has 8 octets of inputs; "
          "allowed: a submodule with data")),
    ],
)  # fmt: skip
def test_a_place_outside_of_the_data_is_refused(place, sizes, sentence):
    with pytest.raises(Problem) as caught:
        placed(place, *sizes)
    assert str(caught.value) == sentence
