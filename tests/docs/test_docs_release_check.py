"""Which pages of figures may go into a release."""

import importlib.util
from datetime import UTC, date, datetime
from pathlib import Path

import pytest

from pnfarm.bench.report import markdown
from pnfarm.bench.result import Result, judged

ROOT = Path(__file__).resolve().parents[2]
ROWS = [
    Result("frame-cost-192", 1.3, "us", 0.9, "ratio <= 0.95", True),
    Result("scrape-256", 9.0, "ms", None, "none", True),
]
DAY = datetime(2027, 1, 31, 12, tzinfo=UTC)


@pytest.fixture(scope="module")
def complaints():
    spec = importlib.util.spec_from_file_location("docs_release_check", ROOT / "docs" / "release_check.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.complaints


def test_a_fresh_page_of_a_quiet_machine_passes_for_thirty_days(complaints):
    page = markdown(ROWS, DAY)
    assert complaints(page, DAY.date()) == []
    assert complaints(page, date(2027, 3, 2)) == []
    assert complaints(page, date(2027, 3, 3)) == ["the figures are of 2027-01-31, 31 days old; at most 30 are allowed"]


def test_figures_of_tomorrow_are_wrong(complaints):
    assert complaints(markdown(ROWS, DAY), date(2027, 1, 30)) != []


def test_a_missed_goal_is_told_and_passes_because_the_page_says_it(complaints):
    missed = [Result("frame-cost-192", 1.7, "us", 1.3, "ratio <= 0.95", False)]
    assert "| missed |" in markdown(missed, DAY)
    assert complaints(markdown(missed, DAY), DAY.date()) == []


def test_every_row_beside_load_is_named(complaints):
    page = markdown([*judged(ROWS, 0.31), Result("start-64", 2.0, "s", None, "<= 5", True)], DAY)
    assert complaints(page, DAY.date()) == [
        "frame-cost-192 was measured beside load: 0.31", "scrape-256 was measured beside load: 0.31",
    ]  # fmt: skip


def test_a_page_without_date_or_figures_does_not_pass(complaints):
    assert complaints("# Figures\n", DAY.date()) == [
        "the page does not say when it was measured", "the page has no figures",
    ]  # fmt: skip
    assert complaints(markdown([], DAY), DAY.date()) == ["the page has no figures"]
