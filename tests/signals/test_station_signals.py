"""Signals of a station with plain data: types, all or nothing, one copy, revisions."""

import pytest
from plain_station import controller_sends, island, sent_to_controller

from pnfarm.signals.refusal import SignalError


def test_names_are_in_the_order_of_the_file():
    assert island().names == ("part_present", "pressure", "code", "valve_1", "speed")


def test_new_signals_are_zero_and_inputs_good():
    signals = island()
    assert signals.get_all() == {"part_present": False, "pressure": 0, "code": bytes(4), "valve_1": False, "speed": 0}
    assert [signals.good(name) for name in signals.names] == [True, True, True, False, False]


def test_inputs_are_written_in_the_order_of_octets_of_the_bus():
    signals = island()
    signals.set({"part_present": True, "pressure": 12.5, "code": "0x01ff"})
    assert signals.get_all() == {
        "part_present": True, "pressure": 12.5, "code": b"\1\xff\0\0", "valve_1": False, "speed": 0,
    }  # fmt: skip
    assert sent_to_controller(signals) == b"\x08\x04\xe2\x01\xff\0\0"


@pytest.mark.parametrize(
    ("text", "value"), [("on", True), ("1", True), ("true", True), ("off", False), ("0", False), ("false", False)]
)
def test_a_text_is_parsed_by_the_type(text, value):
    signals = island()
    signals.set({"part_present": text})
    assert signals.get("part_present") is value


def test_nothing_is_written_when_one_value_is_refused_and_every_reason_is_given():
    signals = island()
    with pytest.raises(SignalError) as caught:
        signals.set({"part_present": True, "pressure": 1e6, "valve_1": True, "part_presnt": True, "code": "zz"})
    assert signals.get("part_present") is False
    assert [name for name, _, _ in caught.value.issues] == ["pressure", "valve_1", "part_presnt", "code"]
    sentence = str(caught.value)
    assert "pressure: 1000000.0 is outside of int16 scaled by 0.01; allowed: -327.68 to 327.67 bar" in sentence
    assert "valve_1: is an output: the controller alone writes it" in sentence
    assert "part_presnt: is not a signal, did you mean part_present?" in sentence
    assert "code: 'zz' is not hexadecimal" in sentence


def test_a_name_without_a_near_one_gets_the_list():
    with pytest.raises(SignalError, match="x: is not a signal; allowed: part_present, pressure, code, valve_1, speed"):
        island().get("x")


def test_outputs_are_what_the_controller_sent():
    signals = island()
    controller_sends(signals, b"\x02\x00\x07")
    assert (signals.get("valve_1"), signals.get("speed")) == (True, 7)
    assert signals.good("valve_1")
    controller_sends(signals, b"\x02\x00\x07", good=(False, True))
    assert [signals.good(name) for name in ("valve_1", "speed")] == [False, True]


def test_the_revision_counts_changes_of_both_directions_but_no_repetition():
    signals = island()
    first = signals.revision
    assert signals.revision == first
    signals.set({"part_present": True})
    second = signals.revision
    signals.set({"part_present": True})
    assert signals.revision == second == first + 1
    controller_sends(signals, b"\x02\x00\x00")
    third = signals.revision
    controller_sends(signals, b"\x02\x00\x00")
    assert signals.revision == third == second + 1


def test_several_values_are_one_change_of_the_row():
    signals = island()
    before = signals._inputs.changes
    signals.set({"part_present": True, "pressure": 1.0})
    assert signals._inputs.changes == before + 1


def test_a_station_without_inputs_refuses_every_write():
    signals = island(inputs=False)
    with pytest.raises(SignalError, match="is an output"):
        signals.set({"valve_1": True})


def test_the_strongest_of_fault_force_and_value_has_an_input_and_the_others_wait():
    signals = island(more={"first": {"at": "3.1.0", "type": "uint8"}})
    seen = {signals.revision}
    assert [signals.owner(name) for name in ("part_present", "pressure", "speed")] == [
        "default",
        "default",
        "controller",
    ]
    assert signals.set({"pressure": 1}) == {}
    # of the octets of another signal
    assert (signals.owner("first"), signals.owner("code")) == ("value", "default")
    assert signals.force({"pressure": 2}) == {}
    assert signals.set({"pressure": 3, "first": 0, "code": ""}) == {"pressure": "force", "first": "force"}

    def shape(value):
        return value + 10

    signals.put_shape(signals.signal("pressure"), shape)
    assert (signals.get("pressure"), signals.owner("pressure")) == (12, "fault")
    assert signals.force({"pressure": 4, "part_present": True}) == {"pressure": "fault"}
    assert signals.set({"pressure": 5, "part_present": False}) == {"pressure": "fault", "part_present": "force"}
    assert (signals.get("pressure"), signals.forced) == (14, {"pressure": 4, "part_present": True})
    signals.force({"pressure": None})
    assert (signals.get("pressure"), signals.owner("pressure")) == (15, "fault")
    signals.take_shape(signals.signal("pressure"), shape)
    assert (signals.get("pressure"), signals.owner("pressure")) == (5, "value")
    signals.force({"*": None})
    assert (signals.get("part_present"), signals.owner("part_present")) == (False, "value")
    seen.add(signals.revision)
    signals.force({"part_present": False})
    assert signals.revision not in seen, "another owner is news"


def test_a_fault_that_changes_nothing_leaves_each_octet_as_it_is():
    more = {"label": {"at": "3.1.2", "type": "text[4]"}}
    signals = island(more=more)
    signals.set({"code": "61 ff fe ff"})
    label = signals.signal("label")
    signals.put_shape(label, lambda value: value)
    assert (signals.get("code"), signals.get("label")) == (b"a\xff\xfe\xff", "a???")
    signals.put_shape(label, lambda _: "b")
    assert signals.get("code") == b"b\0\0\0"
