"""How messages quote what a user wrote."""

import pytest

from pnfarm.vocabulary.quoting import shown


@pytest.mark.parametrize(
    ("value", "text"),
    [([], "an empty list"), ([1], "a list"), ({}, "an empty mapping"), ({"a": 1}, "a mapping"), (None, "nothing")],
)
def test_what_is_empty_is_told_so_where_a_filled_one_is_allowed(value, text):
    assert shown(value) == text
