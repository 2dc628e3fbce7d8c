"""Electronic data sheets as text: sections, entries, fields (CIP volume 1, chapter 7-3).

::

    $ a comment goes to the end of the line
    [Section Name]
            Keyword = field, "a string " "in two parts", {a, group}, ;

This module knows no section: whatever a file holds is kept in its order, and written again.  Comments are not kept.
What sections and entries mean is their reader's.
"""

from __future__ import annotations

import re
from codecs import BOM_UTF8
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from pnfarm.errors import DecodeError
from pnfarm.vocabulary.quoting import shown

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

__all__ = [
    "LONGEST",
    "Eds",
    "EdsEntry",
    "EdsField",
    "EdsGroup",
    "EdsSection",
    "EdsString",
    "emit_eds",
    "parse_eds",
    "whole",
]

#: Files of makers have some hundred kB.
LONGEST: Final = 8 * 1024 * 1024
_DEEPEST: Final = 8
_MOST_SECTIONS, _MOST_ENTRIES, _MOST_FIELDS = 1_000, 100_000, 20_000
_WHOLE: Final = re.compile(r"([+-]?)(?:0[xX]([0-9A-Fa-f]{1,16})|([0-9]{1,20}))")
_TOKEN: Final = re.compile(
    r"(?P<space>[\s\x00\x1a]+)"
    r"|(?P<comment>\$[^\r\n]*)"
    r'|(?P<string>"(?:[^"\\]|\\.)*")'
    r"|(?P<section>\[[^\[\]\r\n]*\])"
    r"|(?P<mark>[=,;{}])"
    r"|(?P<word>[^\s$\"\[\]=,;{}\x00\x1a]+)",
    re.DOTALL,
)
_ESCAPES: Final = {"n": "\n", "t": "\t", "r": "\r", "v": "\v", "\\": "\\", '"': '"', "'": "'"}
_LINE: Final = 100


@dataclass(frozen=True, slots=True)
class EdsString:
    """Text that stood between quotation marks."""

    value: str


@dataclass(frozen=True, slots=True)
class EdsGroup:
    """Fields between braces."""

    fields: tuple[EdsField, ...]


#: A number, a date, a name or nothing as it stood; a string; a group.
EdsField = str | EdsString | EdsGroup


def whole(text: str) -> int | None:
    """A decimal or hexadecimal number; None for anything else."""
    found = _WHOLE.fullmatch(text.strip())
    if found is None:
        return None
    sign, hexadecimal, decimal = found.groups()
    number = int(hexadecimal, 16) if hexadecimal else int(decimal)
    return -number if sign == "-" else number


@dataclass(frozen=True, slots=True)
class EdsEntry:
    """``line`` is that of its keyword, 0 where it was not read."""

    keyword: str
    fields: tuple[EdsField, ...]
    line: int = field(default=0, compare=False)

    def text(self, place: int) -> str:
        """A field as plain text, empty for one that is not there."""
        found = self.fields[place] if place < len(self.fields) else ""
        return found.value if isinstance(found, EdsString) else found if isinstance(found, str) else ""

    def number(self, place: int) -> int | None:
        """A field as an integer, decimal or hexadecimal; None for an empty one and for what is no number."""
        return whole(self.text(place))


@dataclass(frozen=True, slots=True)
class EdsSection:
    name: str
    entries: tuple[EdsEntry, ...]

    def entry(self, keyword: str) -> EdsEntry | None:
        """The first entry of this name; keywords have no case."""
        wanted = keyword.casefold()
        return next((entry for entry in self.entries if entry.keyword.casefold() == wanted), None)


@dataclass(frozen=True, slots=True)
class Eds:
    sections: tuple[EdsSection, ...]

    def section(self, name: str) -> EdsSection | None:
        """The first section of this name; names have no case."""
        wanted = name.casefold()
        return next((section for section in self.sections if section.name.casefold() == wanted), None)


# Parse


class _Tokens:
    """Tokens with one to look at; ``kind`` is empty at the end."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._found = self._all()
        #: A place, and its line: the next one that is asked for is after it.
        self._counted = (0, 1)
        self.kind, self.value, self.place = "", "", 0
        self.next()

    def _all(self) -> Iterator[tuple[str, str, int]]:
        place = 0
        while place < len(self._text):
            match = _TOKEN.match(self._text, place)
            if match is None:
                raise DecodeError("bad-text", f"line {self.line(place)} cannot be read")
            if match.lastgroup not in {"space", "comment"}:
                yield str(match.lastgroup), match[0], place
            place = match.end()

    def next(self) -> None:
        self.kind, self.value, self.place = next(self._found, ("", "", len(self._text)))

    def line(self, place: int) -> int:
        before, line = self._counted
        if place < before:
            return self._text.count("\n", 0, place) + 1
        self._counted = place, line + self._text.count("\n", before, place)
        return self._counted[1]

    def take(self, value: str) -> bool:
        """Whether the next token is this mark; it is passed then."""
        if self.kind != "mark" or self.value != value:
            return False
        self.next()
        return True

    def refuse(self, wanted: str) -> DecodeError:
        return DecodeError("bad-entry", f"line {self.line(self.place)}: {wanted} is missing before {shown(self.value)}")


def parse_eds(data: bytes) -> Eds:
    """A whole file, ISO 8859-1, or UTF-8 with its mark.

    Raises ``long``, ``bad-text``, ``bad-section``, ``bad-entry``, with the line.
    """
    if len(data) > LONGEST:
        raise DecodeError("long", f"{len(data)} octets")
    marked = data.startswith(BOM_UTF8)
    tokens = _Tokens(data.decode("utf-8-sig", "replace") if marked else data.decode("latin-1"))
    sections: list[EdsSection] = []
    while tokens.kind:
        if tokens.kind != "section":
            raise DecodeError(
                "bad-section", f"line {tokens.line(tokens.place)}: no section before {shown(tokens.value)}"
            )
        name = tokens.value[1:-1].strip()
        tokens.next()
        entries = []
        while tokens.kind == "word":
            entries.append(_entry(tokens))
            if len(entries) > _MOST_ENTRIES:
                raise DecodeError("long", f"line {entries[-1].line}: more than {_MOST_ENTRIES} entries in a section")
        if len(sections) >= _MOST_SECTIONS:
            raise DecodeError("long", f"line {tokens.line(tokens.place)}: more than {_MOST_SECTIONS} sections")
        sections.append(EdsSection(name, tuple(entries)))
    return Eds(tuple(sections))


def _entry(tokens: _Tokens) -> EdsEntry:
    keyword, line = tokens.value, tokens.line(tokens.place)
    tokens.next()
    if not tokens.take("="):
        raise tokens.refuse("=")
    fields = _fields(tokens, ";", 0)
    return EdsEntry(keyword, fields, line)


def _fields(tokens: _Tokens, end: str, depth: int) -> tuple[EdsField, ...]:
    """Fields up to their end, which is passed; nothing between the start and the end is one empty field."""
    if depth > _DEEPEST:
        raise DecodeError("bad-entry", f"line {tokens.line(tokens.place)}: braces are nested too deep")
    fields: list[EdsField] = []
    while True:
        fields.append(_field(tokens, depth))
        if len(fields) > _MOST_FIELDS:
            raise DecodeError("long", f"line {tokens.line(tokens.place)}: more than {_MOST_FIELDS} fields in an entry")
        if tokens.take(end):
            return tuple(fields)
        if not tokens.take(","):
            raise tokens.refuse(f", or {end}")


def _field(tokens: _Tokens, depth: int) -> EdsField:
    if tokens.take("{"):
        return EdsGroup(_fields(tokens, "}", depth + 1))
    if tokens.kind == "string":
        parts = []
        while tokens.kind == "string":
            parts.append(_unescaped(tokens.value[1:-1]))
            tokens.next()
        return EdsString("".join(parts))
    words = []
    while tokens.kind == "word":
        words.append(tokens.value)
        tokens.next()
    return " ".join(words)


def _unescaped(text: str) -> str:
    return re.sub(r"\\(.)", lambda match: _ESCAPES.get(match[1], match[0]), text, flags=re.DOTALL)


# Emit


def emit_eds(eds: Eds, comments: Iterable[str] = ()) -> bytes:
    """A file with lines that end as on Windows, and ``comments`` above; names and words are written as they are."""
    lines = [f"$ {line}".rstrip() for comment in comments for line in comment.splitlines() or [""]]
    for section in eds.sections:
        lines += ["", f"[{section.name}]"] if lines else [f"[{section.name}]"]
        for entry in section.entries:
            parts = [_text(field) for field in entry.fields]
            one = f"        {entry.keyword} = {', '.join(parts)};"
            if len(one) <= _LINE:
                lines.append(one)
            else:
                lines.append(f"        {entry.keyword} =")
                lines += [f"                {part}," for part in parts[:-1]]
                lines.append(f"                {parts[-1]};")
    return ("\r\n".join(lines) + "\r\n").encode("latin-1", "replace")


def _text(field: EdsField) -> str:
    match field:
        case EdsString(value):
            escaped = value.replace("\\", "\\\\").replace('"', '\\"')
            for letter, character in (("n", "\n"), ("t", "\t"), ("r", "\r"), ("v", "\v")):
                escaped = escaped.replace(character, f"\\{letter}")
            return f'"{escaped}"'
        case EdsGroup(fields):
            return "{" + ", ".join(map(_text, fields)) + "}"
        case _:
            return field
