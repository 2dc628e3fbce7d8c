"""Names of signals after a description file's texts."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.signals.naming import Datum, identifier, signal_names


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("Pressure", "pressure"),
        ("Druck (Öl), 2", "druck_oel_2"),
        ("Größe µm", "groesse_um"),
        ("Température", "temperature"),
        ("  Valve 1 - coil 14 ", "valve_1_coil_14"),
        ("状态", "data"),
        ("", "data"),
        ("x" * 60, "x" * 40),
    ],
)
def test_a_text_is_an_identifier(text, name):
    assert identifier(text) == name


def test_a_name_depends_on_its_own_slot_alone():
    first = Datum("Pressure", "input", 3, 1, 0)
    assert signal_names([first]) == ["slot3_pressure"]
    assert signal_names([first, Datum("Pressure", "input", 4, 1, 0)]) == ["slot3_pressure", "slot4_pressure"]


@pytest.mark.parametrize(
    ("data", "names"),
    [
        (
            [Datum("Count", "input", 8, 1, 0), Datum("Count", "input", 8, 2, 0)],
            ["slot8_1_count", "slot8_2_count"],
        ),
        (
            [Datum("Data", "input", 1, 1, 0), Datum("Data", "output", 1, 1, 0)],
            ["slot1_data_in", "slot1_data_out"],
        ),
        (
            [Datum("Data", way, 1, subslot, 0) for subslot in (1, 2) for way in ("input", "output")],
            ["slot1_1_data_in", "slot1_1_data_out", "slot1_2_data_in", "slot1_2_data_out"],
        ),
        (
            [Datum("Bit", "input", 1, 1, 0, bit) for bit in (0, 1)] + [Datum("Bit", "input", 1, 1, 4)],
            ["slot1_1_bit_in_0_0", "slot1_1_bit_in_0_1", "slot1_1_bit_in_4"],
        ),
        (
            # a text that looks like another one's name with its direction
            [Datum("a", "input", 1, 1, 0), Datum("a", "output", 1, 1, 0), Datum("a in", "input", 1, 1, 1)],
            ["slot1_1_a_in_0", "slot1_a_out", "slot1_1_a_in_in_1"],
        ),
    ],
)
def test_texts_that_are_alike_get_as_much_of_their_place_as_tells_them_apart(data, names):
    assert signal_names(data) == names


DATA = st.builds(
    Datum,
    st.sampled_from(["a", "a in", "1 a", "a in 0", "A", "ä", "b", "", "a out 1 2"]),
    st.sampled_from(["input", "output"]),
    st.integers(0, 2),
    st.integers(1, 2),
    st.integers(0, 3),
    st.none() | st.integers(0, 7),
)


@given(st.lists(DATA, unique_by=lambda d: (d.direction, d.slot, d.subslot, d.octet, d.bit), max_size=30))
def test_names_are_identifiers_and_all_different_whatever_the_order(data):
    names = signal_names(data)
    assert len(set(names)) == len(names)
    assert all(re.fullmatch("[a-z][a-z0-9_]*", name) for name in names)
    assert signal_names(data[::-1]) == names[::-1]
