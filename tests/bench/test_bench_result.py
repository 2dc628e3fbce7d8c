"""Windows of a benchmark, the row that they make, and what a run's rows decide."""

import io
import json
from dataclasses import asdict

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.bench.report import markdown, print_table, spread, verdict
from pnfarm.bench.result import Result, Windows, exit_code, judged
from pnfarm.errors import InternalError

OK = Result("a", 1.0, "s", None, "<= 2", True)
MISSED = Result("b", 3.0, "s", None, "<= 2", False)
PLAIN = Result("c", 3.0, "s", None, "none", True)


def test_three_disturbed_windows_of_eight_do_not_move_the_figure_but_show_in_its_spread():
    row = Windows([1.0, 1.0, 1.0, 1.0, 1.0, 9.0, 8.0, 7.0]).row("a", "us")
    assert (row.value, row.spread) == (1.0, (1.0, 9.0))


@given(st.lists(st.floats(-1e9, 1e9), min_size=1, max_size=20))
def test_a_value_lies_in_its_spread(values):
    row = Windows(values).row("a", "us")
    if row.spread is None:
        assert len(values) == 1
    else:
        assert row.spread[0] <= row.value <= row.spread[1]


def test_a_ratio_is_of_the_medians():
    assert Windows([3.0, 4.0, 50.0]).over(Windows([2.0, 2.0, 90.0])) == 2.0
    assert Windows([1.0]).over(Windows([0.0])) == float("inf")


def test_what_a_figure_has_more_than_usual_is_taken_from_each_window():
    assert Windows([3.0, 5.0]).less(2.0).values == (1.0, 3.0)


def test_a_measurement_without_windows_is_a_mistake_of_the_program():
    with pytest.raises(InternalError, match="without windows"):
        Windows([])


def test_beside_load_a_row_keeps_its_value_and_judges_nothing():
    for row in judged([OK, MISSED, PLAIN], 0.4):
        assert (row.ok, row.beside_load) == (None, 0.4)
        assert verdict(row) == "beside load: 0.40"
    assert judged([OK, MISSED], None) == [OK, MISSED]


@pytest.mark.parametrize(
    ("rows", "code"),
    [([OK, PLAIN], 0), ([OK, MISSED], 1), (judged([OK], 0.4), 3), ([*judged([OK], 0.4), MISSED], 1),
     # a row without a goal had nothing to judge
     ([OK, *judged([PLAIN], 0.4)], 0), ([], 0)],
)  # fmt: skip
def test_a_missed_goal_ends_with_1_and_an_undecided_one_with_3(rows, code):
    assert exit_code(rows) == code


def test_the_json_has_the_promised_keys_with_spread_and_load():
    (row,) = judged([Windows([1.0, 2.0, 6.0]).row("a", "us", 0.5, "ratio <= 1", ok=True)], 0.25)
    assert json.loads(json.dumps(asdict(row))) == {
        "name": "a", "value": 2.0, "unit": "us", "ratio_to_floor": 0.5, "goal": "ratio <= 1", "ok": None,
        "spread": [1.0, 6.0], "beside_load": 0.25,
    }  # fmt: skip


def test_table_and_page_show_spread_verdict_and_load(monkeypatch):
    rows = [
        Windows([1.0, 2.0, 6.0]).row("frame-cost-192", "us", 1.2, "ratio <= 0.95", ok=False),
        *judged([OK], 0.31),
        PLAIN,
    ]
    assert [spread(row) for row in rows] == ["1 to 6", "", ""]
    out = io.StringIO()
    monkeypatch.setattr("sys.stdout", out)
    print_table(rows)
    for words in ("frame-cost-192", "1 to 6", "1.20", "missed", "beside load: 0.31", "give no verdict"):
        assert words in out.getvalue()
    page = markdown(rows)
    assert "| frame-cost-192 | 2 | 1 to 6 | us | 1.20 | ratio <= 0.95 | missed |\n" in page
    assert "| a | 1 |  | s |  | <= 2 | beside load: 0.31 |\n" in page
    assert "| c | 3 |  | s |  |  |  |\n" in page
