"""The scenario file: every error with its line, repetitions, variables, names checked against the farm's models."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pnfarm.buses.registry import fault_kinds
from pnfarm.drives.catalogue import model
from pnfarm.scenario.definition.binding import bind_scenario
from pnfarm.scenario.definition.file import parse_scenario
from pnfarm.scenario.definition.schema import scenario_schema
from pnfarm.vocabulary.issues import FarmFileError

DRIVES = {"axis-01": model("akd-profinet"), "axis-02": model("moog-msd")}


def steps(text: str) -> str:
    return f"scenario: test\nsteps:\n  - {text}\n"


def errors(text: str, *, bind: bool = True) -> list[str]:
    try:
        scenario = parse_scenario(text)
        if bind:
            bind_scenario(scenario, DRIVES, fault_kinds())
    except FarmFileError as error:
        return [str(issue) for issue in error.issues]
    return []


@pytest.mark.parametrize(
    ("step", "sentence"),
    [
        ("weit: 2s", "steps[0].weit: is not a step, did you mean wait?"),
        ("wait: 2", "is 2, which has no unit; allowed: a number with a unit"),
        ("wait: {until: all-connectd}", "connectd"),
        ("wait: {for: 1s, within: 2s}", "belongs to until"),
        ("wait: {}", "has none of these; allowed: for or until"),
        ("fault: {kind: f70, on: all}", "'f70' is not a kind of fault, did you mean f702?"),
        ("fault: {kind: f702, on: axis-09}", "no drive matches 'axis-09', did you mean axis-0"),
        ("fault: {kind: drive-fault, on: axis-02, params: {fault: 702}}", "has no fault '702'"),
        ("fault: f702", "steps[0].fault.spec: is 'f702'; allowed: a mapping"),
        ("clear: trip", "no fault above is called 'trip'"),
        ("expect: {drive: axis-01, that: zsw1.fault_presnt}", "did you mean zsw1.fault_present?"),
        ("expect: {drive: axis-01, that: 'state = S4'}", "= is not used here; allowed: `==`"),
        ("expect: {drive: all, that: 'fault == 702'}", "moog-msd has no fault '702'"),
        ("expect: {that: connected}", "steps[0].expect.drive: is missing"),
        ("expect: {drive: all}", "has none of these; allowed: that or metric"),
        ("expect: {metric: pnfarm_x_total}", "has 0 of these; allowed: increases, value, p50"),
        ("expect: {metric: up, value: 1}", "'up' is not a metric"),
        ("expect: {metric: pnfarm_x_total, increases: many}", "allowed: a number, or a comparison"),
        ("expect: {metric: pnfarm_x_total, increases: 0}", "expect.for: is missing; allowed: the time over which"),
        ("expect: {metric: pnfarm_x_seconds, p99: < 2ms}", "expect.for: is missing; allowed: the time over which"),
        ("expect: {metric: pnfarm_x_total, increases: 0, within: 3s}", "is for conditions on drives"),
        ("expect: {drive: all, that: connected, p99: 1}", "is for metrics"),
        ("load: {drives: 65}", "is 65, and there are 2"),
        ("load: {drives: 0}", "such as +8 or -8"),
        ("power: {off: axis-09}", "no drive matches"),
        ("power: {off: all, on: all}", "has more than one of these"),
        ("param: {drive: axis-01, set: {DRV.OPMOD: 1}}", "did you mean DRV.OPMODE?"),
        ("param: {drive: axis-01, set: {DRV.OPMODE: fast}}", "a whole number"),
        ("repeat: {times: 2}", "steps[0].repeat.steps: is nothing; allowed: a list of steps"),
        ("repeat: {steps: [wait: 1s]}", "needs one of these; allowed: for, times"),
        ("repeat: {for: {n: {from: 3, to: 1}}, steps: [wait: 1s]}", "allowed: a list such as [1ms, 4ms]"),
        ("repeat: {for: {n: [1], m: [2]}, steps: [wait: $k]}", "$k has no value"),
        ("find: {for: {n: [1]}, steps: [wait: 1s]}", "has no expectation"),
        ("find: {steps: [{expect: {drive: all, that: connected}}]}", "steps[0].find.for: is missing"),
        ("find: {for: {n: [1], m: [2]}, steps: [{expect: {drive: all, that: connected}}]}", "One variable"),
        (
            "find: {for: {n: [fast]}, steps: [{expect: {drive: all, that: connected}}]}",
            "steps[0].find.for.n: 'fast' is not a duration",
        ),
        ("find: {for: {n: [1]}, by: luck, steps: [{expect: {drive: all, that: connected}}]}", "first, bisect, all"),
        ("find: {for: {n: [1]}, is: most, steps: [{expect: {drive: all, that: connected}}]}", "steps[0].find.is"),
        (
            "find: {for: {n: [1]}, measure: {metric: pnfarm_x}, steps: [{expect: {drive: all, that: connected}}]}",
            "allowed: {metric: NAME, of: increases",
        ),
        (
            "find: {for: {n: [1]}, steps: [{find: {for: {m: [1]}, steps: [{expect: {drive: all, that: connected}}]}}]}",
            "is inside of another find",
        ),
        ("find: {for: {n: [1]}, steps: [{expect: {drive: axis-09, that: connected}}]}", "no drive matches"),
        ("find: {for: {n: {from: 4ms, to: 1ms}}, steps: [{expect: {drive: all, that: connected}}]}", "a list such as"),
        ("load: {total: 65}", "is 65, and there are 2"),
        ("load: {total: -1}", "how many drives are on"),
        ("parallel: wait", "allowed: a list whose entries"),
        ("{wait: 1s, clear: all}", "has 2 keys"),
        ("wait", "a step with one key"),
    ],
)
def test_an_error_names_line_key_and_what_is_allowed(step: str, sentence: str) -> None:
    found = errors(steps(step))
    assert any(sentence in issue for issue in found), found
    assert all(issue.startswith("<scenario>:3: steps[0]") for issue in found), found


def test_all_errors_come_at_once_in_the_order_of_the_lines() -> None:
    text = "scenario: ''\nfram: x\nvariables: [1]\nsteps:\n  - wait: 1\n  - clear: no\n  - expect: {that: x y}\n"
    lines = [int(issue.split(":")[1]) for issue in errors(text, bind=False)]
    assert lines == sorted(lines)
    assert {1, 2, 3, 5, 7} <= set(lines)


def test_repetitions_are_written_out_with_their_values() -> None:
    scenario = parse_scenario(
        steps("repeat: {for: {cycle: [1ms, 4ms], n: {from: 1, to: 3}}, steps: [wait: $cycle, "
              "{expect: {drive: all, that: 'velocity > $n', name: above $n}}]}")
    )  # fmt: skip
    assert len(scenario.steps) == 12
    assert [step.values["for"] for step in scenario.steps[::2]] == [1_000_000] * 3 + [4_000_000] * 3
    assert scenario.steps[3].title == "above 2 [cycle=1ms, n=2]"
    assert scenario.steps[3].values["that"] == "velocity > 2"


def test_what_repeats_itself_without_end_is_bounded() -> None:
    nested = "wait: 1s"
    for _ in range(5):
        nested = f"repeat: {{times: 100, steps: [{nested}]}}"
    assert any("too many steps" in issue for issue in errors(steps(nested), bind=False))
    many = "scenario: x\nsteps:\n" + "  - weit: 1s\n" * 5000
    assert len(errors(many, bind=False)) <= 100


@pytest.mark.parametrize("step", ["{wait: 1s, name: x}", "wait", "{repeat: {times: 9, steps: []}}", "{repeat: {}}"])
def test_a_wrong_step_that_repeats_itself_without_end_is_bounded(step) -> None:
    nested = step
    for _ in range(5):
        nested = f"{{repeat: {{times: 10000, steps: [{nested}]}}}}"
    assert any("too many steps" in issue for issue in errors(f"scenario: x\nsteps: [{nested}]\n", bind=False))


def test_a_file_that_cannot_be_read_is_one_sentence(tmp_path) -> None:
    from pnfarm.scenario.definition.file import load_scenario

    with pytest.raises(FarmFileError, match="cannot be read"):
        load_scenario(tmp_path / "no.scenario.yml")
    with pytest.raises(FarmFileError, match="not a regular file"):
        load_scenario(tmp_path)


def _values() -> st.SearchStrategy[object]:
    words = st.sampled_from(
        ["$x", "1s", "all", "axis-01", "f702", "connected", "", "S4", "0", "trip", "island-1.a", "@x.csv"]
    )
    keys = st.sampled_from(
        ["wait", "fault", "clear", "expect", "load", "parallel", "repeat", "power", "param", "for", "until", "drive",
         "that", "metric", "increases", "steps", "times", "kind", "on", "set", "within", "name", "force", "release",
         "params", "values", "island-1.a"]
    )  # fmt: skip
    plain = st.one_of(words, st.integers(-3, 3), st.booleans(), st.none(), st.floats(allow_nan=False))
    return st.recursive(
        plain, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(keys, inner, max_size=3), max_leaves=12
    )


@given(_values())
@settings(max_examples=300, deadline=None)
def test_any_steps_give_a_scenario_or_errors(value: object) -> None:
    import json

    for issue in errors(json.dumps({"scenario": "x", "variables": {"x": 1}, "steps": [value]})):
        assert "\n" not in issue


def test_the_schema_knows_every_step_and_key() -> None:
    schema = scenario_schema()
    kinds = schema["$defs"]["Step"]["properties"]
    assert {
        "wait",
        "fault",
        "clear",
        "expect",
        "load",
        "parallel",
        "repeat",
        "power",
        "param",
        "set",
        "find",
        "force",
        "release",
        "restore",
    } == set(kinds)
    assert "f702" in str(schema["$defs"]["Fault"])
