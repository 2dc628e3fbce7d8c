"""Values over time: as a text, and in files."""

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pnfarm.vocabulary import samples
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.samples import read_samples, with_files


def refusal(call):
    """What a call gives, and why it is refused."""
    try:
        return call(), None
    except Problem as problem:
        return None, problem


def of_file(tmp_path, text, column=""):
    path = tmp_path / "a.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return with_files({"values": f"@a.csv{column}", "signal": "x"}, tmp_path)["values"]


def test_times_are_seconds_or_durations():
    assert read_samples("0:false 0.5:true\n2s:00ff 3500ms:a:b") == [
        (0, "false"), (500_000_000, "true"), (2_000_000_000, "00ff"), (3_500_000_000, "a:b"),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "column", "expected"),
    [
        ("0,false\n0.5,true\n", "", "0:false 0.5:true"),
        ("time;a;b\r\n0;1;2\r\n1;1;3\r\n\r\n2;4;3\r\n", "", "0:1 2:4"),
        ("time;a;b\n0;1;2\n1;1;3\n", "#b", "0:2 1:3"),
        ("\ufefftime\ta\n-1\t5\n0\t6\n", "#1", "0:5 1:6"),
    ],
)
def test_a_file_gives_its_changes(tmp_path, text, column, expected):
    assert of_file(tmp_path, text, column) == expected


@pytest.mark.parametrize(
    ("text", "column", "why"),
    [
        ("t,a\n0,1\n1,\n", "", "a.csv, line 3: has no value in column 2"),
        ("0,1\n", "#2", "a.csv, line 1: there is no column '2'"),
        ("0,1\nx,1\n", "", "a.csv, line 2: 'x' is not a time"),
        ("1,1\n1,2\n", "", "a.csv, line 2: '1' is not later than the line before"),
        ("0,a b\n", "", "a.csv, line 1: has no value"),
        ("t,a\n", "", "a.csv has no samples"),
        ("", "", "a.csv has no samples"),
        (b"\xff\xfe", "", "a.csv is no text in UTF-8"),
        ("".join(f"{n},{n}\n" for n in range(samples.MAX_SAMPLES + 1)), "", "at most 10000"),
    ],
)
def test_what_is_wrong_with_a_file_has_its_line(tmp_path, text, column, why):
    with pytest.raises(Problem) as caught:
        of_file(tmp_path, text, column)
    assert why in f"{caught.value.what}; {caught.value.allowed}"


def test_a_file_that_is_not_there_or_no_file_is_refused(tmp_path, monkeypatch):
    for name in ("none.csv", "."):
        with pytest.raises(Problem, match=r"cannot be read"):
            with_files({"values": f"@{name}"}, tmp_path)
    monkeypatch.setattr(samples, "MAX_FILE", 3)
    with pytest.raises(Problem, match="too long"):
        of_file(tmp_path, "0,1\n")


def test_other_parameters_and_places_without_files_stay_as_they_are(tmp_path):
    for params in ({"value": "@a"}, {"values": 3}, {"values": "0:1"}, [], None):
        assert with_files(params, tmp_path) == params
    assert with_files({"values": "@a"}, None) == {"values": "@a"}


@given(st.text(alphabet="0123456789.:- \nx@sme+", max_size=60))
@example("1e400:1")
@example("nan:1")
@example("inf:1 0:2")
@settings(max_examples=300, deadline=None)
def test_any_text_gives_rising_times_or_one_sentence(text):
    found, problem = refusal(lambda: read_samples(text))
    if problem is not None:
        assert problem.what
        assert problem.allowed
        return
    times = [time for time, _ in found]
    assert times == sorted(set(times))
    assert times[0] >= 0


@given(st.binary(max_size=60), st.text(max_size=4))
@example(b"0,\x001\n", "")
@example(b'0,"1', "")
@settings(max_examples=200, deadline=None)
def test_any_file_gives_samples_or_one_sentence(tmp_path_factory, octets, column):
    found, problem = refusal(lambda: of_file(tmp_path_factory.getbasetemp(), octets, f"#{column}"))
    if problem is not None:
        assert "\n" not in problem.what
        return
    assert read_samples(found)
