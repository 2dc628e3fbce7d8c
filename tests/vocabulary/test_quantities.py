"""Measured values for people: few digits, never so few that a comparison looks other than it is."""

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from pnfarm.vocabulary.durations import format_measured
from pnfarm.vocabulary.quantities import show_quantity

FINITE = st.floats(allow_nan=False, allow_infinity=False, width=64)
#: Near each other more often than any two numbers are.
PAIRS = st.tuples(FINITE, FINITE) | st.tuples(st.floats(-1e4, 1e4), st.floats(-1e-6, 1e-6)).map(
    lambda pair: (pair[0], pair[0] * (1 + pair[1]))
)


@pytest.mark.parametrize(
    ("value", "unit", "beside", "text"),
    [
        (22.817154979051935, "rpm", (), "22.82 rpm"),
        (22.80001, "rpm", (22.8,), "22.80001 rpm"),
        (22.8, "rpm", (22.8,), "22.8 rpm"),
        (1499.9999, "rpm", (1500.0,), "1499.9999 rpm"),
        (1234567.0, "", (), "1234567"),
        (0.00001234, "A", (), "1.234e-05 A"),
        (-0.5, "1", (), "-0.5"),
        (1151, "", (), "1151"),
        ("S4", "", (), "S4"),
        (True, "", (), "True"),
        (math.inf, "A", (1.0,), "inf A"),
    ],
)
def test_a_value_has_its_unit_and_as_many_digits_as_it_takes(value, unit, beside, text):
    assert show_quantity(value, unit, beside) == text


@given(PAIRS)
def test_a_shown_value_is_above_below_or_equal_to_its_bound_as_it_is(pair):
    value, bound = pair
    shown = float(show_quantity(value, beside=(bound,)))
    assert (shown > bound, shown < bound) == (value > bound, value < bound)


@given(PAIRS)
def test_two_values_that_differ_look_different_beside_each_other(pair):
    value, other = pair
    assume(value != other)
    assert show_quantity(value, beside=(other,)) != show_quantity(other, beside=(value,))


@given(st.floats(0, 1e6), st.floats(-1e-7, 1e-7))
def test_a_time_that_differs_from_its_bound_looks_different(seconds, part):
    other = seconds * (1 + part)
    # beyond what the clock of any run can tell
    assume(abs(seconds - other) > 1e-12 * max(1.0, seconds))
    assert format_measured(seconds, (other,)) != format_measured(other, (seconds,))


def test_a_time_beside_another_has_more_digits_only_where_it_needs_them():
    assert format_measured(0.1004, (0.1,)) == "100.4 ms"
    assert format_measured(0.1, (0.1,)) == "100 ms"
    assert format_measured(2.5, (3.0,)) == "2.5 s"
