"""Diagnoses of a file: by number, by name in any language, with texts and help."""

import pytest
from gsdml_examples import ISLAND, SCANNER, example
from gsdml_kit import MINIATURE
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.errors import ConfigError
from pnfarm.protocols.profinet.gsdml.diagnosis import DiagnosisCatalogue, unit_octets
from pnfarm.protocols.profinet.gsdml.reader import parse_gsdml

CATALOGUE = DiagnosisCatalogue(example(ISLAND))


@pytest.mark.parametrize(
    ("wanted", "kind", "error_type", "ext", "german"),
    [
        (257, "channel", 257, 0, "Ventilspule offen"),
        ("0x0101", "channel", 257, 0, "Ventilspule offen"),
        ("256: 2", "channel", 256, 2, "Sensorversorgung überlastet: Gruppe B"),
        ("valve coil open", "channel", 257, 0, "Ventilspule offen"),
        ("Ventilspule  OFFEN", "channel", 257, 0, "Ventilspule offen"),
        ("valve c", "channel", 257, 0, "Ventilspule offen"),
        ("group b", "channel", 256, 2, "Sensorversorgung überlastet: Gruppe B"),
        ("sensor supply overloaded", "channel", 256, 0, "Sensorversorgung überlastet"),
        ("sensor supply", "channel", 256, 0, "Sensorversorgung überlastet"),
        ("Sensor supply overloaded: Gruppe A", "channel", 256, 1, "Sensorversorgung überlastet: Gruppe A"),
        # the standard's, with an extension of the file's
        ("wire break", "channel", 6, 0, "wire break"),
        ("wire break: signal line", "channel", 6, 1, "wire break: Signalleitung"),
        ("rückleitung", "channel", 6, 2, "wire break: Rückleitung"),
        ("short circuit", "channel", 1, 0, "short circuit"),
        ("link down", "channel", 0x8000, 0x8000, "data transmission impossible: link down"),
        # a number that nothing names
        (0x3FFF, "channel", 0x3FFF, 0, ""),
        ("0x3fff:7", "channel", 0x3FFF, 7, ""),
        ("gateway line error", "unit", 1, 0, "Leitungsfehler des Gateways"),
        ("leitungsfehler", "unit", 1, 0, "Leitungsfehler des Gateways"),
    ],
)
def test_a_diagnosis_is_found_by_number_or_by_name_in_any_language(wanted, kind, error_type, ext, german):
    found = CATALOGUE.find(wanted)
    assert (found.kind, found.error_type, found.ext_error_type) == (kind, error_type, ext)
    assert CATALOGUE.texts(found, "de")[0] == german


def test_texts_and_help_are_in_the_languages_of_the_file():
    worn = CATALOGUE.find("valve worn")
    assert worn.severities == ("MR",)
    assert CATALOGUE.texts(worn, "de") == (
        "Ventil verschlissen", "Das Ventil hat öfter geschaltet, als sein Hersteller erlaubt.")  # fmt: skip
    assert CATALOGUE.texts(worn, "fr")[0] == CATALOGUE.texts(worn, "en")[0] == "Valve worn"
    assert CATALOGUE.find("group a").help == "Inputs 0 to 7."
    assert DiagnosisCatalogue(example(SCANNER)).find("window").help == "Clean the window with a soft cloth."


@pytest.mark.parametrize(
    ("wanted", "sentence"),
    [
        ("valve", r"several diagnoses are called 'valve': Valve coil open \(0x0101\), Valve worn \(0x0102\)"),
        ("valve cool open", r"no diagnosis 'valve cool open', it has Sensor supply overloaded .*did you mean valve c"),
        ("", "the diagnosis has no name"),
        (0, "0 is no ChannelErrorType, these are 1 to 65535"),
        ("0x10000", "65536 is no ChannelErrorType"),
        (-5, "-5 is no ChannelErrorType"),
    ],
)
def test_a_diagnosis_that_is_not_there_or_not_clear_is_refused_with_what_there_is(wanted, sentence):
    with pytest.raises(ConfigError, match=sentence):
        CATALOGUE.find(wanted)


def test_a_profiles_diagnosis_is_found_in_its_api():
    catalogue = DiagnosisCatalogue(parse_gsdml(MINIATURE.encode()))
    encoder = catalogue.find("encoder")
    assert (encoder.error_type, encoder.api) == (0x900A, 0x3A00)
    assert catalogue.number(0x900A, 0x9000, api=0x3A00).name == "Line broken"
    assert catalogue.number(7, kind="unit").name == "State"
    with pytest.raises(ConfigError, match=r"several .*: Too hot: Dust \(0x0100: 1\), wire break: Dust \(0x0006: 1\)"):
        catalogue.find("dust")


def test_a_makers_own_form_has_its_fields_by_name():
    unit = CATALOGUE.find("gateway").unit
    assert unit_octets(unit) == bytes(4)
    assert unit_octets(unit, {"parity error": 1, "Buffer": 5, "Lost octets": 300}).hex() == "5100012c"
    with pytest.raises(ConfigError, match=r"has no field 'Buffers', it has Parity error, .*, did you mean Buffer"):
        unit_octets(unit, {"Buffers": 1})
    with pytest.raises(ConfigError, match="Gateway line error, Buffer: '9' is given, allowed is a number from 0 to 7"):
        unit_octets(unit, {"Buffer": 9})


@given(st.text(max_size=20) | st.integers(-2, 70000))
def test_any_word_finds_a_diagnosis_or_is_refused(wanted):
    try:
        found = CATALOGUE.find(wanted)
    except ConfigError:
        return
    assert 0 < found.error_type <= 0xFFFF
