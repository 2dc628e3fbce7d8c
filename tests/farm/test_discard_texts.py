"""Every reason for which something is dropped has words."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import pnfarm
from pnfarm.farm.views.discard_texts import PREFIXES, REASONS, discard_text
from pnfarm.table.channel import DISCARDS

ROOT = Path(pnfarm.__file__).parent
ROOMS = ("protocols", "links", "farm", "buses", "controller", "wire", "drives")
#: Names of what counts: the counters themselves, and the functions that count.
COUNTERS = {"dropped", "_dropped", "discards"}
FUNCTIONS = {"_drop", "passed_over", "drop"}
#: Machines whose slugs come from functions that answer a reason.
ANSWERS = {"protocols/profinet/rpc/fragments.py": {"add"}}


def name_of(node: ast.AST) -> str:
    return node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else ""


def texts(node: ast.AST):
    """What a reason's expression can be: whole texts, or ``(beginning, whole template)`` of a built one."""
    match node:
        case ast.Constant(value=str() as text):
            yield text
        case ast.JoinedStr(values=values):
            shape = "".join(v.value if isinstance(v, ast.Constant) else "{}" for v in values)
            yield (values[0].value if isinstance(values[0], ast.Constant) else "", shape)
        case ast.IfExp(body=body, orelse=other):
            yield from texts(body)
            yield from texts(other)
        case ast.Call(func=ast.Attribute(value=inner)):  # a text that is made lower case
            yield from texts(inner)


def reasons(path: Path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    answers = ANSWERS.get(path.relative_to(ROOT).as_posix(), set())
    for node in ast.walk(tree):
        match node:
            case ast.Subscript(value=value, slice=index) if name_of(value) in COUNTERS:
                yield from texts(index)
            case ast.Call(func=function, args=[first, *_]) if name_of(function) in FUNCTIONS | {"DecodeError"}:
                yield from texts(first)
            case ast.Call(func=function, args=[_, second]) if name_of(function) in {"_drop_waiting", "_forget"}:
                yield from texts(second)
            case ast.Dict(values=values) if path.name in {"packet.py", "tap.py"}:
                for value in values:  # by error number of the kernel
                    yield from texts(value)
            case ast.FunctionDef(name=name) if name in answers:
                for inner in ast.walk(node):
                    if isinstance(inner, ast.Return) and inner.value is not None:
                        yield from texts(inner.value)


@pytest.fixture(scope="module")
def found() -> set:
    paths = (path for room in ROOMS for path in (ROOT / room).rglob("*.py"))
    return {reason for path in paths for reason in reasons(path)}


def test_the_search_finds_what_it_is_to_find(found):
    assert {"old-sequence", "identify-for-another", "duplicate-fragment", "short", "queue-full"} <= found
    assert ("arp-", "arp-{}") in found


def test_every_reason_in_the_sources_has_words(found):
    whole = {reason for reason in found if isinstance(reason, str)}
    built = {r for r in whole if any(r.startswith(p) and r.removeprefix(p) in REASONS for p in PREFIXES)}
    assert whole - REASONS.keys() - built == set()


def test_every_reason_that_is_built_begins_with_words(found):
    built = {reason for reason in found if isinstance(reason, tuple)}
    assert built
    assert {begun: shape for begun, shape in built if begun not in PREFIXES and "-in-" not in shape} == {}


@pytest.mark.parametrize("reason", DISCARDS)
def test_every_reason_of_the_engine_has_words(reason):
    assert reason in REASONS


@pytest.mark.parametrize(
    ("reason", "words"),
    [
        ("old-counter", "cyclic frame whose cycle counter does not advance: late or repeated"),
        ("arp-short", "ARP packet: ends before its format does"),
        ("response-in-idle", "response arrived in state IDLE"),
        ("reject-unk-if", "call rejected: unk if"),
        ("never-heard", "never heard"),
    ],
)
def test_words_of(reason, words):
    assert discard_text(reason) == words
