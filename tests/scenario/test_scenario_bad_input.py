"""Whatever a scenario file holds, the answer is a scenario or sentences with lines, and it comes at once."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pnfarm.buses.registry import fault_kinds
from pnfarm.cli.main import main
from pnfarm.drives.catalogue import model
from pnfarm.scenario.definition.binding import bind_scenario
from pnfarm.scenario.definition.file import MAX_STEPS, parse_scenario
from pnfarm.vocabulary.issues import FarmFileError

LIBRARY = Path(__file__).resolve().parents[2] / "configs" / "scenarios"
TEXTS = [path.read_text() for path in sorted(LIBRARY.glob("*.scenario.yml"))]
DRIVES = {"axis-01": model("akd-profinet"), "axis-02": model("moog-msd"), "axis-03": model("hiwin-e1")}
#: What a slip of the pen, or malice, puts into a file.
PIECES = [
    "$", "${", "$axis", "${n}", "{", "}", "[", "]", ":", "-", "*a", "&a", "<<: *a", "!!python/object:os.system x",
    "\t", "\0", "1e400", ".nan", "9" * 50, "0x", "-1", "null", "~", "true", "'", '"', "#", "\u2028", "\ud800",
    "\U0001f4a5",
    "%", "|", ">", "", "all", "axis-*", "[0-9]", "state == S4", "zsw1.99", 'param("', "((((", "not not not", "and",
    "1min", "-5s", "99999999h", "f702", "loss", "repeat", "parallel", "steps", "for", "times", "10000", "within",
    "expect",
]  # fmt: skip


def answer(text: str | bytes) -> list[str]:
    """The errors of a file, as sentences."""
    try:
        bind_scenario(parse_scenario(text), DRIVES, fault_kinds())
    except FarmFileError as error:
        sentences = [str(issue) for issue in error.issues]
        assert sentences
        assert all("\n" not in sentence for sentence in sentences)
        assert all(len(sentence) < 3000 for sentence in sentences)
        return sentences
    return []


@given(st.text(max_size=300) | st.binary(max_size=300))
@settings(max_examples=60)
def test_any_text_is_answered_with_sentences(text: str | bytes) -> None:
    assert answer(text)


@given(
    st.sampled_from(TEXTS),
    st.lists(st.tuples(st.floats(0, 1), st.integers(0, 30), st.sampled_from(PIECES)), min_size=1, max_size=4),
)
@settings(max_examples=100)
def test_a_scenario_of_the_library_with_slips_is_answered_with_sentences(
    text: str, slips: list[tuple[float, int, str]]
) -> None:
    for place, length, piece in slips:
        at = int(place * len(text))
        text = text[:at] + piece + text[at + length :]
    answer(text)


@given(st.sampled_from(TEXTS), st.randoms(use_true_random=False))
@settings(max_examples=60)
def test_a_scenario_of_the_library_with_words_exchanged_is_answered_with_sentences(text: str, random: object) -> None:
    words = text.split(" ")
    for _ in range(3):
        one, two = random.randrange(len(words)), random.randrange(len(words))  # type: ignore[attr-defined]  # a Random
        words[one], words[two] = words[two], words[one]
    answer(" ".join(words))


def bomb(depth: int) -> str:
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{n + 1}: &a{n + 1} [{', '.join([f'*a{n}'] * 10)}]" for n in range(depth)]
    return "\n".join(lines) + "\n"


STEP = "scenario: x\nsteps:\n"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (bomb(9), "too many values once its aliases are followed"),
        ("scenario: x\nsteps: &s\n  - parallel: *s\n", "contains itself"),
        (STEP + "  - wait: 1s\n" * 90_000, "is too large"),
        (STEP + "  - wait: 1s\n" * (MAX_STEPS + 1), "makes too many steps"),
        (STEP + "  - " + "parallel: [" * 100 + "wait: 1s" + "]" * 100, "nested too deeply"),
        (STEP + "  - " + "{repeat: {times: 2, steps: [" * 12 + "wait: 1s" + "]}}" * 12, "nested too deeply"),
        (
            STEP + "  - repeat: {for: {a: {from: 1, to: 9999}, b: {from: 1, to: 9999}}, steps: [wait: 1s]}",
            "makes 99980001 rounds",
        ),
        (STEP + "  - repeat: {for: {a: {from: 1, to: 99999999999}}, steps: [wait: 1s]}", "allowed: a list such as"),
        (STEP + "  - repeat: {for: {a: {from: 1, to: " + "9" * 30 + "}}, steps: [wait: 1s]}", "a list such as"),
        (STEP + "  - repeat: {for: {a: [1, .nan]}, steps: [wait: 1s]}", "for.a: has nan; allowed: finite numbers"),
        (STEP + "  - repeat: {for: {a: [-.inf]}, steps: [wait: 1s]}", "for.a: has -inf; allowed: finite numbers"),
        ("scenario: x\nmatrix: {a: [.inf]}\nsteps: [wait: 1s]\n", "matrix.a: has inf; allowed: finite numbers"),
        (STEP + "  - repeat: {times: 99999999999, steps: [wait: 1s]}", "a whole number from 1 to 10000"),
        (STEP + "  - repeat: {times: $n, steps: [wait: 1s]}", "$n has no value"),
        (STEP + "  - expect: {drive: $drive, that: connected}", "$drive has no value"),
        (STEP + "  - expect: {drive: all, that: '" + "(" * 5000 + "connected" + ")" * 5000 + "'}", "column"),
        (STEP + "  - expect: {drive: all, that: '" + "not " * 5000 + "connected'}", "column"),
        (STEP + "  - expect: {drive: all, that: '" + " or ".join(["connected"] * 5000) + "'}", "column"),
        (STEP + "  - wait: 99999999h", "allowed: at most a year"),
        ("scenario: x\nscenario: y\nsteps: [wait: 1s]\n", "is given twice"),
        ("scenario: <script>\nsteps: [wait: 1s]\n", "a name: a-z, 0-9"),
        ("scenario: x\nsteps: [wait: 1s]\n---\nscenario: y\n", "starts a second document"),
    ],
    ids=itertools.count(),
)  # fmt: skip
def test_what_is_too_large_too_deep_or_has_no_end_is_refused_at_once(text: str, sentence: str) -> None:
    found = answer(text)
    assert any(sentence in one for one in found), found[:3]
    assert len(found) <= 100


@pytest.mark.parametrize(
    ("value", "sentence"),
    [(10**400, "for.n: is 1000"), (float("nan"), "for.n: has nan"), (float("inf"), "for.n: has inf")],
)
def test_a_variable_that_no_number_can_be_made_of_is_refused_where_it_is_used(value: float, sentence: str) -> None:
    text = "scenario: x\nvariables: {v: 1}\nsteps:\n"
    text += "  - find: {for: {n: [$v]}, steps: [{expect: {drive: all, that: connected}}]}\n"
    with pytest.raises(FarmFileError, match=sentence):
        parse_scenario(text, variables={"v": value})


def test_a_value_given_for_a_matrix_is_checked_as_those_of_the_file() -> None:
    with pytest.raises(FarmFileError, match=r"matrix\.n: has nan; allowed: finite numbers"):
        parse_scenario("scenario: x\nmatrix: {n: [1, 2]}\nsteps: [wait: 1s]\n", variables={"n": float("nan")})


def test_a_variable_without_a_value_is_the_only_error_of_its_key() -> None:
    (found,) = answer(STEP + "  - expect: {drive: all, that: connected, within: $limit}")
    assert "$limit has no value" in found


def test_ten_thousand_steps_are_read() -> None:
    assert answer(STEP + "  - wait: 1s\n" * MAX_STEPS) == []


def test_many_long_values_do_not_make_long_answers() -> None:
    text = STEP + "".join(f"  - expect: {{drive: {'x' * 500}, that: '{'y' * 500}'}}\n" for _ in range(300))
    assert sum(map(len, answer(text))) < 200_000


@pytest.mark.parametrize(
    ("farm", "sentence"),
    [
        ("none.pnfarm.yml", "cannot be read: no such file"),
        (".", "not a regular file"),
        ("bad.pnfarm.yml", "bad.pnfarm.yml:2: drives"),
        ("$farm", "cannot be read"),
        ("http://a/b/c", "not the address of a farm"),
    ],
)
def test_a_farm_that_cannot_be_had_is_told_with_its_name(
    farm: str, sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "bad.pnfarm.yml").write_text("farm: x\ndrives: [{name: a, model: no-such}]\nlink: {kind: memory}\n")
    file = tmp_path / "x.scenario.yml"
    file.write_text(f"scenario: x\nfarm: {farm}\nsteps: [wait: 1s]\n")
    code = main(["run", str(file), *(["--virtual"] if "://" not in farm else [])])
    said = capsys.readouterr().err
    assert sentence in said
    assert "Traceback" not in said
    assert code == 2


def test_both_the_farm_and_the_wrong_key_that_a_scenario_sets_are_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "x.scenario.yml"
    line = LIBRARY / "line.pnfarm.yml"
    file.write_text(f"scenario: x\nfarm: {line}\nwith: {{controller.cycel: 2ms}}\nsteps: [wait: 1s]\n")
    for command in (["validate", str(file)], ["run", str(file), "--virtual"]):
        assert main(command) == 2
        said = capsys.readouterr().err
        assert "controller.cycel" in said
        assert "did you mean" in said


def test_an_internal_error_has_its_own_exit_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "x.scenario.yml"
    file.write_text(f"scenario: x\nfarm: {LIBRARY / 'line.pnfarm.yml'}\nsteps: [wait: 1s]\n")

    async def broken(*_: object, **__: object) -> None:
        raise AssertionError

    monkeypatch.setattr("pnfarm.scenario.virtual.run_virtual", broken)
    assert main(["run", str(file), "--virtual"]) == 5


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["run", "configs/cell.pnfarm.yml"], "drives: is of a farm file: `pnfarm up` runs it"),
        (["up", "configs/scenarios/f702-ladder.scenario.yml"], "steps: is of a scenario: `pnfarm run` carries it out"),
    ],
)
def test_a_file_of_the_other_kind_is_refused_in_one_sentence_with_the_command_for_it(
    arguments: list[str], sentence: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(LIBRARY.parents[1])
    assert main(arguments) == 2
    told = capsys.readouterr().err
    assert sentence in told
    assert told.count("\n") == 1
