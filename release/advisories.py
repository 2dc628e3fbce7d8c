"""Known vulnerabilities in a folder on this machine, by the rules of OSV's schema: no network is needed.

The folder is a checkout of https://github.com/pypa/advisory-database (YAML), or OSV's archive of PyPI's advisories,
unpacked (JSON): one file for each advisory, in any folder below.
"""

from __future__ import annotations

import json
from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import yaml
from packaging.utils import canonicalize_name
from packaging.version import InvalidVersion, Version

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

#: How OSV writes "from the very first version".
_FIRST = "0"
_YAML = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


@dataclass(frozen=True, slots=True)
class Finding:
    """One advisory that names one version of a package; ``fixed`` are the versions that end its ranges."""

    package: str
    version: str
    ids: tuple[str, ...]
    fixed: tuple[str, ...]


class Advisories:
    """The advisories of a folder; ``newest`` is the last time at which one of them was changed, as the files say it.

    Raises ValueError if the folder holds none.
    """

    def __init__(self, folder: Path) -> None:
        self._of: dict[str, list[tuple[dict[str, Any], dict[str, Any]]]] = defaultdict(list)
        self.count = 0
        self.newest = ""
        for advisory in _read(folder):
            self.count += 1
            self.newest = max(self.newest, str(advisory.get("modified") or advisory.get("published") or ""))
            # withdrawn: it was none
            if advisory.get("withdrawn"):
                continue
            for affected in advisory.get("affected") or []:
                package = affected.get("package", {})
                if package.get("ecosystem") == "PyPI":
                    self._of[canonicalize_name(package["name"])].append((advisory, affected))
        if not self.count:
            raise ValueError(f"{folder} has no advisory: a checkout of pypa/advisory-database has thousands")

    def of(self, package: str, version: str) -> list[Finding]:
        """What is known of one version of a package; an advisory's other names are among its ids."""
        found = []
        for advisory, affected in self._of[canonicalize_name(package)]:
            if is_affected(affected, version):
                ids = (advisory["id"], *sorted(advisory.get("aliases") or []))
                found.append(Finding(package, version, ids, tuple(_fixed(affected))))
        return sorted(found, key=lambda finding: finding.ids)


def _read(folder: Path) -> Iterator[dict[str, Any]]:
    for path in sorted(folder.rglob("*")):
        if path.suffix == ".json":
            read = json.loads(path.read_text("utf-8"))
        elif path.suffix in {".yaml", ".yml"}:
            read = yaml.load(path.read_text("utf-8"), _YAML)  # noqa: S506 - the loader is a safe one
        else:
            continue
        # other files of a checkout are no advisories
        if isinstance(read, dict) and "id" in read and "affected" in read:
            yield read


def is_affected(affected: dict[str, Any], version: str) -> bool:
    """Whether one entry of ``affected`` has a version: by its list of versions, or by one of its ranges."""
    wanted = Version(version)
    listed = (_version(text) for text in affected.get("versions") or [])
    if any(one == wanted for one in listed):
        return True
    ranges = (one["events"] for one in affected.get("ranges") or [] if one.get("type") == "ECOSYSTEM")
    return any(_in_range(events, wanted) for events in ranges)


def _in_range(events: Iterable[dict[str, str]], wanted: Version) -> bool:
    """By the events in the order of their versions: the last one at or before the wanted version decides."""
    marks = []
    for event in events:
        (kind, text), *_ = event.items()
        if kind == "introduced":
            marks.append((Version(_FIRST + ".dev0") if text == _FIRST else Version(text), 0, kind))
        elif kind in {"fixed", "last_affected"}:
            marks.append((Version(text), 1, kind))
    inside = False
    for mark, _, kind in sorted(marks):
        if kind == "introduced":
            inside = inside or wanted >= mark
        elif (wanted >= mark) if kind == "fixed" else (wanted > mark):
            inside = False
    return inside


def _version(text: str) -> Version | None:
    try:
        return Version(text)
    except InvalidVersion:
        # of the time before PEP 440; no version that a lock can name
        return None


def _fixed(affected: dict[str, Any]) -> list[str]:
    ranges = affected.get("ranges") or []
    events = (event for one in ranges if one.get("type") == "ECOSYSTEM" for event in one["events"])
    return [str(event["fixed"]) for event in events if "fixed" in event]
