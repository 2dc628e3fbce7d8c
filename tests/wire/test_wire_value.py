"""Values that are made for each frame behave as frozen dataclasses do."""

from __future__ import annotations

from dataclasses import replace

from pnfarm.wire.value import value_class


@value_class
class Place:
    slot: int
    subslot: int = 1


def test_values_with_the_same_fields_are_one_key():
    assert {Place(2): "data"}[Place(2, 1)] == "data"
    assert Place(2) != Place(2, 2)


def test_a_changed_value_leaves_the_old_one():
    old = Place(2)
    assert replace(old, subslot=3) == Place(2, 3)
    assert old == Place(2, 1)


def test_a_value_has_no_other_attributes():
    assert not hasattr(Place(2), "__dict__")
