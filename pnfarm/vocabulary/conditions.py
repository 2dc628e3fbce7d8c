"""Conditions over named signals: ``zsw1.fault_present and velocity > 1000``, parsed here and never evaluated by Python.

Grammar, from the loosest to the tightest::

    condition  = conjunct { "or" conjunct }
    conjunct   = negation { "and" negation }
    negation   = "not" negation | comparison
    comparison = operand [ ( "==" | "!=" | "<" | "<=" | ">" | ">=" ) operand ]
    operand    = "(" condition ")" | number [ unit ] | text | name | "param" "(" text ")"
    name       = word { "." word-or-number }      a word has letters, digits, "_", and "-" inside of it

There is no subtraction: ``island-1.part_present`` is one name, ``velocity > -5`` has a negative number.  A name may
begin with a digit if a word follows one of its dots: ``2nd-island.valve``.  A number is decimal or ``0x...``; a text is
in single or double quotes; ``true`` and ``false`` are 1 and 0.  What a name means, and in which unit, is the caller's:
:func:`names_in` lists the names of a tree, :func:`evaluate` asks for their values.  Length, number of operands and
nesting are bounded; :func:`parse_condition` returns a tree or raises :class:`ConditionError`, whatever the text.
"""

from __future__ import annotations

import operator
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import shown

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

__all__ = [
    "COMPARISONS",
    "CONDITION",
    "CONDITION_SCHEMA",
    "Both",
    "Comparison",
    "ConditionError",
    "Either",
    "Name",
    "Not",
    "Number",
    "Text",
    "Tree",
    "Value",
    "comparisons_in",
    "evaluate",
    "names_in",
    "parse_condition",
    "read_condition",
    "text_of",
]

#: What is allowed, for messages.
CONDITION = 'a condition such as `zsw1.fault_present`, `state == S4 and velocity > 1000` or `param("DRV.OPMODE") == 1`'
#: Longest text, characters; most operands; deepest nesting of parentheses and `not`.
MAX_LENGTH = 1000
MAX_OPERANDS = 64
MAX_DEPTH = 24
CONDITION_SCHEMA: Mapping[str, Any] = {"type": "string", "minLength": 1, "maxLength": MAX_LENGTH}

#: What a signal or an operand has: numbers, texts (names of states), yes or no.
Value: TypeAlias = "float | int | str | bool"

COMPARISONS: Mapping[str, Callable[[Value, Value], bool]] = {
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
_WORDS = frozenset({"and", "or", "not"})
#: Words of other languages for what is allowed here.
_INSTEAD = {"&&": "and", "||": "or", "!": "not", "=": "==", "<>": "!=", "&": "and", "|": "or"}
_TOKEN = re.compile(
    r"""(?P<space>[ \t\r\n]+)
    |(?P<name>(?:[A-Za-z_]|(?=[0-9][A-Za-z0-9_.-]*\.[A-Za-z_])[0-9])[A-Za-z0-9_]*(?:(?:\.|-+)[A-Za-z0-9_]+)*)
    |(?P<number>0[xX][0-9a-fA-F]{1,16}\b|[0-9]{1,18}(?:\.[0-9]{1,18})?(?:[eE][-+]?[0-9]{1,3})?)
    |(?P<text>"[^"\n]*"|'[^'\n]*')
    |(?P<sign>==|!=|<=|>=|&&|\|\||<>|[-<>()=!&|%])
    """,
    re.VERBOSE,
)
_UNIT = re.compile(r"[ \t]*(%|[A-Za-zµμ°]+(?:/[A-Za-z]+)?)")


class ConditionError(ValueError):
    """What is wrong, the column (from 1) in the text, and what is allowed."""

    def __init__(self, what: str, column: int, allowed: str = CONDITION) -> None:
        super().__init__(f"column {column}: {what}; allowed: {allowed}")
        self.what = what
        self.column = column
        self.allowed = allowed


@dataclass(frozen=True, slots=True)
class Name:
    """A signal, or with ``parameter`` a parameter by the maker's name or number."""

    name: str
    column: int = 0
    parameter: bool = False


@dataclass(frozen=True, slots=True)
class Number:
    """``unit`` as written, empty without one."""

    value: float
    unit: str = ""
    column: int = 0
    written: str = ""


@dataclass(frozen=True, slots=True)
class Text:
    """A text in quotes."""

    value: str
    column: int = 0


@dataclass(frozen=True, slots=True)
class Comparison:
    """``left sign right``."""

    sign: str
    left: Operand
    right: Operand
    column: int = 0


@dataclass(frozen=True, slots=True)
class Not:
    """The opposite."""

    inner: Tree


@dataclass(frozen=True, slots=True)
class Both:
    """All of them."""

    parts: tuple[Tree, ...]


@dataclass(frozen=True, slots=True)
class Either:
    """At least one of them."""

    parts: tuple[Tree, ...]


Operand: TypeAlias = "Name | Number | Text"
Tree: TypeAlias = "Name | Number | Text | Comparison | Not | Both | Either"


@dataclass(frozen=True, slots=True)
class _Token:
    kind: str
    text: str
    column: int
    unit: str = ""


def parse_condition(text: str) -> Tree:
    """The tree of a condition.  Raises :class:`ConditionError`, and nothing else."""
    if not text.strip():
        raise ConditionError("is empty", 1)
    if len(text) > MAX_LENGTH:
        raise ConditionError(f"has {len(text)} characters", 1, f"at most {MAX_LENGTH}")
    return _Parser(list(_tokens(text)), len(text)).whole()


def read_condition(value: object) -> str:
    """The text of a condition whose names are not known yet.  Raises :class:`Problem`."""
    if not isinstance(value, str):
        raise Problem(f"is {shown(value)}", CONDITION)
    try:
        parse_condition(value)
    except ConditionError as exc:
        raise Problem(f"column {exc.column}: {exc.what}", exc.allowed) from exc
    return value.strip()


def _tokens(text: str) -> Iterator[_Token]:
    place = 0
    while place < len(text):
        found = _TOKEN.match(text, place)
        if found is None:
            raise ConditionError(f"{shown(text[place])} is not understood here", place + 1)
        kind, word, column = str(found.lastgroup), found[0], place + 1
        place = found.end()
        if kind == "number":
            unit = ""
            behind = _UNIT.match(text, place)
            if behind is not None and behind[1] not in _WORDS:
                unit, place = behind[1], behind.end()
            if place < len(text) and (text[place].isalnum() or text[place] in "._"):
                raise ConditionError(f"{shown(word + text[place : place + 12])} is not a number", column)
            yield _Token(kind, word, column, unit)
        elif kind == "sign" and word in _INSTEAD:
            raise ConditionError(f"{word} is not used here", column, f"`{_INSTEAD[word]}`")
        elif kind == "name" and word in _WORDS:
            yield _Token(word, word, column)
        elif kind != "space":
            yield _Token(kind, word, column)


class _Parser:
    """Recursive descent; the depth is bounded by :data:`MAX_DEPTH`."""

    def __init__(self, tokens: list[_Token], length: int) -> None:
        self._tokens = tokens
        self._end = _Token("end", "", length + 1)
        self._place = 0
        self._operands = 0

    def whole(self) -> Tree:
        tree = self._either(0)
        if (left := self._next).kind != "end":
            raise ConditionError(f"{shown(left.text)} is too much here", left.column, "and, or, or the end")
        return tree

    @property
    def _next(self) -> _Token:
        return self._tokens[self._place] if self._place < len(self._tokens) else self._end

    def _take(self) -> _Token:
        token = self._next
        self._place += 1
        return token

    def _taken(self, kind: str, text: str = "") -> bool:
        token = self._next
        if token.kind != kind or (text and token.text != text):
            return False
        self._place += 1
        return True

    def _either(self, depth: int) -> Tree:
        parts = [self._both(depth)]
        while self._taken("or"):
            parts.append(self._both(depth))
        return parts[0] if len(parts) == 1 else Either(tuple(parts))

    def _both(self, depth: int) -> Tree:
        parts = [self._negation(depth)]
        while self._taken("and"):
            parts.append(self._negation(depth))
        return parts[0] if len(parts) == 1 else Both(tuple(parts))

    def _negation(self, depth: int) -> Tree:
        if depth > MAX_DEPTH:
            raise ConditionError("is nested too deeply", self._next.column, f"at most {MAX_DEPTH} levels")
        if self._taken("not"):
            return Not(self._negation(depth + 1))
        return self._comparison(depth)

    def _comparison(self, depth: int) -> Tree:
        left = self._operand(depth)
        sign = self._next
        if sign.kind != "sign" or sign.text not in COMPARISONS:
            return left
        self._take()
        right = self._operand(depth)
        behind = self._next
        if behind.kind == "sign" and behind.text in COMPARISONS:
            raise ConditionError("comparisons are not chained", behind.column, "`a < b and b < c`")
        for side in (left, right):
            if not isinstance(side, (Name, Number, Text)):
                raise ConditionError("a condition in parentheses is not compared", sign.column, "a name or a value")
        assert isinstance(left, (Name, Number, Text))
        assert isinstance(right, (Name, Number, Text))
        return Comparison(sign.text, left, right, sign.column)

    def _operand(self, depth: int) -> Tree:
        token = self._take()
        if token.kind == "sign" and token.text == "(":
            inner = self._either(depth + 1)
            if not self._taken("sign", ")"):
                raise ConditionError("the parenthesis is not closed", token.column, "`)`")
            return inner
        self._operands += 1
        if self._operands > MAX_OPERANDS:
            raise ConditionError("has too many names and values", token.column, f"at most {MAX_OPERANDS}")
        match token.kind:
            case "sign" if token.text == "-" and self._next.kind == "number":
                number = self._number(self._take())
                return Number(-number.value, number.unit, token.column, f"-{number.written}")
            case "number":
                return self._number(token)
            case "text":
                return Text(token.text[1:-1], token.column)
            case "name" if self._next.kind == "sign" and self._next.text == "(":
                return self._call(token)
            case "name" if token.text in {"true", "false"}:
                return Number(float(token.text == "true"), "", token.column, token.text)
            case "name":
                return Name(token.text, token.column)
            case "end":
                raise ConditionError("ends where a name or a value is needed", token.column)
            case _:
                raise ConditionError(f"{shown(token.text)} is where a name or a value is needed", token.column)

    @staticmethod
    def _number(token: _Token) -> Number:
        value = int(token.text, 16) if token.text[:2] in {"0x", "0X"} else float(token.text)
        return Number(float(value), token.unit, token.column, f"{token.text}{token.unit}")

    def _call(self, token: _Token) -> Name:
        if token.text != "param":
            raise ConditionError(f"{shown(token.text)} cannot be called", token.column, 'param("NAME")')
        self._take()
        argument = self._take()
        if argument.kind not in {"text", "name", "number"} or argument.unit or not self._taken("sign", ")"):
            raise ConditionError("param needs one name in quotes", token.column, 'such as param("DRV.OPMODE")')
        name = argument.text[1:-1] if argument.kind == "text" else argument.text
        return Name(name, token.column, parameter=True)


def _nodes(tree: Tree) -> Iterator[Tree]:
    """A tree and everything in it, in the order of the text."""
    yield tree
    match tree:
        case Comparison():
            yield from (tree.left, tree.right)
        case Not():
            yield from _nodes(tree.inner)
        case Both() | Either():
            for part in tree.parts:
                yield from _nodes(part)


def comparisons_in(tree: Tree) -> list[Comparison]:
    """Every comparison of a tree, in the order of the text."""
    return [node for node in _nodes(tree) if isinstance(node, Comparison)]


def names_in(tree: Tree) -> list[Name]:
    """Every name of a tree, in the order of the text."""
    return [node for node in _nodes(tree) if isinstance(node, Name)]


def evaluate(tree: Tree, value_of: Callable[[Operand], Value]) -> bool:
    """Whether the condition holds; ``value_of`` gives the value of a name, and of a number or text beside it."""
    match tree:
        case Comparison():
            return COMPARISONS[tree.sign](value_of(tree.left), value_of(tree.right))
        case Not():
            return not evaluate(tree.inner, value_of)
        case Both():
            return all(evaluate(part, value_of) for part in tree.parts)
        case Either():
            return any(evaluate(part, value_of) for part in tree.parts)
        case _:
            return bool(value_of(tree))


def text_of(tree: Tree) -> str:
    """The condition as text, which parses to the same tree."""
    match tree:
        case Name():
            return _param(tree.name) if tree.parameter else tree.name
        case Number():
            return tree.written
        case Text():
            quote = "'" if '"' in tree.value else '"'
            return f"{quote}{tree.value}{quote}"
        case Comparison():
            return f"{text_of(tree.left)} {tree.sign} {text_of(tree.right)}"
        case Not():
            return f"not {_inside(tree.inner)}"
        case Both():
            return " and ".join(map(_inside, tree.parts))
        case Either():
            return " or ".join(map(_inside, tree.parts))


def _param(name: str) -> str:
    quote = "'" if '"' in name else '"'
    return f"param({quote}{name}{quote})"


def _inside(tree: Tree) -> str:
    return f"({text_of(tree)})" if isinstance(tree, (Both, Either)) else text_of(tree)
