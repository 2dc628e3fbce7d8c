"""Where an import meets a farm file that is there already.

Beside the farm file is a record of what the import wrote, ``NAME.imported.yml``: two lines, of which the second has the
digests (SHA-256) of its description files, and the farm file as the import made it.  Only the next import reads it.
"""

from __future__ import annotations

import codecs
import difflib
import hashlib
import json
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from pnfarm.errors import ConfigError
from pnfarm.farm.file.reading import parse_farm
from pnfarm.farm.file.update import Project, update
from pnfarm.vocabulary.issues import FarmFileError
from pnfarm.vocabulary.regular_file import read_regular
from pnfarm.vocabulary.yaml_lines import MAX_OCTETS, YamlError, parse_yaml
from pnfarm.vocabulary.yaml_parts import walk

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.farm.file.found import WrittenFarm

__all__ = ["PlannedImport", "Record", "plan_import", "read_record", "record_path"]

#: Octets of a description file that is compared with the import's.
_MOST = 64 << 20
_HEAD = "# What `pnfarm import` wrote into {}: the next import finds your changes by it. Keep it as it is."
_FILES = "description_files"


@dataclass(frozen=True, slots=True)
class Record:
    """What an import wrote: the farm file's text, and its description files' digests by name."""

    text: str
    files: Mapping[str, str]

    @property
    def name(self) -> str:
        return str(parse_yaml(self.text).root.plain()["farm"])

    @property
    def parent(self) -> str | None:
        """The network interface of its macvlan link."""
        link = parse_yaml(self.text).root.plain().get("link")
        parent = link.get("parent") if isinstance(link, dict) else None
        return parent if isinstance(parent, str) else None

    def file(self, farm: Path) -> bytes:
        """The record's file."""
        return (
            f"{_HEAD.format(farm.name)}\n{_FILES}: {json.dumps(dict(sorted(self.files.items())))}\n{self.text}".encode()
        )


@dataclass(slots=True)
class PlannedImport:
    """Files to be written, sentences about what differs, and the farm file's difference."""

    files: dict[Path, bytes] = field(default_factory=dict)
    sentences: list[str] = field(default_factory=list)
    difference: str = ""
    refused: ConfigError | None = None


def record_path(farm: Path) -> Path:
    """The record of a farm file: ``cell.imported.yml`` of ``cell.pnfarm.yml``."""
    return farm.with_name(f"{farm.name.removesuffix('.pnfarm.yml')}.imported.yml")


def read_record(farm: Path) -> Record | None:
    """What the last import wrote into this farm file; None where that is not known.

    Raises :class:`ConfigError` for a record that is damaged.
    """
    path = record_path(farm)
    try:
        data = read_regular(path, 2 * MAX_OCTETS)
        # a version control may have stored it with other ends of lines
        _, files, text = data.decode().replace("\r\n", "\n").split("\n", 2)
        known = parse_yaml(files).root.plain()[_FILES]
        values = parse_yaml(text).root.plain()
        if not isinstance(known, dict) or not isinstance(values["farm"], str):
            raise TypeError
    except FileNotFoundError:
        return None
    except OSError as error:
        raise ConfigError(f"{path} cannot be read: {(error.strerror or str(error)).lower()}") from error
    except (ValueError, TypeError, KeyError, YamlError) as error:
        raise ConfigError(f"{path} is not what an import wrote: restore it, or remove it") from error
    return Record(text, {name: str(digest) for name, digest in known.items()})


def plan_import(
    made: WrittenFarm, farm: Path, source: str, *, into: bool = False, force: bool = False
) -> PlannedImport:
    """What is to be written for a farm file; ``into``: one that is there is updated, ``force``: it is replaced.

    Raises :class:`ConfigError` where something is there that may not be replaced, or cannot be read.
    """
    found = PlannedImport()
    record = None if force else read_record(farm)
    there = _read(farm, MAX_OCTETS + 1)
    if there is not None and not into and not force:
        how = "--update to change in it what the project changed, --force to replace it"
        raise ConfigError(f"{farm} is there already: give {how}, or another name")
    digests = _plan_files(found, made, farm, record, into=into, force=force)
    text, base = made.text, made.text
    if there is not None and into:
        text, base = _updated(found, there, made, farm, source, record)
    else:
        names = [*(one.name for one in made.drives), *(one.name for one in made.devices)]
        found.sentences += [f"{name}: added" for name in names]
    octets = text.encode()
    old = "" if there is None else there.decode(errors="replace")
    found.difference = _difference(old, text, farm, is_new=there is None)
    if octets != there:
        found.files[farm] = octets
    kept = {} if record is None else {name: one for name, one in record.files.items() if (farm.parent / name).exists()}
    recorded = Record(base, {**kept, **digests}).file(farm)
    if recorded != _read(record_path(farm), 2 * MAX_OCTETS):
        found.files[record_path(farm)] = recorded
    return found


def _plan_files(
    found: PlannedImport, made: WrittenFarm, farm: Path, record: Record | None, *, into: bool, force: bool
) -> dict[str, str]:
    """The digests of the import's description files that are there then."""
    digests: dict[str, str] = {}
    for name, octets in made.files.items():
        path = farm.parent / name
        there = _read(path, _MOST)
        own = record is not None and there is not None and record.files.get(name) == _digest(there)
        if there is None or force or own:
            if there != octets:
                found.files[path] = octets
                found.sentences.append(f"{name}: {'written' if there is None else 'replaced'}")
        elif there != octets:
            if not into:
                raise ConfigError(f"{path} is there already: give --force to replace it, or another folder")
            found.sentences.append(f"{name}: kept, as it is not as an import wrote it; the import has another one")
            continue
        digests[name] = _digest(octets)
    return digests


def _updated(
    found: PlannedImport, there: bytes, made: WrittenFarm, farm: Path, source: str, record: Record | None
) -> tuple[str, str]:
    """The farm file's text, and that of its record."""
    new = {path.name: octets for path, octets in found.files.items()}
    text, values = _parsed(there)
    if (not isinstance(values, dict) or {"drives", "devices"} & values.keys()) and (why := _errors(there, farm, new)):
        raise ConfigError(why)
    if record is None:
        found.sentences.append(
            f"{record_path(farm).name} is not there: keys that an import writes are taken for the project's, all "
            "others for yours, and stations for yours that the project does not have"
        )
    ends = "\r\n" if "\r\n" in text else "\n"

    def project(ends: str) -> Project:
        return Project(made.text.replace("\n", ends), source, made.addresses, made.unplayed)

    base = None if record is None else record.text.replace("\n", ends)
    merged = update(text, base, project(ends))
    found.sentences += merged.sentences
    if why := _errors(merged.text, farm, new):
        head = f"{farm} could not be read with these changes, and is as it was; lines are those with the changes:"
        found.refused = ConfigError(f"{head}\n{why}")
    kept = made.text if record is None else update(record.text, record.text, project("\n")).text
    return _mark(there) + merged.text, kept


def _mark(data: bytes) -> str:
    return "\ufeff" if data.startswith(codecs.BOM_UTF8) else ""


def _parsed(data: bytes) -> tuple[str, Any]:
    """A file's text without a byte order mark, and its values; nothing where it has none."""
    try:
        text = data.decode("utf-8-sig")
        return text, parse_yaml(text).root.plain()
    except (UnicodeDecodeError, YamlError):
        return "", None


def _errors(data: bytes | str, farm: Path, files: Mapping[str, bytes]) -> str:
    """Why a farm file cannot be read where these description files are beside it."""
    with TemporaryDirectory(prefix="pnfarm-import-") as scratch:
        for name, octets in files.items():
            (Path(scratch) / name).write_bytes(octets)
        text = data if isinstance(data, str) else _parsed(data)[0]
        there, at = [], 0
        for node in walk(parse_yaml(text).root) if text else ():
            if isinstance(node.content, str) and node.content in files and not node.shared and node.start >= at:
                there += [text[at : node.start], json.dumps(f"{scratch}/{node.content}", ensure_ascii=False)]
                at = node.end
        try:
            parse_farm("".join(there) + text[at:] if text else data, farm)
        except FarmFileError as error:
            return str(error).replace(f"{scratch}/", "")
    return ""


def _difference(old: str, new: str, farm: Path, *, is_new: bool) -> str:
    if old == new:
        return ""
    before, after = (text.split("\n") for text in (old, new))
    lines = difflib.unified_diff(before, after, "/dev/null" if is_new else str(farm), str(farm), lineterm="")
    return "\n".join(lines) + "\n"


def _read(path: Path, most: int) -> bytes | None:
    try:
        return read_regular(path, most)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise ConfigError(f"{path} cannot be read: {(error.strerror or str(error)).lower()}") from error


def _digest(octets: bytes) -> str:
    return hashlib.sha256(octets).hexdigest()
