"""GSD files of any maker as text: statements and blocks in their order (GSD specification 5.1; IEC 61158, EN 50170).

::

    ; a comment goes to the end of the line
    #Profibus_DP
    Ident_Number = 0x0A8E
    Ext_User_Prm_Data_Const(0) = 0x80,0x00,\\
                                 0x00
    Module = "a name" 0xC3,0xC1
    1
    EndModule

Keywords have no case.  Makers' files break the rules here and there, so that what cannot be read is left out with a
:class:`GsdWarning`; only what is no GSD file at all is refused.  What statements mean is

:mod:`pnfarm.protocols.profibus.gsd.reader`'s.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from pnfarm.errors import DecodeError

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = [
    "BLOCKS", "INTERVAL_NS", "LONGEST", "RATES", "GsdBlock", "GsdEntry", "GsdFile", "GsdWarning", "Warnings",
    "gsd_number", "parse_gsd",
]  # fmt: skip

#: Files of makers have some hundred kB.
LONGEST: Final = 8 * 1024 * 1024
#: Warnings that are kept; the last one says that there are more.
MOST_WARNINGS: Final = 200
_DEEPEST: Final = 4
#: The keyword that begins a block -> the one that ends it, both without case.
BLOCKS: Final = {
    "prmtext": "endprmtext",
    "extuserprmdata": "endextuserprmdata",
    "unitdiagtype": "endunitdiagtype",
    "unit_diag_area": "unit_diag_area_end",
    "x_unit_diag_area": "x_unit_diag_area_end",
    "module": "endmodule",
    "slotdefinition": "endslotdefinition",
    "physical_interface": "end_physical_interface",
    "data_area_beg": "data_area_end",
    "version_firmware_download": "end_version_firmware_download",
}
#: Baud rate -> how the keywords name it.
RATES: Final = {
    9_600: "9.6",
    19_200: "19.2",
    31_250: "31.25",
    45_450: "45.45",
    93_750: "93.75",
    187_500: "187.5",
    500_000: "500",
    1_500_000: "1.5M",
    3_000_000: "3M",
    6_000_000: "6M",
    12_000_000: "12M",
}
#: Unit of Min_Slave_Intervall.
INTERVAL_NS: Final = 100_000
_ENDS: Final = frozenset(BLOCKS.values())
#: Blocks whose statements may lack the equals sign: ``Unsigned8 0 0-3``, and the Module_Reference.
_BARE: Final = frozenset({"extuserprmdata", "module"})
_STATEMENT: Final = re.compile(
    r"(?P<key>[\w.!]+)\s*(?:\((?P<argument>[^()]*)\))?\s*(?P<equals>=?)\s*(?P<value>.*)", re.DOTALL
)
_NUMBER: Final = re.compile(r"[+-]?(?:0[xX][0-9A-Fa-f]{1,16}|[0-9]{1,20})")
_STRING: Final = re.compile(r'"([^"]*)"')


def gsd_number(text: str) -> int | None:
    """A decimal or hexadecimal (0x) number; None for anything else.  A leading zero changes nothing."""
    text = text.strip()
    if _NUMBER.fullmatch(text) is None:
        return None
    return int(text, 16 if "x" in text.lower() else 10)


@dataclass(frozen=True, slots=True)
class GsdWarning:
    """What was left out, or is odd, at a line of the file (from 1)."""

    line: int
    text: str


@dataclass(frozen=True, slots=True)
class GsdEntry:
    """``key(argument) = value``; the key as it stands, the value without comments and joined where it was continued."""

    line: int
    key: str
    argument: str
    value: str

    def text(self) -> str:
        """What stands between quotation marks, else all of it."""
        found = _STRING.search(self.value)
        return (self.value if found is None else found[1]).strip()

    def number(self) -> int | None:
        return gsd_number(self.value)

    def numbers(self) -> tuple[int, ...] | None:
        """Numbers with commas between them, after a name in quotation marks if there is one; None for other text."""
        text = _STRING.sub("", self.value, count=1).strip().rstrip(",")
        if not text:
            return ()
        found = tuple(gsd_number(one) for one in text.split(","))
        numbers = tuple(one for one in found if one is not None)
        return numbers if len(numbers) == len(found) else None

    def octets(self) -> bytes | None:
        """:meth:`numbers` as octets; None if one does not fit."""
        numbers = self.numbers()
        return bytes(numbers) if numbers is not None and all(0 <= one <= 0xFF for one in numbers) else None


@dataclass(frozen=True, slots=True)
class GsdBlock:
    """A block with what stands at its beginning; ``parts`` are its statements and blocks within it."""

    head: GsdEntry
    parts: tuple[GsdEntry | GsdBlock, ...]

    @property
    def kind(self) -> str:
        """A key of :data:`BLOCKS`."""
        return self.head.key.casefold()

    def entries(self, key: str) -> list[GsdEntry]:
        """All statements with this keyword."""
        return _entries(self.parts, key)

    def entry(self, key: str) -> GsdEntry | None:
        """The first of them."""
        return next(iter(self.entries(key)), None)


@dataclass(frozen=True, slots=True)
class GsdFile:
    """The part after ``#Profibus_DP``."""

    parts: tuple[GsdEntry | GsdBlock, ...]
    warnings: tuple[GsdWarning, ...] = field(default=(), compare=False)

    def blocks(self, kind: str) -> list[GsdBlock]:
        """All blocks of this kind (:data:`BLOCKS`)."""
        return [part for part in self.parts if isinstance(part, GsdBlock) and part.kind == kind]

    def entries(self, key: str) -> list[GsdEntry]:
        """All statements with this keyword outside of blocks."""
        return _entries(self.parts, key)

    def entry(self, key: str) -> GsdEntry | None:
        """The first of them."""
        return next(iter(self.entries(key)), None)


def _entries(parts: tuple[GsdEntry | GsdBlock, ...], key: str) -> list[GsdEntry]:
    wanted = key.casefold()
    return [part for part in parts if isinstance(part, GsdEntry) and part.key.casefold() == wanted]


# Parse


class Warnings:
    """What is odd in a file, up to :data:`MOST_WARNINGS`."""

    def __init__(self, before: tuple[GsdWarning, ...] = ()) -> None:
        self._all = list(before)

    def add(self, line: int, text: str) -> None:
        if len(self._all) < MOST_WARNINGS:
            self._all.append(GsdWarning(line, text))
        elif len(self._all) == MOST_WARNINGS:
            self._all.append(GsdWarning(line, "more warnings are not listed"))

    def all(self) -> tuple[GsdWarning, ...]:
        return tuple(self._all)


#: Letters with umlauts of code page 850, with which tools under DOS wrote; code page 1252 has signs there, or nothing.
_DOS_LETTERS: Final = frozenset(b"\x81\x84\x8e\x94\x99\x9a\xe1")


def _decoded(data: bytes) -> str:
    """UTF-16 with its mark, UTF-8 where it is that, code page 850 where all that is not ASCII is a letter of it.

    Else code page 1252, whose few holes are read as ISO 8859-1.
    """
    if data[:2] in {b"\xff\xfe", b"\xfe\xff"}:
        return data.decode("utf-16", "replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        pass
    if {octet for octet in data if octet > 0x7F} <= _DOS_LETTERS:
        return data.decode("cp850")
    try:
        return data.decode("cp1252")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _without_comment(text: str) -> str:
    """Up to the semicolon that is not between quotation marks; an odd mark does not hide a comment."""
    if ";" not in text:
        return text.strip()
    parts = text.split('"')
    for place in range(0, len(parts), 2):
        before, semicolon, _ = parts[place].partition(";")
        if semicolon:
            return '"'.join([*parts[:place], before]).strip()
    if len(parts) % 2 == 0:
        return text.rpartition(";")[0].strip()
    return text.strip()


def _joined(text: str) -> Iterator[tuple[int, str]]:
    """Lines with a number, comments removed, continuations joined, empty ones left out."""
    parts: list[str] = []
    first = 0
    for number, raw in enumerate(re.split(r"\r\n|\n|\r", text), start=1):
        line = _without_comment(raw.replace("\0", " ").replace("\x1a", " "))
        if not parts:
            first = number
        if line.endswith("\\"):
            parts.append(line[:-1])
            continue
        parts.append(line)
        whole = "".join(parts).strip()
        parts = []
        if whole:
            yield first, whole
    if whole := "".join(parts).strip():
        yield first, whole


def parse_gsd(data: bytes) -> GsdFile:
    """A whole file.  Raises :class:`DecodeError` with ``long``, or ``no-gsd`` where no line is ``#Profibus_DP``."""
    if len(data) > LONGEST:
        raise DecodeError("long", f"{len(data)} octets")
    warnings = Warnings()
    lines = _joined(_decoded(data))
    begun = False
    for number, text in lines:
        if text.casefold() == "#profibus_dp":
            begun = True
            break
        if not text.startswith("#"):
            warnings.add(number, "text before #Profibus_DP is left out")
    if not begun:
        raise DecodeError("no-gsd", "no line is #Profibus_DP")
    return GsdFile(_parts(lines, warnings), warnings.all())


def _parts(lines: Iterator[tuple[int, str]], warnings: Warnings) -> tuple[GsdEntry | GsdBlock, ...]:
    """Everything up to the next section of the file."""
    top: list[GsdEntry | GsdBlock] = []
    #: Open blocks, the innermost last.
    heads: list[GsdEntry] = []
    bodies = [top]

    def close() -> None:
        head, body = heads.pop(), bodies.pop()
        bodies[-1].append(GsdBlock(head, tuple(body)))

    for number, text in lines:
        if text.startswith("#"):
            warnings.add(number, f"the section {text[:40]} and what follows are left out")
            break
        entry = _entry(number, text)
        if entry is None:
            warnings.add(number, f"{text[:60]!r} is no statement")
            continue
        key = entry.key.casefold()
        inside = heads[-1].key.casefold() if heads else ""
        if key in _ENDS:
            if key not in {BLOCKS[head.key.casefold()] for head in heads}:
                warnings.add(number, f"{entry.key} ends nothing")
                continue
            while BLOCKS[heads[-1].key.casefold()] != key:
                warnings.add(heads[-1].line, f"{heads[-1].key} has no end of its own")
                close()
            close()
        elif key in BLOCKS and (text.partition(entry.key)[2].lstrip()[:1] == "=" or not entry.value):
            # a block cannot lie in one of its kind, however deep: the ends were forgotten
            while key in {head.key.casefold() for head in heads} or len(heads) >= _DEEPEST:
                warnings.add(heads[-1].line, f"{heads[-1].key} has no end")
                close()
            heads.append(entry)
            bodies.append([])
        elif not _is_statement(text, entry, inside):
            warnings.add(number, f"{text[:60]!r} is no statement")
        else:
            bodies[-1].append(entry)
    while heads:
        warnings.add(heads[-1].line, f"{heads[-1].key} has no end")
        close()
    return tuple(top)


def _entry(line: int, text: str) -> GsdEntry | None:
    found = _STATEMENT.fullmatch(text)
    if found is None:
        return None
    return GsdEntry(line, found["key"], (found["argument"] or "").strip(), found["value"].strip())


def _is_statement(text: str, entry: GsdEntry, inside: str) -> bool:
    """Whether it has an equals sign, or stands in a block where it needs none."""
    found = _STATEMENT.fullmatch(text)
    if found is not None and found["equals"]:
        return True
    if inside == "module":
        return gsd_number(text) is not None
    return inside in _BARE and bool(entry.value)
