"""Conditions over a drive's signals: grammar, names by model, units, and any text at all."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pnfarm.drives.catalogue import model, models
from pnfarm.station.conditions import bind
from pnfarm.vocabulary.conditions import ConditionError, evaluate, parse_condition, text_of

if TYPE_CHECKING:
    from collections.abc import Callable

AKD = model("akd-profinet")

KNOWN = {
    "zsw1.fault_present": True, "stw1.enable_operation": False, "state": "S4", "velocity": 1500.0, "fault": 702,
    "connected": True, "powered": True, "cycle": 0.016, "position": 0.3,
}  # fmt: skip


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("zsw1.fault_present", True),
        ("not zsw1.fault_present", False),
        ("stw1.enable_operation == 0", True),
        ("stw1.enable_operation == false and state == S4", True),
        ("S4 == state", True),
        ("state != 'S4'", False),
        ("velocity > 1000", True),
        ("velocity >= 1500 rpm and velocity < 1501", True),
        ("velocity > -5", True),
        ("fault == 702", True),
        ("fault == F702 or fault == 0", True),
        ("fault == none", False),
        ("connected and (velocity < 0 or not (state == S1))", True),
        ("connected or velocity > 0 and state == S1", True),
        ("cycle == 16ms", True),
        ("position > 90 deg", True),
    ],
)
def test_a_condition_is_read_as_a_tester_means_it(text: str, expected: bool) -> None:
    assert bind(text, AKD).holds(None, KNOWN) is expected


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("zsw1.fault_presnt", "did you mean zsw1.fault_present"),
        ("velocty > 3", "column 1: akd-profinet has no signal 'velocty', did you mean velocity"),
        ("connected and velocty > 3", "column 15: "),
        ("state == S9", "state is never 'S9'"),
        ("state > S1", "has no order"),
        ("velocity", "no yes or no; allowed: such as `velocity > 0`"),
        ("velocity > 'fast'", "velocity is a number"),
        ("velocity > 5ms", "velocity is not measured in ms; allowed: a number in rpm"),
        ('param("DRV.OPMODE") == 1rpm', "plain number"),
        ("zsw1.fault_present == 2", "never 2; allowed: 0, 1, true or false"),
        ("fault == 70200", "has no fault '70200'"),
        ('param("DRV.OPMOD") == 1', "did you mean DRV.OPMODE"),
        ("connected = 1", "= is not used here; allowed: `==`"),
        ("connected && powered", "allowed: `and`"),
        ("1 < velocity < 3", "comparisons are not chained"),
        ("1 == 1", "compares two values"),
        ("true", "is a value, not a condition"),
        ("(connected", "the parenthesis is not closed"),
        ("connected)", "is too much here"),
        ("", "is empty"),
        ("connected and", "ends where a name or a value is needed"),
        ("__import__('os')", "cannot be called"),
        ("(" * 60 + "connected" + ")" * 60, "nested too deeply"),
        ("not " * 200 + "connected", "nested too deeply"),
        (" or ".join(["faulted"] * 80), "too many names and values"),
        ("x" * 2000, "at most 1000"),
        ("velocity > 0x", "not measured in x"),
        ("zsw1.16", "has no signal"),
    ],
)
def test_what_is_wrong_is_one_sentence_with_its_column(text: str, sentence: str) -> None:
    with pytest.raises(ConditionError) as found:
        bind(text, AKD)
    assert sentence in str(found.value)
    assert "\n" not in str(found.value)


@pytest.mark.parametrize("name", sorted(models()))
def test_every_model_names_its_bits_and_its_faults(name: str) -> None:
    drive = model(name)
    assert bind("zsw1.operation_enabled and not zsw1.fault_present", drive)
    assert bind("zsw1.3 or stw1.bit_7", drive)
    for fault in drive.faults.values():
        assert bind(f'fault == "{fault.label}"', drive)
    assert bind("p930 == 1", drive)


def test_a_fault_with_a_location_is_written_as_in_its_manual() -> None:
    msd = model("moog-msd")
    bound = bind('fault == "32-1"', msd)
    assert bound.holds(None, {"fault": msd.fault("32-1").number})
    assert not bound.holds(None, {"fault": 32})


def refusal(call: Callable[[], object]) -> ConditionError | None:
    try:
        call()
    except ConditionError as error:
        return error
    return None


@given(st.text(max_size=80))
@example("0" * 40)
@example("1e999 == velocity")
@example("\u0661 == velocity")
@example("a.b.c.d == .5")
@example("param(param)")
@settings(max_examples=400, deadline=None)
def test_any_text_gives_a_tree_or_one_sentence(text: str) -> None:
    error = refusal(lambda: parse_condition(text))
    if error is not None:
        assert error.what
        assert error.allowed
        assert 1 <= error.column <= len(text) + 1


_PIECES = [
    "connected", "velocity", "zsw1.fault_present", "state", "S4", "fault", "702", "1.5", "rpm", "ms", "(", ")", "and",
    "or", "not", "==", "!=", "<", ">=", "-", "param", '("DRV.OPMODE")', "'x'", "true", "%", ".", "0x1f",
]  # fmt: skip


@given(st.lists(st.sampled_from(_PIECES), max_size=24).map(" ".join))
@settings(max_examples=600, deadline=None)
def test_words_of_the_language_in_any_order_bind_or_give_one_sentence(text: str) -> None:
    error = refusal(lambda: bind(text, AKD))
    if error is not None:
        assert "\n" not in str(error)
        return
    bound = bind(text, AKD)
    assert bound.holds(None, dict.fromkeys(bound.signals, 0.0)) in {True, False}


def _pairs(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    both = st.tuples(inner, inner)
    return st.one_of(
        inner.map("not ({})".format),
        both.map(lambda pair: f"({pair[0]}) and ({pair[1]})"),
        both.map(lambda pair: f"{pair[0]} or {pair[1]}"),
    )


@given(st.recursive(st.sampled_from("abc"), _pairs, max_leaves=8), st.tuples(*[st.booleans()] * 3))
@settings(deadline=None)
def test_it_computes_what_python_computes_for_the_same_words(text: str, values: tuple[bool, ...]) -> None:
    known = dict(zip("abc", values, strict=True))
    error = refusal(lambda: parse_condition(text))
    if error is not None:
        assert "nested too deeply" in error.what
        return
    tree = parse_condition(text)
    expected = bool(eval(text, {}, known))
    assert evaluate(tree, lambda name: known[name.name]) is expected
    assert evaluate(parse_condition(text_of(tree)), lambda name: known[name.name]) is expected
