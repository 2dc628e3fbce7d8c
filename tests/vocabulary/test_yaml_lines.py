"""YAML with its places; nothing that a file holds brings down its reader."""

import contextlib
import copy
import json
import re

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.farm.file.reading import FarmFileError, expand, parse_farm
from pnfarm.vocabulary import yaml_lines
from pnfarm.vocabulary.yaml_lines import YamlError, parse_yaml


@pytest.fixture(params=["fast", "plain"], autouse=True)
def _both_parsers(request, monkeypatch):
    if request.param == "plain":
        monkeypatch.setattr(yaml_lines, "_LOADER", yaml.SafeLoader)


def test_scalars_follow_the_core_schema():
    text = "[on, off, yes, 12:30, 010, 0o10, 0x10, 1_0, 2e4, 1., -.5, +3, .inf, ~, '', '7', true, 2024-01-01, =]"
    assert parse_yaml(text).root.plain() == [
        "on", "off", "yes", "12:30", 10, 8, 16, "1_0", 20000.0, 1.0, -0.5, 3,
        float("inf"), None, "", "7", True, "2024-01-01", "=",
    ]  # fmt: skip


def test_keys_are_words_as_they_were_written():
    assert parse_yaml("{947.3: 1, 0x10: 2, on: 3, ~: 4}").root.plain() == {"947.3": 1, "0x10": 2, "on": 3, "~": 4}


def test_places_count_from_one_and_fall_back_to_the_parent():
    document = parse_yaml("a:\n  - b: 1\n    c: {d: 2}\n")
    assert document.locate(("a",)) == (1, 1)
    assert document.locate(("a", 0, "c", "d")) == (3, 9)
    assert document.locate(("a", 0, "missing")) == (2, 5)
    assert document.locate(("a", 7)) == (1, 1)


def test_aliases_and_merges_work_and_own_keys_win():
    document = parse_yaml("x: &x {a: 1, b: 2}\ny: &y {b: 3, c: 4}\nz: {<<: [*x, *y], a: 0}\nw: *x\n")
    assert document.root.plain()["z"] == {"a": 0, "b": 2, "c": 4}
    assert document.root.plain()["w"] == {"a": 1, "b": 2}


def test_duplicate_keys_are_reported_and_the_first_is_taken():
    document = parse_yaml("a: 1\nb: {c: 1, c: 2}\na: 3\n")
    assert [(p.line, p.column, p.field) for p in document.problems] == [(2, 11, "b.c"), (3, 1, "a")]
    assert document.root.plain() == {"a": 1, "b": {"c": 1}}


def bomb():
    lines = ["a: &a [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    for above, name in zip("abcdefgh", "bcdefghi", strict=True):
        lines.append(f"{name}: &{name} [{', '.join(['*' + above] * 10)}]")
    return "\n".join(lines)


@pytest.mark.parametrize(
    ("text", "line", "what"),
    [
        ("", 0, "is empty"),
        ("# only a comment\n", 0, "is empty"),
        ("a: [1\nb: 2\n", 2, "is not valid YAML here"),
        ("a: b: c", 1, "is not valid YAML here"),
        ("a: 1\n\t- b\n", 2, "is not valid YAML here"),
        ("a: 1\n--- \nb: 2\n", 2, "second document"),
        ("a: &x [*x]", 1, "contains itself"),
        ("a: *x", 1, "no anchor defines"),
        ("a: !!python/name:os.system x", 1, "tag"),
        ("a: !!int x", 1, "tag"),
        ("a: !thing {}", 1, "tag"),
        ("{[1]: 2}", 1, "a key that is not a word"),
        ("<<: 7", 1, "merges something"),
        ("? " + "k" * 300 + "\n: 1\n", 1, "too long"),
        ("[" * 40 + "]" * 40, 1, "nested too deeply"),
        ("[" * 100_000, 1, "nested too deeply"),
        ("a: 1\nb: " + "{c: " * 600 + "[}", 2, "nested too deeply"),
        (bomb(), 6, "too many values"),
        ("a: 1\nb: \0", 2, "NUL"),
        ("a: 1\nb: \x07", 2, "forbids"),
        ("a: \ud800", 1, "surrogate"),
        (b"a: 1\nb: \xe4\n", 2, "not UTF-8 text: octet 0xe4 at offset 8"),
        ("a: 1\n".encode("utf-16"), 1, "not UTF-8"),
        (b"#" * (yaml_lines.MAX_OCTETS + 1), 0, "too large"),
    ],
    ids=lambda value: repr(value)[:24],
)
def test_what_is_no_yaml_says_where_and_why(text, line, what):
    with pytest.raises(YamlError) as caught:
        parse_yaml(text)
    assert caught.value.problem.line == line
    assert re.search(what, caught.value.problem.what)
    assert caught.value.problem.allowed
    with pytest.raises(FarmFileError, match=r"^x\.yml:"):
        parse_farm(text, "x.yml")


@pytest.mark.parametrize(
    ("text", "line", "quoted"),
    [
        ("farm: f\ndrives:\n  - {name: axis-{n:02}, count: 8}\n", 3, 'name: "axis-{n:02}"'),
        ("farm: f\ndrives:\n  - {count: 8, name: axis-{n}}\n", 3, 'name: "axis-{n}"'),
        ("farm: f\ndrives:\n  - {count: 8,\n     name: axis-{n}-x, model: hiwin-e1}\n", 4, 'name: "axis-{n}-x"'),
        ("farm: f\ndrives: [{name: {n:02}-x}]\n", 2, 'name: "{n:02}-x"'),
        ("steps: [{fault: {kind: f702, on: axis-{n}}}]\n", 1, 'on: "axis-{n}"'),
    ],
)
def test_a_name_with_a_counter_in_flow_style_is_shown_with_its_quotes(text, line, quoted):
    with pytest.raises(YamlError) as caught:
        parse_yaml(text)
    assert (caught.value.problem.line, caught.value.problem.allowed) == (line, f"quotes around it: {quoted}")
    assert parse_yaml(text.replace(quoted.replace('"', ""), quoted))


def test_a_counter_that_flow_style_takes_for_a_mapping_is_shown_with_quotes():
    with pytest.raises(FarmFileError, match=r"drives\[0\].name: is a mapping.*quotes"):
        parse_farm("farm: f\nlink: {kind: memory}\ndrives: [{name: {n}, model: hiwin-e1}]\n")


def test_a_counter_in_block_style_needs_no_quotes():
    assert parse_yaml("name: axis-{n:02}\n").root.plain() == {"name": "axis-{n:02}"}


def test_a_byte_order_mark_is_no_error():
    assert parse_yaml("\ufeffa: 1".encode()).root.plain() == parse_yaml("\ufeffa: 1").root.plain() == {"a": 1}


_PLAIN = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(10**12), 10**12)
    | st.text(st.characters(codec="ascii", exclude_categories=["C"])),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.text(st.characters(codec="ascii", exclude_categories=["C"]), max_size=8), inner, max_size=3
        )
    ),
    max_leaves=12,
)


@given(_PLAIN.filter(lambda value: value is not None))
def test_json_is_read_as_it_was_written(value):
    assert parse_yaml(json.dumps(value)).root.plain() == value


@given(st.binary(max_size=200) | st.text(max_size=200))
def test_any_text_gives_a_document_or_a_yaml_error(text):
    with contextlib.suppress(YamlError):
        parse_yaml(text).root.plain()


_PIECES = st.sampled_from(
    [
        "farm",
        "link",
        "drives",
        "name",
        "count",
        "controller",
        "api",
        ": ",
        "\n",
        "  ",
        "- ",
        "{",
        "}",
        "[",
        "]",
        ", ",
        "x",
        "7",
        "off",
        "&a ",
        "*a",
        "<<: ",
    ]
)


@given(st.lists(_PIECES, max_size=40).map("".join))
def test_any_file_gives_a_farm_or_a_farm_file_error(text):
    with contextlib.suppress(FarmFileError):
        parse_farm(text)


_VALUES = st.sampled_from(
    [None, True, 0, -1, 3.5, "", "auto", "16ms", "10.0.0.1/24", [], {}, [{}], {"kind": "veth"}, {"x": 1}]
)
_GOOD = {
    "farm": "f",
    "link": {"kind": "memory"},
    "api": "off",
    "drives": [
        {"name": "a-{n}", "count": 3, "model": "akd-profinet", "impair": [{"kind": "loss"}]},
        {"name": "b", "model": "akd-profinet"},
    ],
    "controller": {"cycle": "16ms", "program": {"kind": "sine"}},
}


def _keys(value, path=()):
    yield path
    for step, inner in (
        value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    ):
        yield from _keys(inner, (*path, step))


@given(st.lists(st.tuples(st.sampled_from([path for path in _keys(_GOOD) if path]), _VALUES), min_size=1, max_size=6))
def test_any_wrong_values_give_a_farm_or_a_farm_file_error(changes):
    values = copy.deepcopy(_GOOD)
    for path, value in changes:
        target = values
        try:
            for step in path[:-1]:
                target = target[step]
            target[path[-1]] = copy.deepcopy(value)
        except (LookupError, TypeError):
            continue
    with contextlib.suppress(FarmFileError):
        expand(parse_farm(json.dumps(values)))


def test_a_chain_of_aliases_is_nested_as_deeply_as_what_it_makes():
    links = "".join(f"y{n}: &a{n} [*a{n - 1}]\n" for n in range(1, 600))
    with pytest.raises(YamlError, match="nested too deeply once its aliases are followed"):
        parse_yaml(f"y0: &a0 [1]\n{links}")
