"""The key `signals` of a device: places with types, units and scales."""

import pytest
from pydantic import TypeAdapter, ValidationError

from pnfarm.config.device import SignalSetting, read_place
from pnfarm.vocabulary.problem import Problem

SETTING = TypeAdapter(SignalSetting)


@pytest.mark.parametrize(
    ("value", "place", "kind"),
    [
        ("1.1.0.3", (1, 1, 0, 3), "bool"),
        ("3.1.0", (3, 1, 0, None), "uint8"),
        ({"at": "1.1.0.3"}, (1, 1, 0, 3), "bool"),
        ({"at": "0.32768.12", "type": "octets[8]"}, (0, 32768, 12, None), "octets[8]"),
        ({"at": "3.1.0", "type": "int16", "unit": "bar", "scale": 0.01}, (3, 1, 0, None), "int16"),
        ({"at": "3.1.0", "scale": 2}, (3, 1, 0, None), "uint8"),
        ({"at": "3.1.0", "type": "bool", "order": "little", "direction": "output"}, (3, 1, 0, None), "bool"),
    ],
)
def test_a_signal_is_a_place_or_a_mapping(value, place, kind):
    found = SETTING.validate_python(value)
    assert (found.at, found.value_type.name) == (place, kind)


def test_a_place_is_shown_as_it_was_written():
    assert [SETTING.validate_python(text).text for text in ("1.1.0.3", "3.1.0")] == ["1.1.0.3", "3.1.0"]


@pytest.mark.parametrize(
    "value", ["1.1", "1.1.0.8", "1.1.0.3.1", "1.1.x", "", "1.0.0", "40000.1.0", "1.50000.0", "1..0", 3.1, None, True]
)
def test_what_is_no_place_is_refused_with_what_one_is(value):
    with pytest.raises(Problem, match=r"; allowed: (slot\.subslot\.octet|slots 0 to 32767)"):
        read_place(value)


@pytest.mark.parametrize(
    ("value", "sentence"),
    [
        (["1.1.0"], "is a list; allowed: slot.subslot.octet or"),
        ({"type": "int16"}, "Field required"),
        ({"at": "1.1.0.3", "type": "int16"}, "`at` names bit 3, int16 has whole octets"),
        ({"at": "1.1.0.3", "scale": 2}, "`scale` is for numbers, not for bool"),
        ({"at": "1.1.0", "type": "text[4]", "scale": 2}, "`scale` is for numbers, not for text[4]"),
        ({"at": "1.1.0", "scale": 0}, "is 0; allowed: a number other than 0"),
        ({"at": "1.1.0", "scale": True}, "is true; allowed: a number other than 0"),
        ({"at": "1.1.0", "type": "word"}, "'word' is not a type"),
        ({"at": "1.1.0", "type": 16}, "is 16; allowed: a type such as bool"),
        ({"at": "1.1.0", "colour": "red"}, "Extra inputs are not permitted"),
        ({"at": "1.1.0", "unit": "x" * 21}, "at most 20 characters"),
    ],
)
def test_a_setting_that_is_wrong_is_refused(value, sentence):
    with pytest.raises(ValidationError) as caught:
        SETTING.validate_python(value)
    assert sentence in str(caught.value)


def test_the_schema_has_both_forms():
    schema = SETTING.json_schema()
    assert [next(iter(form)) for form in schema["anyOf"]]
    assert schema["anyOf"][0]["type"] == "string"
    assert schema["$defs"]["SignalPlace"]["required"] == ["at"]
