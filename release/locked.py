"""What the files in ``locks/`` name: packages, versions, conditions, hashes."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from packaging.markers import Marker

ROOT = Path(__file__).resolve().parents[1]
_ENTRY = re.compile(
    r"^([A-Za-z0-9][A-Za-z0-9._-]*)==([^\s;\\]+)(?: ; ([^\\\n]+?))?((?:\s*\\\n\s+--hash=\S+)*)$", re.MULTILINE
)


@dataclass(frozen=True, slots=True)
class Locked:
    """One entry: an exact version, for the Pythons that its condition names, and the SHA-256 of its archives."""

    name: str
    version: str
    condition: str
    hashes: tuple[str, ...]

    def is_here(self) -> bool:
        """Whether this interpreter on this machine installs it."""
        return not self.condition or Marker(self.condition).evaluate()


def entries(name: str) -> list[Locked]:
    """All entries of a file in ``locks/``, in its order."""
    text = (ROOT / "locks" / name).read_text("utf-8")
    return [
        Locked(package, version, condition, tuple(sorted(re.findall(r"sha256:([0-9a-f]{64})", hashes))))
        for package, version, condition, hashes in _ENTRY.findall(text)
    ]


def pinned(name: str) -> dict[str, set[str]]:
    """Name -> versions that a file of ``locks/`` allows."""
    found: dict[str, set[str]] = {}
    for entry in entries(name):
        found.setdefault(entry.name, set()).add(entry.version)
    return found
