"""A farm file of what was found in a capture or a project: one that can be read, whatever was found.

The file is made, read as any other, and made again without what its reader refuses, until it is taken.  What was left
out is in the comments of its drive or device, and one that cannot be made at all is listed beside the other stations.
Description files of devices are beside the farm file; while it is checked, they are in a folder of their own.
"""

from __future__ import annotations

import re
import textwrap
from copy import deepcopy
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from pnfarm.buses.imports import FoundDevice, FoundDrive, FoundStation
from pnfarm.errors import ConfigError, InternalError
from pnfarm.farm.file.reading import expand_all, parse_farm
from pnfarm.vocabulary.issues import FarmFileError, parse_path
from pnfarm.vocabulary.quoting import shown
from pnfarm.vocabulary.yaml_lines import resolve

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pnfarm.buses.imports import Found
    from pnfarm.vocabulary.issues import FileIssue, Location

__all__ = ["WrittenFarm", "farm_name", "files_of", "is_station_name", "named", "with_files", "write_farm"]

#: Characters of a comment's line, of the comments of one drive or station, and of all of them.
_WIDTH, _MOST_OF_ONE, _MOST_OF_ALL = 116, 4000, 300_000
#: Characters of why one thing is left out: what is allowed may be a list of everything.
_MOST_OF_NOTE = 240
#: Other stations that are listed; a capture of hostile frames may have any number.
_MOST_STATIONS = 500
#: How often the file is made: each time something of a drive or device is left out, or itself.
_MOST_TIMES = 100
#: What replaces a name that a station cannot have begins so.
_ANY_NAME = "imported-"
#: Characters of a station's name in that of its description file.
_IN_FILE_NAME = 100
#: A name that a farm file may have.
_NAME = re.compile(r"[a-z0-9](?:[a-z0-9-]*[a-z0-9])?(?:\.[a-z0-9](?:[a-z0-9-]*[a-z0-9])?)*")


_Played = FoundDrive | FoundDevice


@dataclass(frozen=True, slots=True)
class WrittenFarm:
    """The file's text, what is in it, a line for each value or station left out, and description files by their names
    in the farm file's folder.

    ``addresses``: keys whose values no two of its stations may share.
    """

    text: str
    drives: list[FoundDrive]
    devices: list[FoundDevice]
    others: list[FoundStation]
    left_out: list[str]
    files: Mapping[str, bytes]
    addresses: frozenset[str]

    @property
    def unplayed(self) -> dict[str, str]:
        """What is known of the other stations, by the names that they would have as drives or devices."""
        return {_name(other.name): other.facts[0] if other.facts else "" for other in self.others}


def farm_name(stem: str) -> str:
    """A farm's name by that of a file."""
    found = re.sub(r"[^a-z0-9-]+", "-", stem.lower()).strip("-")
    return found[:40].strip("-") or "imported"


def write_farm(found: Sequence[Found], name: str, parent: str, source: str, folder: Path) -> WrittenFarm:
    """The farm file, to be written into ``folder``, with comments about what was seen.

    Raises :class:`ConfigError` where ``name`` or ``parent`` cannot be in a farm file.
    """
    kept = with_files(named([one for one in found if not isinstance(one, FoundStation)]))
    others = [one for one in found if isinstance(one, FoundStation)]
    left_out: list[str] = []
    addresses = frozenset[str]()
    with TemporaryDirectory(prefix="pnfarm-import-") as scratch:
        for own, octets in files_of(kept).items():
            (Path(scratch) / own).write_bytes(octets)
        for _ in range(_MOST_TIMES if kept else 0):
            text = _text(kept, others, name, parent, source, f"{scratch}/")
            try:
                stations = expand_all(parse_farm(text, folder / f"{name}.pnfarm.yml"))
            except FarmFileError as error:
                # the folder does not exist when this is read
                issues = [replace(one, what=one.what.replace(f"{scratch}/", "")) for one in error.issues]
                kept = _without(kept, others, issues, left_out)
            else:
                addresses = frozenset(key for one in stations for key, *_ in one.claims())
                break
            if not kept:
                break
        else:
            if kept:
                raise InternalError(f"no farm file could be made of {source}: {left_out[-1:]}")
    drives, devices = _parts(kept).values()
    text = _text(kept, others, name, parent, source)
    return WrittenFarm(text, drives, devices, others, left_out, files_of(kept), addresses)


def _parts(stations: Sequence[_Played]) -> dict[str, list[Any]]:
    """The drives and the devices, by the keys of their lists in a farm file."""
    return {
        "drives": [one for one in stations if isinstance(one, FoundDrive)],
        "devices": [one for one in stations if isinstance(one, FoundDevice)],
    }


def with_files(stations: Sequence[_Played]) -> list[_Played]:
    """The devices with the names of their files that are to be written: those alike have one."""
    named: dict[bytes, str] = {}
    found: list[_Played] = []
    for number, one in enumerate(stations):
        if isinstance(one, FoundDevice) and one.file.octets is not None:
            short = one.name if len(one.name) <= _IN_FILE_NAME else f"{one.name[:_IN_FILE_NAME]}-{number}"
            own = named.setdefault(one.file.octets, one.file.name.replace("{name}", short))
            one = replace(one, file=replace(one.file, name=own))
        found.append(one)
    return found


def files_of(stations: Sequence[_Played]) -> dict[str, bytes]:
    """The description files that are to be written, by name."""
    files = [one.file for one in stations if one.file is not None]
    return {file.name: file.octets for file in files if file.octets is not None}


# -- what cannot be in the file ----------------------------------------------------------------------------------------


def _without(
    stations: list[_Played], others: list[FoundStation], issues: Sequence[FileIssue], left_out: list[str]
) -> list[_Played]:
    """The drives and devices without what is refused; those that are refused as a whole become other stations."""
    parts = _parts(stations)
    refused: dict[tuple[str, int], dict[Location, str]] = {}
    for issue in issues:
        why = f"{issue.what}; allowed: {issue.allowed}" if issue.allowed else issue.what
        why = why if len(why) <= _MOST_OF_NOTE else f"{why[:_MOST_OF_NOTE]} ..."
        match parse_path(issue.field):
            case (str(part), int(number), *inside) if part in parts:
                known = refused.setdefault((part, number), {})
                # of each station one, and others beside it: any other may be a consequence
                if not known or (inside[:-1] and inside[:-1] == [*next(iter(known))][:-1]):
                    known.setdefault(tuple(inside), why)
            case () | ("drives",) | ("devices",) as path if len(stations) > 1:
                # too many
                part = str(path[0]) if path else max(parts, key=lambda one: len(parts[one]))
                for number in range(len(parts[part]) // 2, len(parts[part])):
                    refused[part, number] = {(): why}
            case _:
                raise ConfigError(f"{issue.field or 'the farm file'}: {why}")
    kept: list[_Played] = []
    for part, number, one in ((part, *numbered) for part, listed in parts.items() for numbered in enumerate(listed)):
        if (part, number) not in refused:
            kept.append(one)
            continue
        paths = refused[part, number]
        path, why = next(iter(paths.items()))
        if path[:1] == ("name",) and not one.name.startswith(_ANY_NAME):
            notes = (f"its name was {one.name!r}", *one.notes)
            kept.append(replace(one, name=f"{_ANY_NAME}{part[:-1]}-{number + 1}", notes=notes))
            continue
        left, notes = one, one.notes
        for path, why in paths.items():
            if (smaller := _smaller(left, path, whole=left is not one)) is not None:
                left, what = smaller
                told = _printable(f"left out: {what}: {why}")
                left_out.append(f"{one.name}: {told}")
                notes = (told, *notes)
        if left is not one:
            kept.append(replace(left, notes=notes))
        else:
            told = _printable(f"cannot be in a farm: {why}")
            left_out.append(f"{one.name}: {told}")
            others.append(FoundStation(one.name, (told, *one.notes, *one.facts), one.line))
    return kept


def _smaller(station: _Played, inside: Location, *, whole: bool = False) -> tuple[_Played, str] | None:
    """The station without the innermost of its keys on this path, and which that was; None: it has no such key.

    ``whole``: only where the path is there to its end.
    """
    keys: Any = deepcopy(dict(station.keys))
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
    if holder is None or (whole and len(path) < len(inside)):
        return None
    value = holder.pop(last)
    return replace(station, keys=_without_empty(keys)), f"{'.'.join(path)} {shown(value)}"


def _without_empty(keys: dict[Any, Any]) -> dict[Any, Any]:
    smaller = {key: _without_empty(value) if isinstance(value, dict) else value for key, value in keys.items()}
    return {key: value for key, value in smaller.items() if value != {}}


def is_station_name(text: str) -> bool:
    """Whether a farm file may have it as a name."""
    return _NAME.fullmatch(text) is not None


def _name(name: str) -> str:
    own = name.lower()
    return own if is_station_name(own) else re.sub(r"[^a-z0-9]+", "-", own).strip("-") or "station"


def named(stations: Sequence[_Played]) -> list[_Played]:
    """Under names that a farm file may have, each once; those that are new are in the notes."""
    named: list[_Played] = []
    taken = set[str]()
    for one in stations:
        own, notes = one.name.lower(), one.notes
        if not is_station_name(own) or own in taken:
            why = "which another station has, too" if own in taken else ""
            notes = (f"its name was {one.name!r}" + (f", {why}" if why else ""), *notes)
            own = _name(one.name)
            first, number = own, 2
            while own in taken:
                own, number = f"{first}-{number}", number + 1
        taken.add(own)
        named.append(replace(one, name=own, notes=notes))
    return named


# -- text --------------------------------------------------------------------------------------------------------------


def _text(
    stations: Sequence[_Played], others: Sequence[FoundStation], name: str, parent: str, source: str, files: str = ""
) -> str:
    """``files`` is what the names of description files begin with."""
    lines = [
        *_comment(f"Made by `pnfarm import {source}`. What was seen is in the comments: check them.", "# "),
        f"farm: {_value(name)}",
        *_link(stations or others, parent),
        "api: 127.0.0.1:8702",
    ]
    listed = others[:_MOST_STATIONS]
    room = min(_MOST_OF_ONE, _MOST_OF_ALL // (len(stations) + len(listed) or 1))
    for part, found in _parts(stations).items():
        if found:
            lines.append(f"{part}:")
        for one in found:
            lines += _group(one, room, files)
    if not stations:
        lines += [
            "# No drive of a known kind was seen (`pnfarm models` lists them), and a farm needs a drive or a device:",
            "# drives:",
        ]
    if others:
        lines += ["", "# Other stations, without a model:"]
        for other in listed:
            lines += _comment(f"{other.name}: {'; '.join(other.facts)}"[:room], "#   ")
        if len(others) > _MOST_STATIONS:
            lines.append(f"#   and {len(others) - _MOST_STATIONS} more")
    return "\n".join(lines) + "\n"


def _link(stations: Sequence[Found], parent: str) -> list[str]:
    """The network's link, a line, or both; a capture does not say how a line is reached, nor its rate."""
    lines = sorted({one.line for one in stations if one.line})
    if lines and all(one.line for one in stations):
        return ["link: {kind: serial, pty: auto}   # the log has its far end; or {kind: serial, port: ..., baud: ...}"]
    network = f"kind: macvlan, parent: {_value(parent)}"
    if lines:
        network += ", lines: {" + ", ".join(f"{name}: {{pty: auto}}" for name in lines) + "}"
    return [f"link: {{{network}}}   # the interface that leads to the PLC"]


def _group(station: _Played, room: int, files: str) -> list[str]:
    lines = []
    for note in (*station.notes, *station.facts):
        lines += _comment(note[:room], "  # ")
        room -= len(note)
        if room <= 0:
            break
    keys: dict[str, Any] = {"name": station.name}
    own = files if station.file is not None and station.file.octets is not None else ""
    if isinstance(station, FoundDevice):
        keys |= {station.file.key: own + station.file.name, **station.keys}
    else:
        keys |= {"model": station.model, **station.keys}
        if own and "identity" in keys:
            keys["identity"] = {**keys["identity"], "gsdml": own + keys["identity"]["gsdml"]}
        elif own:
            keys["gsdml"] = own + keys["gsdml"]
    begin = "  - "
    for key, value in keys.items():
        lines += _entry(begin, key, value)
        begin = "    "
    return lines


def _entry(begin: str, key: Any, value: Any) -> list[str]:
    """A key of a group; a long mapping has a line for each of its own."""
    # a number that is no ident, such as a telegram's, is decimal
    line = f"{begin}{key}: {value if isinstance(value, int) else _value(value)}"
    if len(line) <= _WIDTH or not isinstance(value, dict):
        return [line]
    indent = " " * (len(begin) + 2)
    return [f"{begin}{key}:", *(f"{indent}{_key(one)}: {_value(inside)}" for one, inside in value.items())]


def _value(value: Any, *, idents: bool = True) -> str:
    """In YAML's flow style; idents as hexadecimal numbers.  Those in a list are none."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_key(key)}: {_value(one, idents=idents)}" for key, one in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_value(one, idents=False) for one in value) + "]"
    if value is None:
        return "null"
    if isinstance(value, int):
        return f"0x{value:X}" if idents else str(value)
    text = str(value)
    if not text.isprintable():
        return '"' + _printable(text.replace("\\", "\\\\").replace('"', '\\"')) + '"'
    # 2.1 would be a number
    if re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_./-]*", text) and resolve(text) == text:
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
    # a name with hyphens stays whole
    lines = textwrap.wrap(
        _printable(text), _WIDTH, initial_indent=begin, subsequent_indent=begin + "  ", break_on_hyphens=False
    )
    return lines or [begin.rstrip()]
