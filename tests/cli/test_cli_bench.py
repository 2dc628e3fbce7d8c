"""`pnfarm bench`: the names that it prints are names that it takes."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from pnfarm.cli.bench import BENCHMARKS, Benchmark, chosen, measured
from pnfarm.cli.bench_line import Result
from pnfarm.errors import ConfigError, InternalError

PAGE = Path(__file__).resolve().parents[2] / "docs" / "bench.md"


def test_every_name_of_a_printed_figure_is_taken():
    printed = re.findall(r"^\| ([a-z0-9-]+) \|", PAGE.read_text("utf-8"), re.MULTILINE)
    names = [name for name in printed if name != "benchmark"]
    assert len(names) > 10
    for name in names:
        (wanted,) = chosen([name]).values()
        assert wanted == {name}


def test_a_benchmarks_name_means_all_of_its_figures_and_no_name_means_everything():
    assert chosen(["frame-cost"]) == {"frame-cost": frozenset(BENCHMARKS["frame-cost"].figures)}
    assert list(chosen([])) == list(BENCHMARKS)
    assert chosen(["scrape-256", "frame-cost-192", "frame-cost-192-floor"]) == {
        "frame-cost": {"frame-cost-192", "frame-cost-192-floor"},
        "scrape": {"scrape-256"},
    }


def test_no_two_figures_have_one_name():
    names = [name for benchmark in BENCHMARKS.values() for name in benchmark.figures]
    assert len(set(names)) == len(names)


def test_an_unknown_name_is_told_with_the_nearest(pnfarm):
    with pytest.raises(ConfigError, match="unknown benchmark 'frame-cost-19', did you mean frame-cost-192"):
        chosen(["frame-cost-19"])
    assert pnfarm("bench", "frame").code == 2


def test_only_the_figures_that_were_asked_for_are_shown(monkeypatch):
    def run(seconds):
        return [Result(name, seconds, "s", None, "none", True) for name in ("some-a", "some-b")]

    monkeypatch.setitem(BENCHMARKS, "some", Benchmark(run, 3.0, ("some-a", "some-b")))
    assert [r.name for r in measured("some", frozenset(("some-b",)), None)] == ["some-b"]
    assert measured("some", frozenset(("some-a",)), 1.0)[0].value == 1.0
    monkeypatch.setitem(BENCHMARKS, "some", Benchmark(run, 3.0, ("some-a",)))
    with pytest.raises(InternalError, match="some-b"):
        measured("some", frozenset(("some-a",)), None)
