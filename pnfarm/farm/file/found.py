"""A farm file of what was found in a capture or a project: one that can be read, whatever was found.

The file is made, read as any other, and made again without what its reader refuses, until it is taken.  What was left
out is in the comments of its drive, and a drive that cannot be played at all is listed beside the other stations.
"""

from __future__ import annotations

import re
import textwrap
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from pnfarm.buses.imports import FoundDrive, FoundStation
from pnfarm.errors import ConfigError, InternalError
from pnfarm.farm.file.reading import parse_farm
from pnfarm.vocabulary.issues import FarmFileError, parse_path
from pnfarm.vocabulary.quoting import shown
from pnfarm.vocabulary.yaml_lines import resolve

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from pnfarm.vocabulary.issues import FileIssue, Location

__all__ = ["WrittenFarm", "farm_name", "write_farm"]

#: Characters of a comment's line, of the comments of one drive or station, and of all of them.
_WIDTH, _MOST_OF_ONE, _MOST_OF_ALL = 116, 4000, 300_000
#: Other stations that are listed; a capture of hostile frames may have any number.
_MOST_STATIONS = 500
#: How often the file is made: each time something of a drive is left out, or the drive itself.
_MOST_TIMES = 100
#: What replaces a name that a drive cannot have begins so.
_ANY_NAME = "imported-drive-"
#: A name that a farm file may have.
_NAME = re.compile(r"[a-z0-9](?:[a-z0-9-]*[a-z0-9])?(?:\.[a-z0-9](?:[a-z0-9-]*[a-z0-9])?)*")


@dataclass(frozen=True, slots=True)
class WrittenFarm:
    """The file's text, the drives and the other stations in it, and a line for each value or drive left out."""

    text: str
    drives: list[FoundDrive]
    others: list[FoundStation]
    left_out: list[str]


def farm_name(stem: str) -> str:
    """A farm's name by that of a file."""
    found = re.sub(r"[^a-z0-9-]+", "-", stem.lower()).strip("-")
    return found[:40].strip("-") or "imported"


def write_farm(
    drives: Sequence[FoundDrive],
    others: Sequence[FoundStation],
    name: str,
    parent: str,
    source: str,
    folder: Path,
) -> WrittenFarm:
    """The farm file, to be written into ``folder``, with comments about what was seen.

    Raises :class:`ConfigError` where ``name`` or ``parent`` cannot be in a farm file.
    """
    kept, listed = _named(drives), list(others)
    left_out: list[str] = []
    for _ in range(_MOST_TIMES):
        text = _text(kept, listed, name, parent, source)
        if not kept:
            break
        try:
            parse_farm(text, folder / f"{name}.pnfarm.yml")
        except FarmFileError as error:
            kept = _without(kept, listed, error.issues, left_out)
        else:
            break
    else:
        raise InternalError(f"no farm file could be made of {source}: {left_out[-1:]}")
    return WrittenFarm(text, kept, listed, left_out)


# -- what cannot be in the file ----------------------------------------------------------------------------------------


def _without(
    drives: list[FoundDrive], others: list[FoundStation], issues: Sequence[FileIssue], left_out: list[str]
) -> list[FoundDrive]:
    """The drives without what is refused; those that are refused as a whole become other stations."""
    refused: dict[int, tuple[Location, str]] = {}
    for issue in issues:
        why = f"{issue.what}; allowed: {issue.allowed}" if issue.allowed else issue.what
        match parse_path(issue.field):
            case ("drives", int(number), *inside):
                # one of each drive: the next one may be a consequence
                refused.setdefault(number, (tuple(inside), why))
            case () | ("drives",) if len(drives) > 1:
                # too many
                refused |= dict.fromkeys(range(len(drives) // 2, len(drives)), ((), why))
            case _:
                raise ConfigError(f"{issue.field or 'the farm file'}: {why}")
    kept = []
    for number, drive in enumerate(drives):
        if number not in refused:
            kept.append(drive)
            continue
        path, why = refused[number]
        if path[:1] == ("name",) and not drive.name.startswith(_ANY_NAME):
            notes = (f"its name was {drive.name!r}", *drive.notes)
            kept.append(replace(drive, name=f"{_ANY_NAME}{number + 1}", notes=notes))
        elif (smaller := _smaller(drive, path)) is not None:
            found, what = smaller
            told = _printable(f"left out: {what}: {why}")
            left_out.append(f"{drive.name}: {told}")
            kept.append(replace(found, notes=(told, *drive.notes)))
        else:
            told = _printable(f"cannot be a drive of a farm: {why}")
            left_out.append(f"{drive.name}: {told}")
            others.append(FoundStation(drive.name, (told, *drive.notes), drive.line))
    return kept


def _smaller(drive: FoundDrive, inside: Location) -> tuple[FoundDrive, str] | None:
    """The drive without the innermost of its keys on this path, and which that was; None: it has no such key."""
    keys: Any = deepcopy(dict(drive.keys))
    holder, last, path = None, None, []
    level = keys
    for step in inside:
        known = level if isinstance(level, dict) else {}
        found = next((key for key in known if str(step) in {str(key), _key(key)}), None)
        if found is None:
            break
        holder, last = level, found
        path.append(str(found))
        level = level[found]
    if holder is None:
        return None
    value = holder.pop(last)
    return replace(drive, keys=_without_empty(keys)), f"{'.'.join(path)} {shown(value)}"


def _without_empty(keys: dict[Any, Any]) -> dict[Any, Any]:
    smaller = {key: _without_empty(value) if isinstance(value, dict) else value for key, value in keys.items()}
    return {key: value for key, value in smaller.items() if value != {}}


def _named(drives: Sequence[FoundDrive]) -> list[FoundDrive]:
    """The drives under names that a farm file may have, each once."""
    named, taken = [], set[str]()
    for drive in drives:
        own, notes = drive.name.lower(), drive.notes
        if _NAME.fullmatch(own) is None or own in taken:
            notes = (f"its name was {drive.name!r}", *notes)
            own = re.sub(r"[^a-z0-9]+", "-", own).strip("-") or "drive"
            first, number = own, 2
            while own in taken:
                own, number = f"{first}-{number}", number + 1
        taken.add(own)
        named.append(replace(drive, name=own, notes=notes))
    return named


# -- text --------------------------------------------------------------------------------------------------------------


def _text(drives: Sequence[FoundDrive], others: Sequence[FoundStation], name: str, parent: str, source: str) -> str:
    lines = [
        *_comment(
            f"Made by `pnfarm import {source}`. What was seen of each drive is in its comments: check them.", "# "
        ),
        f"farm: {name}",
        *_link(drives or others, parent),
        "api: 127.0.0.1:8702",
    ]
    listed = others[:_MOST_STATIONS]
    room = min(_MOST_OF_ONE, _MOST_OF_ALL // (len(drives) + len(listed) or 1))
    if drives:
        lines.append("drives:")
        for drive in drives:
            lines += _group(drive, room)
    else:
        lines += [
            "# No drive of a known kind was seen (`pnfarm models` lists them), and a farm needs one:",
            "# drives:",
        ]
    if others:
        lines += ["", "# Other stations, without a model:"]
        for one in listed:
            lines += _comment(f"{one.name}: {'; '.join(one.facts)}"[:room], "#   ")
        if len(others) > _MOST_STATIONS:
            lines.append(f"#   and {len(others) - _MOST_STATIONS} more")
    return "\n".join(lines) + "\n"


def _link(stations: Sequence[FoundDrive | FoundStation], parent: str) -> list[str]:
    """The network's link, a line, or both; a capture does not say how a line is reached, nor its rate."""
    lines = sorted({one.line for one in stations if one.line})
    if lines and all(one.line for one in stations):
        return ["link: {kind: serial, pty: auto}   # the log has its far end; or {kind: serial, port: ..., baud: ...}"]
    network = f"kind: macvlan, parent: {_value(parent)}"
    if lines:
        network += ", lines: {" + ", ".join(f"{name}: {{pty: auto}}" for name in lines) + "}"
    return [f"link: {{{network}}}   # the interface that leads to the PLC"]


def _group(drive: FoundDrive, room: int) -> list[str]:
    lines = []
    for note in drive.notes:
        lines += _comment(note[:room], "  # ")
        room = max(0, room - len(note))
    lines += [f"  - name: {_value(drive.name)}", f"    model: {drive.model}"]
    # a number that is no ident, such as a telegram's, is decimal
    lines += [f"    {key}: {value if isinstance(value, int) else _value(value)}" for key, value in drive.keys.items()]
    return lines


def _value(value: Any) -> str:
    """In YAML's flow style; idents as hexadecimal numbers."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_key(key)}: {_value(one)}" for key, one in value.items()) + "}"
    if isinstance(value, int):
        return f"0x{value:X}"
    text = str(value)
    if not text.isprintable():
        return '"' + _printable(text.replace("\\", "\\\\").replace('"', '\\"')) + '"'
    # 2.1 would be a number
    if re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9./-]*", text) and resolve(text) == text:
        return text
    return "'" + text.replace("'", "''") + "'"


def _key(key: Any) -> str:
    if isinstance(key, int):
        return f"0x{key:X}" if key >= 0x8000 else str(key)
    return _value(key)


def _printable(text: str) -> str:
    """What would end a line of the file, or may not be in it, as YAML's escapes."""
    whole = text.encode("utf-8", "replace").decode("utf-8")
    return "".join(one if one.isprintable() else one.encode("unicode_escape").decode("ascii") for one in whole)


def _comment(text: str, begin: str) -> list[str]:
    return textwrap.wrap(_printable(text), _WIDTH, initial_indent=begin, subsequent_indent=begin + "  ") or [
        begin.rstrip()
    ]
