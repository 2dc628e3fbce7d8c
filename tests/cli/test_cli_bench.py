"""`pnfarm bench`: the names that it prints are names that it takes."""

import json
import re
from pathlib import Path

import pytest

from pnfarm.bench.catalogue import BENCHMARKS, Benchmark, chosen, measured
from pnfarm.bench.line import farm_file
from pnfarm.bench.result import Result
from pnfarm.errors import ConfigError, InternalError
from pnfarm.farm.file.reading import parse_farm

PAGE = Path(__file__).resolve().parents[2] / "docs" / "bench.md"


def test_every_name_of_a_printed_figure_is_taken():
    printed = re.findall(r"^\| ([a-z0-9-]+) \|", PAGE.read_text("utf-8"), re.MULTILINE)
    names = [name for name in printed if name != "benchmark"]
    assert len(names) > 10
    for name in names:
        ((benchmark, wanted),) = chosen([name]).items()
        # the figure that has its benchmark's name comes with all others of it
        assert wanted == (set(BENCHMARKS[name].figures) if benchmark == name else {name})
        assert name in wanted


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


@pytest.mark.parametrize("in_memory", [True, False])
def test_the_farm_files_of_benchmarks_on_a_line_and_in_memory_are_read(in_memory):
    config = parse_farm(farm_file(4, "1ms", 64, 0, in_memory=in_memory))
    assert (config.link.kind, config.drives[0].count) == ("memory" if in_memory else "macvlan", 4)


def test_an_unknown_name_is_told_with_the_nearest(pnfarm):
    with pytest.raises(ConfigError, match="unknown benchmark 'frame-cost-19', did you mean frame-cost-192"):
        chosen(["frame-cost-19"])
    assert pnfarm("bench", "frame").code == 2


def test_only_the_figures_that_were_asked_for_are_shown(monkeypatch):
    def run(seconds, load):
        load.add(1.0, 0.0)
        return [Result(name, seconds, "s", None, "none", True) for name in ("some-a", "some-b")]

    monkeypatch.setitem(BENCHMARKS, "some", Benchmark(run, 3.0, ("some-a", "some-b")))
    assert [r.name for r in measured("some", frozenset(("some-b",)), None)] == ["some-b"]
    assert measured("some", frozenset(("some-a",)), 1.0)[0].value == 1.0
    monkeypatch.setitem(BENCHMARKS, "some", Benchmark(run, 3.0, ("some-a",)))
    with pytest.raises(InternalError, match="some-b"):
        measured("some", frozenset(("some-a",)), None)


def test_others_work_in_the_measurement_shows_in_every_figure(monkeypatch):
    def run(seconds, load):
        load.add(seconds, 0.5 * seconds)
        return [Result("some-a", 1.0, "s", None, "<= 2", True)]

    monkeypatch.setitem(BENCHMARKS, "some", Benchmark(run, 3.0, ("some-a",)))
    (row,) = measured("some", frozenset(("some-a",)), None)
    assert (row.ok, row.beside_load) == (None, 0.5)


def test_a_short_run_has_spread_ratio_and_a_verdict_that_its_exit_code_tells(process, tmp_path):
    figures = tmp_path / "figures.json"
    done = process("bench", "profibus-32-cpu", "profibus-32-floor-cpu", "--seconds", "0.8", "--json", figures)
    assert done.code in (0, 1, 3), done.err
    farm, floor = json.loads(figures.read_text("utf-8"))
    assert floor["ratio_to_floor"] == 1.0
    assert farm["ratio_to_floor"] == pytest.approx(farm["value"] / floor["value"])
    for row in (farm, floor):
        low, high = row["spread"]
        assert 0 < low <= row["value"] <= high
        assert row["name"] in done.out
        assert (row["ok"] is None) is (row["beside_load"] is not None)
    assert done.code == {True: 0, False: 1, None: 3}[farm["ok"]]
