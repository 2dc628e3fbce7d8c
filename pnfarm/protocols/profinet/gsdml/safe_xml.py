"""XML as far as GSDML needs it, from an untrusted file.

The parser is expat with every document type refused: without one there are no entities, so nothing expands and
nothing is fetched.  Octets, elements, depth and attributes are bounded.  GSDML says everything in attributes, so
character data is not kept.  Names are without their namespace: makers use several prefixes.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NoReturn
from xml.parsers import expat

from pnfarm.errors import DecodeError

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["MAX_OCTETS", "Node", "parse_xml", "quoted"]

#: Largest file; the largest of makers have some 5 MiB.
MAX_OCTETS = 16 << 20
MAX_ELEMENTS = 400_000
MAX_DEPTH = 40
MAX_ATTRIBUTES = 200


@dataclass(slots=True)
class Node:
    """An element: its name, its attributes, its children, and the line where it starts."""

    name: str
    line: int
    attributes: dict[str, str] = field(default_factory=dict)
    children: list[Node] = field(default_factory=list)

    def fail(self, attribute: str, allowed: str) -> NoReturn:
        """Raise :class:`DecodeError` with line, element and attribute, and what is allowed there."""
        self.refuse(attribute, f"allowed is {allowed}")

    def refuse(self, attribute: str, why: str) -> NoReturn:
        """The same with any other reason."""
        value = self.attributes.get(attribute)
        what = "is missing" if value is None else f"is {_shown(value)}"
        raise DecodeError("bad-value", f"line {self.line}: {self.name}/@{attribute} {what}, {why}")

    # children

    def child(self, *path: str) -> Node | None:
        """The first element along ``path``."""
        found: Node | None = self
        for name in path:
            found = next((c for c in found.children if c.name == name), None) if found else None
        return found

    def need(self, *path: str) -> Node:
        """The same; :class:`DecodeError` when it is missing."""
        node = self
        for name in path:
            found = node.child(name)
            if found is None:
                raise DecodeError(
                    "missing-element", f"line {node.line}: {node.name} has no {name}, a GSDML file needs one there"
                )
            node = found
        return node

    def all(self, *path: str) -> list[Node]:
        """All elements of the last name in the first element along the rest of ``path``."""
        parent = self.child(*path[:-1])
        return [c for c in parent.children if c.name == path[-1]] if parent else []

    def text(self, attribute: str) -> str:
        return self.attributes.get(attribute, "")


def _shown(value: str) -> str:
    return repr(value if len(value) <= 60 else f"{value[:57]}...")


class _Builder:
    def __init__(self) -> None:
        self.root: Node | None = None
        self._open: list[Node] = []
        self._count = 0
        self.parser = expat.ParserCreate(namespace_separator=" ")
        self.parser.StartDoctypeDeclHandler = self._doctype
        self.parser.EntityDeclHandler = self._doctype
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end

    def _doctype(self, name: str, *_: object) -> NoReturn:
        what = "a document type is declared, GSDML files have none"
        if name.lower() == "html":
            what = "the file is a web page, perhaps the one that offers the GSDML file"
        raise DecodeError("doctype", f"line {self.parser.CurrentLineNumber}: {what}")

    def _start(self, name: str, attributes: Mapping[str, str]) -> None:
        line = self.parser.CurrentLineNumber
        self._count += 1
        if self._count > MAX_ELEMENTS:
            raise DecodeError("too-large", f"line {line}: more than {MAX_ELEMENTS} elements")
        if len(self._open) >= MAX_DEPTH:
            raise DecodeError("too-deep", f"line {line}: elements are nested more than {MAX_DEPTH} deep")
        if len(attributes) > MAX_ATTRIBUTES:
            raise DecodeError("too-large", f"line {line}: more than {MAX_ATTRIBUTES} attributes")
        node = Node(_local(name), line, {_local(key): value for key, value in attributes.items()})
        if self._open:
            self._open[-1].children.append(node)
        else:
            self.root = node
        self._open.append(node)

    def _end(self, _: str) -> None:
        self._open.pop()


def _local(name: str) -> str:
    return name.rpartition(" ")[2]


def parse_xml(data: bytes) -> Node:
    """The root element.  Raises :class:`DecodeError` for anything that is not well-formed, or beyond the bounds."""
    if len(data) > MAX_OCTETS:
        raise DecodeError("too-large", f"{len(data)} octets, at most {MAX_OCTETS} are read")
    builder = _Builder()
    try:
        builder.parser.Parse(data, True)
    except expat.ExpatError as exc:
        text = expat.ErrorString(exc.code) or "unknown error"
        raise DecodeError("not-xml", f"line {exc.lineno}: {text}, allowed is well-formed XML") from exc
    except (LookupError, ValueError) as exc:
        raise DecodeError("encoding", f"{exc}, allowed is an encoding such as utf-8 or iso-8859-1") from exc
    if builder.root is None:
        raise DecodeError("not-xml", "the file has no element")
    return builder.root


_ESCAPES = str.maketrans(
    {"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;", "\t": "&#9;", "\n": "&#10;", "\r": "&#13;"}
)


def quoted(value: str) -> str:
    """An attribute's value, escaped and in quotation marks."""
    return f'"{value.translate(_ESCAPES)}"'
