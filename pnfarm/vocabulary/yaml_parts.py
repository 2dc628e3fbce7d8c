"""Named values of a YAML text with their places: entries of mappings, and items of lists that have names."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pnfarm.vocabulary.yaml_lines import Node

__all__ = ["COMMENT", "Part", "in_flow_style", "line_start", "moved", "names_of", "next_line", "parts_of", "walk"]

#: Begins a line that is a comment.
COMMENT = re.compile(r"[ \t]*#")


@dataclass(frozen=True, slots=True)
class Part:
    """An entry of a mapping (``key``), or an item of a list of mappings with names, in its text.

    ``start`` is the character of its key or dash; ``flow``: what holds it is in flow style.
    """

    text: str
    key: Node | None
    value: Node
    start: int
    flow: bool

    @property
    def line(self) -> int:
        return (self.key or self.value).line

    @property
    def column(self) -> int:
        """Of its key or dash, from 0."""
        return self.start - line_start(self.text, self.start)

    @property
    def own(self) -> str:
        return self.text[self.start : self.value.end]

    @property
    def plain(self) -> Any:
        return self.value.plain()

    @property
    def parts(self) -> dict[str, Part]:
        """What it holds by name; nothing where its values have no names."""
        return parts_of(self.text, self.value)

    @property
    def above(self) -> int:
        """Where the comments begin that are in the lines right above it."""
        at = line_start(self.text, self.start)
        while at > 0 and COMMENT.match(self.text, before := line_start(self.text, at - 1)):
            at = before
        return at

    @property
    def comments(self) -> str:
        """The lines of comments right above it."""
        return self.text[self.above : line_start(self.text, self.start)]

    def inline(self) -> str:
        """In flow style."""
        key = "" if self.key is None else f"{self.text[self.key.start : self.key.end]}: "
        return key + in_flow_style(self.text, self.value)

    def block(self, column: int) -> str:
        """Its lines with the comments above it, its key or dash in this column."""
        if self.flow:
            return " " * column + ("- " if self.key is None else "") + self.inline()
        end = line_start(self.text, self.start)
        return moved(self.text[self.above : end] + " " * self.column + self.own, column - self.column)


def parts_of(text: str, node: Node) -> dict[str, Part]:
    """The entries of a mapping, or the items of a list in which each is a mapping with a name of its own."""
    flow = node.style == "{"
    if isinstance(node.content, dict):
        return {name: Part(text, key, value, key.start, flow) for name, (key, value) in node.content.items()}
    if not isinstance(node.content, list) or (names := names_of(node.plain())) is None:
        return {}
    starts = (one.start if flow else _dash(text, node, one) for one in node.content)
    found = zip(names, node.content, starts, strict=True)
    return {name: Part(text, None, one, start, flow) for name, one, start in found}


def names_of(values: list[Any]) -> list[str] | None:
    """Of a list in which each item has one of its own."""
    found = (one.get("name") if isinstance(one, dict) else None for one in values)
    names = [one for one in found if isinstance(one, str)]
    return names if len(set(names)) == len(values) else None


def _dash(text: str, holder: Node, item: Node) -> int:
    at = line_start(text, item.start)
    # a comment may be between the dash and the item
    while at > holder.start and text[at + holder.column - 1 : at + holder.column] != "-":
        at = line_start(text, at - 1)
    return max(at + holder.column - 1, holder.start)


def line_start(text: str, at: int) -> int:
    """Where the line of ``at`` begins."""
    return text.rfind("\n", 0, at) + 1


def next_line(text: str, at: int) -> int:
    """Where the line after that of ``at`` begins; the text's end, if there is none."""
    return text.find("\n", at) + 1 or len(text)


def in_flow_style(text: str, node: Node) -> str:
    """A value as it can be in braces and brackets; its scalars as they are."""
    if node.style != "{" and isinstance(node.content, dict):
        inside = (f"{text[key.start : key.end]}: {in_flow_style(text, value)}" for key, value in node.content.values())
        return "{" + ", ".join(inside) + "}"
    if node.style != "{" and isinstance(node.content, list):
        return "[" + ", ".join(in_flow_style(text, one) for one in node.content) + "]"
    return text[node.start : node.end]


def moved(text: str, columns: int, *, first: bool = True) -> str:
    """The lines further to the right, or to the left; the first only where ``first``."""
    begin, *rest = text.split("\n")

    def one(line: str) -> str:
        return " " * columns + line if columns >= 0 else line[:-columns].lstrip(" ") + line[-columns:]

    return "\n".join([one(begin) if first else begin, *(one(line) for line in rest)])


def walk(node: Node) -> list[Node]:
    """A value and all below it, in the text's order; what an alias stands for each time."""
    match node.content:
        case dict():
            below = [value for _, value in node.content.values()]
        case list():
            below = node.content
        case _:
            below = []
    return [node, *(inside for one in below for inside in walk(one))]
