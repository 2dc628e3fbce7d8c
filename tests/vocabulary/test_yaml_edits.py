"""Values of a YAML text are changed in place, and nothing else is."""

import contextlib
import json

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from pnfarm.vocabulary import yaml_lines
from pnfarm.vocabulary.yaml_edits import UneditableError, YamlEditor
from pnfarm.vocabulary.yaml_lines import parse_yaml
from pnfarm.vocabulary.yaml_parts import parts_of

NEW = parts_of(text := "n: 7\nmap: {a: 1, b: x}\nlong:\n  a: 1\n  b: [1, 2]\n", parse_yaml(text).root)


@pytest.fixture(params=["fast", "plain"], autouse=True)
def _both_parsers(request, monkeypatch):
    if request.param == "plain":
        monkeypatch.setattr(yaml_lines, "_LOADER", yaml.SafeLoader)


def changed(text, change):
    editor = YamlEditor(text)
    change(editor, editor.root)
    return editor.result()


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("a: 1\nb: 2  # mine\nc: 3\n", "a: 1\nb: {}  # mine\nc: 3\n"),
        ("{a: 1, 'b' :  2 , c: 3}", "{{a: 1, 'b' :  {} , c: 3}}"),
        ("{a: 1,   # mine\n b: 2,\n c: 3}\n", "{{a: 1,   # mine\n b: {},\n c: 3}}\n"),
        ("b:\n  - 1\n  - 2\n# mine\nc: 3\n", "b: {}\n# mine\nc: 3\n"),
    ],
)
def test_a_value_is_replaced_in_its_place(text, wanted):
    for name, written in (("n", "7"), ("map", "{a: 1, b: x}")):
        assert changed(text, lambda editor, root, name=name: editor.replace(root, "b", NEW[name])) == wanted.format(
            written
        )


def test_a_value_in_several_lines_takes_the_indentation_of_its_place():
    text = "x:\n    b: 2   # mine\n    c: 3\n"
    made = changed(text, lambda editor, root: editor.replace(root.content["x"][1], "b", NEW["long"]))
    assert made == "x:\n    b:\n      a: 1\n      b: [1, 2]   # mine\n    c: 3\n"
    made = changed("x: {b: 2}", lambda editor, root: editor.replace(root.content["x"][1], "b", NEW["long"]))
    assert made == "x: {b: {a: 1, b: [1, 2]}}"


@pytest.mark.parametrize(
    ("text", "after", "wanted"),
    [
        ("a: 1  # one\nc: 3", "a", "a: 1  # one\nn: 7\nc: 3"),
        ("a: 1\n\n# last\n", None, "a: 1\nn: 7\n\n# last\n"),
        ("a: 1", None, "a: 1\nn: 7"),
        ("a:\n  b: 1\n  # of a\n# of c\nc: 3\n", "a", "a:\n  b: 1\n  # of a\nn: 7\n# of c\nc: 3\n"),
        ("{a: 1, c: 3}", "a", "{a: 1, n: 7, c: 3}"),
        ("{}", None, "{n: 7}"),
        ("a: |\n  text\n\nc: 1\n", "a", "a: |\n  text\nn: 7\n\nc: 1\n"),
    ],
)
def test_a_key_is_added_behind_another(text, after, wanted):
    assert changed(text, lambda editor, root: editor.add(root, "n", NEW["n"], after)) == wanted


@pytest.mark.parametrize(
    ("text", "names", "wanted"),
    [
        ("a: 1\nb: 2\nc: 3\n", "b", "a: 1\nc: 3\n"),
        ("a: 1\nb: 2   # mine\nc: 3", "bc", "a: 1\n# mine\n"),
        ("a: 1\nb:\n- 1\n- 2\nc: 3\n", "b", "a: 1\nc: 3\n"),
        ("{a: 1, b: 2, c: 3}", "b", "{a: 1, c: 3}"),
        ("{a: 1, b: 2, c: 3}", "ab", "{c: 3}"),
        ("{a: 1, b: 2, c: 3, d: 4}", "bd", "{a: 1, c: 3}"),
        ("{a: 1, b: 2, c: 3, d: 4}", "acd", "{b: 2}"),
        ("{ a: 1, b: 2 }", "ab", "{  }"),
    ],
)
def test_keys_are_removed_and_a_comment_behind_them_stays(text, names, wanted):
    assert changed(text, lambda editor, root: editor.remove(root, list(names))) == wanted


@pytest.mark.parametrize(
    ("text", "line", "why"),
    [
        ("a: &x 1\nb: *x\n", 1, "elsewhere"),
        ("b: 1\na: *x\n".replace("b: 1", "b: &x 1"), 2, "elsewhere"),
        ("x: &x {b: 1}\ny:\na: {<<: *x}\n", 3, "elsewhere"),
        ("b: 1\na: |\n  text\n", 2, "several lines"),
        ("b: 1\na:\n", 2, "empty"),
        ("b: 1\na:\n  # mine\n  c: 1\n", 2, "comments"),
        ("{b: 1, a: {c: 1,\n d: 2}, e: 1}", 1, "several lines in braces"),
    ],
)
def test_what_a_change_could_damage_is_refused_with_its_line(text, line, why):
    editor = YamlEditor(text)
    with pytest.raises(UneditableError) as refused:
        editor.remove(editor.root, ["a"])
    assert (refused.value.line, why in refused.value.why) == (line, True)
    assert editor.result() == text


def test_a_text_with_other_values_than_those_wanted_is_not_returned():
    # a separator that ends a line for YAML only
    editor = YamlEditor("a: 1\nb: 2 # mine\u2028c: 3\n")
    with contextlib.suppress(UneditableError):
        editor.remove(editor.root, ["b"])
        assert parse_yaml(editor.result()).root.plain() == {"a": 1, "c": 3}
    editor = YamlEditor("l:\n- name: a\n- name: b\n")
    editor.remove(editor.root.content["l"][1], ["a", "b"])
    with pytest.raises(UneditableError):
        editor.result()


NAMES = st.sampled_from(["a", "b", "c d", "1", "x-y", "#", ": ", "'"])
SCALARS = st.sampled_from([1, 2.5, True, "x", "a b", "0x1F", "12:30", " #", "- ", "null", "ä"])
VALUES = st.dictionaries(
    NAMES, SCALARS | st.lists(SCALARS, min_size=1, max_size=3) | st.dictionaries(NAMES, SCALARS, min_size=1), min_size=1
)


@settings(max_examples=60, deadline=None)
@given(
    VALUES, VALUES, st.sampled_from([None, False, True]), st.sampled_from([20, 200]), st.integers(2, 6), st.data()
)  # fmt: skip
def test_any_changes_of_any_text_give_the_values_wanted(values, others, style, width, indent, data):
    text = yaml.safe_dump(values, default_flow_style=style, width=width, indent=indent, allow_unicode=True)
    made = "".join(f"{json.dumps(name)}: {json.dumps(value)}\n" for name, value in others.items())
    new = parts_of(made, parse_yaml(made).root)
    editor = YamlEditor(text)
    there = list(editor.parts(editor.root))
    gone = data.draw(st.lists(st.sampled_from(there), unique=True, max_size=len(there) - 1))
    wanted = {name: value for name, value in parse_yaml(text).root.plain().items() if name not in gone}
    try:
        editor.remove(editor.root, gone, there)
    except UneditableError:
        wanted = parse_yaml(text).root.plain()
        gone = []
    for name, part in new.items():
        if name in gone:
            continue
        if name in wanted:
            editor.replace(editor.root, name, part, known=True)
        else:
            after = data.draw(st.sampled_from([None, *(one for one in there if one not in gone)]))
            editor.add(editor.root, name, part, after)
        wanted[name] = part.plain
    assert parse_yaml(editor.result()).root.plain() == wanted
