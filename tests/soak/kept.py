"""What a soak has done so far, in one JSON file, from which it goes on and its report is made.

A name that ends in ``.xz`` has it compressed, to a tenth.
"""

from __future__ import annotations

import json
import lzma
import os
import platform
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

__all__ = ["KEPT_OPTIONS", "Kept", "KeptError", "commit", "machine"]

ROOT = Path(__file__).resolve().parents[2]
VERSION = 1
COMPRESSED = ".xz"
#: Arguments that must be those of the first piece.
KEPT_OPTIONS = ("hours", "piece", "seed", "drives", "rate", "link", "virtual")
#: The seed of a piece is the soak's times this, and the number of the piece.
PIECES = 1000


class KeptError(Exception):
    """The file is not of this soak; one sentence."""


@dataclass(slots=True)
class Kept:
    """``options``: what must stay (:data:`KEPT_OPTIONS`).  ``pieces``: the reports of those that ended, in order."""

    options: dict[str, Any]
    pieces: list[dict[str, Any]] = field(default_factory=list)

    @classmethod
    def read(cls, path: Path) -> Kept:
        """Raises :class:`KeptError` for a file that no soak wrote."""
        try:
            octets = path.read_bytes()
            found = json.loads(lzma.decompress(octets) if path.suffix == COMPRESSED else octets)
        except OSError as exc:
            raise KeptError(f"{path} cannot be read: {exc.strerror}") from exc
        except (ValueError, lzma.LZMAError) as exc:
            raise KeptError(f"{path} is no state of a soak: {exc}") from exc
        if not isinstance(found, dict) or found.get("soak") != VERSION:
            raise KeptError(f"{path} is no state of a soak, or of another version")
        return cls(found["options"], found["pieces"])

    @classmethod
    def of(cls, path: Path, options: Mapping[str, Any]) -> Kept:
        """The one that is there, or a new one.  Raises :class:`KeptError` if it began with other arguments."""
        wanted = {name: options[name] for name in KEPT_OPTIONS}
        if not path.exists():
            return cls(wanted)
        kept = cls.read(path)
        if differ := [name for name in KEPT_OPTIONS if kept.options.get(name) != wanted[name]]:
            told = ", ".join(f"--{name} {kept.options.get(name)}, not {wanted[name]}" for name in differ)
            raise KeptError(f"{path} is of a soak with {told}: go on with its arguments, or name another file")
        return kept

    @property
    def seconds(self) -> float:
        return sum(piece["seconds"] for piece in self.pieces)

    @property
    def left(self) -> float:
        """Seconds that are still to be run."""
        return max(0.0, self.options["hours"] * 3600 - self.seconds)

    @property
    def number(self) -> int:
        """Of the next piece."""
        return len(self.pieces) + 1

    @property
    def seed(self) -> int:
        """Of the next piece: all of its random choices follow from it."""
        return self.options["seed"] * PIECES + self.number

    def write(self, path: Path) -> None:
        """Replace the file: it is whole at every moment."""
        path.parent.mkdir(parents=True, exist_ok=True)
        fresh = path.with_name(f"{path.name}.new")
        text = json.dumps({"soak": VERSION, "options": self.options, "pieces": self.pieces}, default=str) + "\n"
        octets = text.encode()
        with fresh.open("wb") as file:
            file.write(lzma.compress(octets) if path.suffix == COMPRESSED else octets)
            file.flush()
            os.fsync(file.fileno())
        fresh.replace(path)


def commit() -> str:
    """Of the sources that run; with a plus sign if they are not as committed."""

    def git(*words: str) -> str:
        return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()

    try:
        return git("rev-parse", "--short=12", "HEAD") + ("+" if git("status", "--porcelain", "-uno") else "")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def machine() -> dict[str, Any]:
    """Where it runs."""
    return {
        "cores": len(os.sched_getaffinity(0)),
        "kernel": f"{platform.system()} {platform.release()}",
        "python": f"{platform.python_implementation()} {platform.python_version()}",
        "architecture": platform.machine(),
    }
