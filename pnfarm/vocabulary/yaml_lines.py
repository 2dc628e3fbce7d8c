"""YAML with positions: each value with its line and column.

A user's file is read as a stream of YAML events and built into :class:`Node` trees here, so that every
later error can name its line, and so that nothing in the file can cost more than its size:

* scalars follow the YAML 1.2 core schema: ``on`` and ``off`` are strings, ``10:20:30`` is not a number,
  ``2e4`` is one; keys are always text (``947.3`` stays ``947.3``);
* a duplicate key is an error, as YAML 1.2 clause 3.2.1.1 says;
* anchors, aliases and ``<<`` merges work, but the *expanded* document has a bound;
* nesting and file size have a bound; a second document and tags beyond the core schema are refused.
"""

from __future__ import annotations

import contextlib
import re
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NoReturn

import yaml

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["MAX_DEPTH", "MAX_OCTETS", "Document", "Node", "YamlError", "parse_yaml", "resolve"]

#: Longest file, octets: 4,094 drives written out one by one take about a third of it.
MAX_OCTETS = 1 << 20
#: Most values of a document after its aliases are followed.
MAX_NODES = 200_000
#: Deepest nesting.
MAX_DEPTH = 32
#: Longest key, characters.
MAX_KEY = 256

#: The parser of libyaml where PyYAML was built with it; the same events from the slower one otherwise.
_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

# YAML 1.2 clause 10.3.2, the core schema's tag resolution.
_NULL = frozenset(("", "~", "null", "Null", "NULL"))
_TRUE = frozenset(("true", "True", "TRUE"))
_FALSE = frozenset(("false", "False", "FALSE"))
_INT = re.compile(r"[-+]?[0-9]{1,40}")
_OCTAL = re.compile(r"0o[0-7]{1,40}")
_HEXADECIMAL = re.compile(r"0x[0-9a-fA-F]{1,40}")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]{1,5})?")
_SPECIAL = re.compile(r"([-+]?)\.(inf|Inf|INF|nan|NaN|NAN)")

#: A value with a place for a number, ``axis-{n:02}``, without quotes.
_BRACES = re.compile(
    r"""(?P<key>[\w-]+):[ ]+(?P<value>[^\s"',\[\]{}]*[{]n(?::[^\s"',\[\]{}]*)?[}][^\s"',\[\]{}]*)""", re.ASCII
)

_CORE_TAG = "tag:yaml.org,2002:"
_MERGE_KEY = "<<"


@dataclass(frozen=True, slots=True)
class YamlProblem:
    """One error in the text; line and column count from 1, 0 means the whole file."""

    line: int
    column: int
    field: str
    what: str
    allowed: str


class YamlError(Exception):
    """The text is not valid YAML; nothing can be read from it."""

    def __init__(self, problem: YamlProblem) -> None:
        super().__init__(problem.what)
        self.problem = problem


@dataclass(slots=True)
class Node:
    """A value with its place.

    ``content`` is a scalar, a ``list[Node]`` or a ``dict[str, tuple[Node, Node]]`` (key node, value node).
    ``size`` counts the values below it and itself, ``height`` the levels below it, aliases followed.
    ``start`` and ``end`` are its characters in the text; the end of a collection in block style is that of its last
    value.  ``style``: the scalar's quote, ``|`` or ``>``, ``{`` of a collection in flow style, else nothing.
    ``shared``: a change of it would be seen elsewhere, or it has values of elsewhere, by an anchor, alias or merge.
    """

    line: int
    column: int
    content: Any
    size: int = 1
    start: int = 0
    end: int = 0
    style: str = ""
    shared: bool = False
    height: int = 0

    def plain(self) -> Any:
        """The value without positions; aliases become separate copies."""
        if isinstance(self.content, dict):
            return {key: value.plain() for key, (_, value) in self.content.items()}
        if isinstance(self.content, list):
            return [item.plain() for item in self.content]
        return self.content


@dataclass(slots=True)
class Document:
    """A parsed file: its root, and the duplicate keys met on the way (the first of them was taken)."""

    root: Node
    problems: list[YamlProblem] = field(default_factory=list)

    def locate(self, path: tuple[str | int, ...]) -> tuple[int, int]:
        """Line and column of ``path``: of the key where there is one, else of the nearest parent that exists."""
        node, place = self.root, (self.root.line, self.root.column)
        for step in path:
            if isinstance(step, str) and isinstance(node.content, dict) and step in node.content:
                key, node = node.content[step]
                place = (key.line, key.column)
            elif isinstance(step, int) and isinstance(node.content, list) and 0 <= step < len(node.content):
                node = node.content[step]
                place = (node.line, node.column)
            else:
                break
        return place


def parse_yaml(data: bytes | str) -> Document:
    """Read one YAML document.  Raises :class:`YamlError`, and nothing else, when the text is not valid."""
    text = _decode(data)
    try:
        document = _Builder(text).build()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line, column = (mark.line + 1, mark.column + 1) if mark else (0, 0)
        _judge_own_bounds(text[: mark.index if mark else 0])
        _judge_braces(text, error)
        what = " ".join(part for part in (error.context, error.problem) if part)
        raise YamlError(YamlProblem(line, column, "", f"is not valid YAML here: {what}", "YAML 1.2")) from error
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1 if isinstance(error.position, int) else 0
        what = f"holds a character that YAML forbids: {error.reason}"
        raise YamlError(YamlProblem(line, 0, "", what, "printable UTF-8 text")) from error
    if document is None:
        raise YamlError(YamlProblem(0, 0, "", "is empty", "a mapping such as `farm: line-1` ..."))
    return document


def _judge_own_bounds(text: str) -> None:
    """Raise the error of a bound of this module that ``text``, all that stands before the parser's error, exceeds.

    The parser looks ahead, up to 1,024 characters of a line, and some of its versions have bounds of their own: it
    may give up before it has delivered what is already too much here.
    """
    with contextlib.suppress(yaml.YAMLError):
        _Builder(text).build()


def _judge_braces(text: str, error: yaml.MarkedYAMLError) -> None:
    """Raise an error that says so if what the parser refuses is a name with ``{n}`` that flow style wants in quotes."""
    marks = [mark for mark in (error.context_mark, error.problem_mark) if mark]
    lines = text.split("\n")
    for number in range(min(mark.line for mark in marks), max(mark.line for mark in marks) + 1) if marks else ():
        found = _BRACES.search(lines[number]) if number < len(lines) else None
        if found is not None:
            key, value = found["key"], found["value"]
            what = f"{value} has braces, which begin a mapping in flow style"
            allowed = f'quotes around it: {key}: "{value}"'
            raise YamlError(YamlProblem(number + 1, found.start() + 1, key, what, allowed)) from error


def _decode(data: bytes | str) -> str:
    if len(data) > MAX_OCTETS:
        raise YamlError(YamlProblem(0, 0, "", "is too large for a farm file", f"at most {MAX_OCTETS} octets"))
    if isinstance(data, str):
        text = data.removeprefix("\ufeff")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            line = data.count(b"\n", 0, error.start) + 1
            what = f"is not UTF-8 text: octet 0x{data[error.start]:02x} at offset {error.start}"
            raise YamlError(YamlProblem(line, 0, "", what, "UTF-8")) from error
    # libyaml would stop silently at the first of these
    nul = text.find("\0")
    if nul >= 0:
        line = text.count("\n", 0, nul) + 1
        raise YamlError(YamlProblem(line, 0, "", "holds a NUL character", "printable UTF-8 text"))
    surrogate = re.search("[\ud800-\udfff]", text)
    if surrogate:
        line = text.count("\n", 0, surrogate.start()) + 1
        raise YamlError(YamlProblem(line, 0, "", "holds half a surrogate pair", "printable UTF-8 text"))
    return text


class _Builder:
    """Builds nodes from events; recursion is bounded by :data:`MAX_DEPTH`."""

    def __init__(self, text: str) -> None:
        self.events: Iterator[Any] = yaml.parse(text, Loader=_LOADER)
        self.anchors: dict[str, Node | None] = {}
        self.problems: list[YamlProblem] = []
        self.nodes = 0

    def build(self) -> Document | None:
        """The document; None if there is none.  Raises :class:`YamlError`, and the parser's ``yaml.YAMLError``."""
        root: Node | None = None
        for event in self.events:
            if isinstance(event, yaml.DocumentStartEvent):
                if root is not None:
                    self._refuse(event, "starts a second document", "one document per file")
                root = self._node(next(self.events), 0, "")
        if root is None or root.content is None:
            return None
        return Document(root, self.problems)

    def _node(self, event: Any, depth: int, path: str) -> Node:
        if depth > MAX_DEPTH:
            self._refuse(event, "is nested too deeply", f"at most {MAX_DEPTH} levels")
        if isinstance(event, yaml.AliasEvent):
            return self._alias(event, depth, path)
        node = _node_at(event, None)
        if event.anchor is not None:
            # known but unfinished: an alias to it from inside would be a loop
            self.anchors[event.anchor] = None
        if isinstance(event, yaml.ScalarEvent):
            node.content = self._scalar(event, path)
            node.style = event.style or ""
        elif isinstance(event, yaml.SequenceStartEvent):
            self._sequence(event, node, depth, path)
        else:
            self._mapping(event, node, depth, path)
        self._count(event, 1)
        if event.anchor is not None:
            node.shared = True
            self.anchors[event.anchor] = node
        return node

    def _alias(self, event: Any, depth: int, path: str) -> Node:
        if event.anchor not in self.anchors:
            self._refuse(event, f"refers to *{event.anchor}, which no anchor defines", "an anchor above", path)
        target = self.anchors[event.anchor]
        if target is None:
            self._refuse(event, f"*{event.anchor} contains itself", "an anchor that is complete", path)
        if depth + target.height > MAX_DEPTH:
            what = "is nested too deeply once its aliases are followed"
            self._refuse(event, what, f"at most {MAX_DEPTH} levels", path)
        self._count(event, target.size)
        return replace(_node_at(event, target.content, target.size), shared=True, height=target.height)

    def _count(self, event: Any, size: int) -> None:
        self.nodes += size
        if self.nodes > MAX_NODES:
            self._refuse(event, "holds too many values once its aliases are followed", f"at most {MAX_NODES}")

    def _sequence(self, event: Any, node: Node, depth: int, path: str) -> None:
        self._check_tag(event, "seq", path)
        items: list[Node] = []
        while not isinstance(item := next(self.events), yaml.SequenceEndEvent):
            items.append(self._node(item, depth + 1, f"{path}[{len(items)}]"))
            node.end = items[-1].end
        if event.flow_style:
            node.style, node.end = "{", _end(item)
        node.content = items
        self._measure(node, items)

    def _mapping(self, event: Any, node: Node, depth: int, path: str) -> None:
        self._check_tag(event, "map", path)
        entries: dict[str, tuple[Node, Node]] = {}
        merged: list[Node] = []
        while not isinstance(key := next(self.events), yaml.MappingEndEvent):
            if not isinstance(key, yaml.ScalarEvent):
                self._refuse(key, "has a key that is not a word", "keys are words", path)
            name = key.value
            if len(name) > MAX_KEY:
                self._refuse(key, "has a key that is too long", f"at most {MAX_KEY} characters", path)
            place = _node_at(key, name)
            child = f"{path}.{name}" if path else name
            value = self._node(next(self.events), depth + 1, child)
            node.end = value.end
            if name == _MERGE_KEY and key.implicit[0]:
                node.shared = True
                merged += self._merge_sources(key, value, path)
            elif name in entries:
                what = f"is given twice; it is already in line {entries[name][0].line}"
                self.problems.append(YamlProblem(place.line, place.column, child, what, "each key once"))
            else:
                entries[name] = (place, value)
        if event.flow_style:
            node.style, node.end = "{", _end(key)
        # YAML's merge key type: a key of the mapping itself wins, then the earlier source
        for source in merged:
            for name, entry in source.content.items():
                entries.setdefault(name, entry)
        node.content = entries
        self._measure(node, [value for _, value in entries.values()])

    @staticmethod
    def _measure(node: Node, inside: list[Node]) -> None:
        node.size += sum(one.size for one in inside)
        node.height = 1 + max((one.height for one in inside), default=-1)

    def _merge_sources(self, event: Any, value: Node, path: str) -> list[Node]:
        sources = value.content if isinstance(value.content, list) else [value]
        for source in sources:
            if not isinstance(source.content, dict):
                self._refuse(event, "<< merges something that is not a mapping", "a mapping, or a list of them", path)
            self._count(event, source.size)
        return sources

    def _scalar(self, event: Any, path: str) -> Any:
        tag, text = event.tag, event.value
        if "\0" in text:
            # in double quotes it can be written; no file, name or number has it
            self._refuse(event, "holds a NUL character", "printable text", path)
        if event.implicit[0] and tag is None:
            return resolve(text)
        if tag is None or tag in {"!", _CORE_TAG + "str"}:
            return text
        value = resolve(text)
        if tag == _CORE_TAG + "float" and type(value) is int:
            return float(value)
        names = {"int": int, "float": float, "bool": bool, "null": type(None)}
        if names.get(tag.removeprefix(_CORE_TAG)) is type(value):
            return value
        return self._refuse(event, f"has a tag that does not fit or is not known here: {tag}", "plain values", path)

    def _check_tag(self, event: Any, name: str, path: str) -> None:
        if event.tag not in {None, "!", _CORE_TAG + name}:
            self._refuse(event, f"has a tag that is not known here: {event.tag}", "plain values", path)

    @staticmethod
    def _refuse(event: Any, what: str, allowed: str, path: str = "") -> NoReturn:
        mark = event.start_mark
        raise YamlError(YamlProblem(mark.line + 1, mark.column + 1, path, what, allowed))


def _node_at(event: Any, content: Any, size: int = 1) -> Node:
    begin = event.start_mark
    return Node(begin.line + 1, begin.column + 1, content, size, begin.index, _end(event))


def _end(event: Any) -> int:
    return int(event.end_mark.index)


def resolve(text: str) -> Any:
    """A plain scalar's value in the core schema; a text is itself."""
    if text in _NULL:
        return None
    if text in _TRUE:
        return True
    if text in _FALSE:
        return False
    if _INT.fullmatch(text):
        return int(text)
    if _OCTAL.fullmatch(text) or _HEXADECIMAL.fullmatch(text):
        return int(text, 0)
    if _FLOAT.fullmatch(text):
        return float(text)
    special = _SPECIAL.fullmatch(text)
    if special and (special[2].lower() == "inf" or not special[1]):
        return float(special[1] + special[2])
    return text
