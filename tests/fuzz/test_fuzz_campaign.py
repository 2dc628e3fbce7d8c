"""Guided fuzzing as a campaign: its state, the order of its targets, what it keeps; none of this needs atheris."""

import itertools
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def campaign(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT))
    from tests.fuzz import campaign

    return campaign


def turn(campaign, inputs, seconds, edges=5, findings=()):
    return campaign.Turn(inputs, seconds, edges, 2 * edges, 3, int(bool(findings)), list(findings))


def test_a_campaign_goes_on_where_it_was_stopped(campaign, tmp_path):
    file = tmp_path / "state.json"
    first = campaign.State.read(file)
    first.add("dcp", turn(campaign, 100, 2.0, edges=7))
    first.add("dcp", turn(campaign, 50, 1.0, findings=["0102"]))
    second = campaign.State.read(file)
    assert second.totals == first.totals
    total = second.total("dcp")
    assert (total.inputs, total.rate, total.turns, total.edges, total.features) == (150, 50.0, 2, 7, 14)
    assert total.findings == ["0102"]


def test_the_next_target_has_the_fewest_inputs_or_the_least_time(campaign):
    state = campaign.State(None)
    state.add("slow", turn(campaign, 10, 60.0))
    state.add("fast", turn(campaign, 100_000, 5.0))
    assert list(itertools.islice(state.order(["slow", "fast"], endless=True), 4)) == ["slow", "fast"] * 2
    assert next(state.order(["slow", "fast", "new"], endless=True)) == "new"
    assert list(state.order(["slow", "fast"], endless=False)) == ["slow", "fast"]


def test_the_table_sums_up_parsers_by_module_and_shows_machines_one_by_one(campaign):
    state = campaign.State(None)
    for name in ("pdu.parse_dcp", "pdu.parse_rpc", "machine station"):
        state.add(name, turn(campaign, 1000, 2.0))
    rows = campaign.table(state).splitlines()
    assert "| `machine station` | 1 | 1,000 | 500 | 5 | 10 | 3 |" in rows
    assert "| `pdu` | 2 | 2,000 | 500 | 10 | 20 | 6 |" in rows
    assert rows[-1] == "| all | 3 | 3,000 | 500 | 15 | 30 | 9 |"


def test_the_fewest_inputs_that_reach_most_are_kept(campaign, monkeypatch, tmp_path):
    from tests.fuzz import guided

    features = {b"aaaa": {1, 2, 3}, b"bb": {3, 4}, b"c": {4}, b"d" * guided.LONGEST + b"d": {9}, b"e": {0}}
    assert guided._smallest({octets: frozenset(found) for octets, found in features.items()}, [0]) == [b"bb", b"aaaa"]
    many = {bytes([i]) * 100: frozenset({i}) for i in range(1, 100)}
    assert sum(map(len, guided._smallest(many, ()))) <= guided.ALL_KEPT
    monkeypatch.setattr(guided, "KEPT", tmp_path)
    guided._keep("toy", [b"bb", b"a"])
    assert guided.kept_inputs("toy") == [b"a", b"bb"]
    guided._keep("toy", [])
    assert guided.kept_inputs("toy") == []


def test_a_sequence_is_its_messages_behind_their_lengths(campaign, monkeypatch):
    for folder in ("support", "faults", "protocols/enip"):
        monkeypatch.syspath_prepend(str(ROOT / "tests" / folder))
    from tests.fuzz import sequences

    several = [b"one", b"two!", b"x"]
    assert list(sequences.messages(sequences.joined(several))) == several
    assert list(sequences.messages(b"\0\0\0\2ab\0\7cut")) == [b"ab", b"cut"]
    assert list(sequences.messages(b"\0\1a" * 50)) == [b"a"] * sequences.MOST
