"""Single values of a YAML text changed, added and removed; every other character stays as it is.

Changes are replacements of ranges of the text.  Beside them the values that the text is to have are kept: a text that
comes out with others is not returned.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from pnfarm.vocabulary.yaml_lines import Node, YamlError, parse_yaml
from pnfarm.vocabulary.yaml_parts import (
    COMMENT,
    Part,
    in_flow_style,
    line_start,
    moved,
    names_of,
    next_line,
    parts_of,
    walk,
)

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

__all__ = ["UneditableError", "YamlEditor"]


class UneditableError(Exception):
    """A value is written in a way that a change of characters could damage; ``line`` counts from 1, 0 is the whole."""

    def __init__(self, line: int, why: str) -> None:
        super().__init__(why)
        self.line = line
        self.why = why


class _Named(dict[str, Any]):
    """Items of a list by name; their order does not count."""


class YamlEditor:
    """Collects changes of one text; a change that is not safe raises :class:`UneditableError` and does nothing.

    Raises :class:`YamlError` for a text that is not YAML.
    """

    def __init__(self, text: str) -> None:
        self.text = text
        self.root = parse_yaml(text).root
        self._edits: list[tuple[int, int, str]] = []
        self._held: dict[int, Any] = {}
        self._parts: dict[int, dict[str, Part]] = {}
        self._expected = self._copied(self.root)

    def _copied(self, node: Node) -> Any:
        found: Any = node.content
        if isinstance(found, dict):
            found = {name: self._copied(value) for name, (_, value) in found.items()}
        elif isinstance(found, list):
            names = names_of(node.plain())
            values = [self._copied(one) for one in found]
            found = values if names is None else _Named(zip(names, values, strict=True))
        self._held[id(node)] = found
        return found

    def parts(self, holder: Node) -> dict[str, Part]:
        """What a mapping or list of the text holds by name, before the changes."""
        if id(holder) not in self._parts:
            self._parts[id(holder)] = parts_of(self.text, holder)
        return self._parts[id(holder)]

    def replace(self, holder: Node, name: str, new: Part, *, known: bool = False) -> None:
        """Give the value of ``new`` to the part of this name; ``known``: there are no comments of others in it."""
        old = self._part(holder, name)
        _judge(old, known=known)
        value = new.text[new.value.start : new.value.end]
        if old.flow:
            self._edit(old.value.start, old.value.end, in_flow_style(new.text, new.value))
        elif old.key is None or new.key is None:
            move = old.value.column - new.value.column
            self._edit(old.value.start, old.value.end, moved(value, move, first=False))
        elif "\n" not in value and not (old.value.style != "{" and isinstance(old.value.content, dict | list)):
            self._edit(old.value.start, old.value.end, in_flow_style(new.text, new.value))
        else:
            rest = new.text[new.key.end : new.value.end]
            self._edit(old.key.end, old.value.end, moved(rest, old.column - new.column, first=False))
        self._held[id(holder)][name] = _canonical(new.plain)

    def add(self, holder: Node, name: str, new: Part, after: str | None, *, first: bool = False) -> None:
        """Add a part after that of the name ``after``; without one at the end, or as the first."""
        there = self.parts(holder)
        if holder.shared:
            raise UneditableError(holder.line, "it is also elsewhere, or has values of elsewhere, by an anchor")
        begin, end = (next(iter(there.values())), list(there.values())[-1]) if there else (None, None)
        last = end if after is None else there[after]
        if holder.style == "{":
            self._add_inline(holder, new, begin, None if first else last)
        elif begin is None or last is None:
            raise UneditableError(holder.line, "it has no entries to be added to")
        elif first:
            self.add_lines(begin.above, new.block(begin.column))
        else:
            self.add_lines(self._below(last), new.block(begin.column))
        self._held[id(holder)][name] = _canonical(new.plain)

    def _add_inline(self, holder: Node, new: Part, begin: Part | None, after: Part | None) -> None:
        if after is not None:
            if after.value.start == after.value.end:
                raise UneditableError(after.line, "a value before it is empty")
            self._edit(after.value.end, after.value.end, f", {new.inline()}")
        else:
            at = holder.start + 1 if begin is None else begin.start
            self._edit(at, at, new.inline() + ("" if begin is None else ", "))

    def add_lines(self, at: int, lines: str) -> None:
        """Add lines that hold no values, or those of a part, where a line begins or the text ends."""
        newline = "\r\n" if "\r\n" in self.text else "\n"
        lines = lines.removesuffix("\r")
        self._edit(at, at, newline + lines if at and self.text[at - 1] != "\n" else lines + newline)

    def _below(self, part: Part) -> int:
        """Where the next line begins after a part and the comments that are further to the right than it."""
        at = next_line(self.text, part.start + len(part.own.rstrip()))
        while (found := COMMENT.match(self.text, at)) and found.end() - 1 - at > part.column:
            at = next_line(self.text, at)
        return at

    def remove(self, holder: Node, names: Collection[str], known: Collection[str] = ()) -> None:
        """Remove parts; ``known``: those in which there are no comments of others."""
        there = self.parts(holder)
        for name in names:
            _judge(self._part(holder, name), known=name in known)
        if holder.style == "{":
            for start, end in self._runs(holder, there, names):
                self._edit(start, end, "")
        else:
            for name in names:
                self._edit(*self._lines(there[name]), "")
        for name in names:
            del self._held[id(holder)][name]

    def _runs(self, holder: Node, there: Mapping[str, Part], names: Collection[str]) -> list[tuple[int, int]]:
        """What to remove of a collection in flow style, a comma with each part."""
        found: dict[int, int] = {}
        kept, start = None, None
        for name, part in there.items():
            if name not in names:
                if kept is None and start is not None:
                    found[start] = part.start
                kept, start = part, None
                continue
            if start is None:
                start = part.start if kept is None else kept.value.end
            # without one that stays before it, up to the next that does
            found |= {start: part.value.end} if kept is not None or name == list(there)[-1] else {}
        for begin, end in found.items():
            if {"#", "\n"} & set(self.text[begin:end]):
                raise UneditableError(holder.line, "it is in several lines in braces")
        return list(found.items())

    def _lines(self, part: Part) -> tuple[int, int]:
        """The lines of a part in block style; a comment after it stays."""
        begin = self._begin(part)
        end = part.start + len(part.own.rstrip())
        below = next_line(self.text, end)
        rest = self.text[end:below]
        return (begin, below) if not rest.strip() else (part.start, end + len(rest) - len(rest.lstrip()))

    def _begin(self, part: Part) -> int:
        """Where its first line begins."""
        begin = line_start(self.text, part.start)
        if self.text[begin : part.start].strip():
            raise UneditableError(part.line, "it is in the line of a dash")
        return begin

    def comment_out(self, holder: Node, name: str, why: str) -> None:
        """Make comments of a part's lines, with one more above them."""
        part = self._part(holder, name)
        if part.flow:
            raise UneditableError(part.line, "it is in a list in brackets")
        at = self._begin(part)
        self.add_lines(at, f"{' ' * part.column}# {why}")
        while at < part.start + len(part.own.rstrip()):
            line = self.text[at : next_line(self.text, at)]
            margin = min(part.column, len(line) - len(line.lstrip(" ")))
            if line.strip():
                self._edit(at + margin, at + margin, "# ")
            at += len(line)
        del self._held[id(holder)][name]

    def swap(self, old: str, new: str, low: int, high: int) -> bool:
        """Replace these whole lines of comments between two places of the text; whether they are there."""
        at = self.text.find(old, low, high)
        while at > 0 and self.text[at - 1] != "\n":
            at = self.text.find(old, at + 1, high)
        if at < 0:
            return False
        self._edit(at, at + len(old), new)
        return True

    def _part(self, holder: Node, name: str) -> Part:
        part = self.parts(holder)[name]
        if holder.shared or any(one.shared for one in walk(part.value)):
            raise UneditableError(part.line, "it is also elsewhere, or has values of elsewhere, by an anchor")
        return part

    def _edit(self, start: int, end: int, text: str) -> None:
        self._edits.append((start, end, text))

    def result(self) -> str:
        """The text with the changes.  Raises :class:`UneditableError` if that has other values than those wanted."""
        whole = UneditableError(0, "it is written in a way that its values cannot be changed one by one")
        made, at = [], 0
        for start, end, text in sorted(self._edits, key=lambda one: one[:2]):
            if start < at:
                raise whole
            made += [self.text[at:start], text]
            at = end
        text = "".join(made) + self.text[at:]
        try:
            found = parse_yaml(text).root.plain()
        except YamlError as error:
            raise whole from error
        if _listed(_canonical(found)) != _listed(self._expected):
            raise whole
        return text


def _judge(part: Part, *, known: bool) -> None:
    if part.value.style in {"|", ">"}:
        raise UneditableError(part.line, "it is a text of several lines")
    if part.value.start == part.value.end:
        raise UneditableError(part.line, "it is empty")
    if not known and "#" in part.own:
        raise UneditableError(part.line, "there are comments in it")


def _canonical(value: Any) -> Any:
    """Values in which lists of items with names are in no order."""
    if isinstance(value, dict):
        return {name: _canonical(one) for name, one in value.items()}
    if isinstance(value, list):
        names = names_of(value)
        values = [_canonical(one) for one in value]
        return values if names is None else _Named(zip(names, values, strict=True))
    return value


def _listed(value: Any) -> str:
    """As text, in which no two values are alike that are not; items by the names that they have now."""

    def plain(one: Any) -> Any:
        if isinstance(one, _Named):
            return ["named", {each["name"]: plain(each) for each in one.values()}] if one else []
        if isinstance(one, dict):
            return {name: plain(each) for name, each in one.items()}
        return [plain(each) for each in one] if isinstance(one, list) else one

    return json.dumps(plain(value), sort_keys=True)
