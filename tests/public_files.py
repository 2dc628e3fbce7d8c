"""Makers' files from public repositories, which are others' and stay out of this one.

A list has repository, commit, path (and the member of an archive) and SHA-256 of each.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import io
import subprocess
import sys
import urllib.request
import zipfile
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

__all__ = ["TESTS", "Tally", "run"]

TESTS = Path(__file__).resolve().parent


class Tally:
    """What a sweep found in files of several makers, who are counted by number and by name."""

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()
        self._names: Counter[str] = Counter()
        self._numbers: set[int] = set()
        self._differing = 0

    def add(self, number: int, name: str, counts: Counter[str], findings: Sequence[str]) -> None:
        self._counts += counts
        self._names[name] += 1
        self._numbers.add(number)
        self._differing += bool(findings)

    def end(self) -> int:
        """Print the sums; how many files differ."""
        makers = f"{len(self._numbers)} makers by their numbers, {len(self._names)} by their names"
        sys.stdout.write(
            f"\n{self._names.total()} files of {makers}; {self._differing} differ\n"
            f"{', '.join(f'{number} {name}' for name, number in sorted(self._counts.items()))}\n"
            f"{', '.join(f'{name} {number}' for name, number in self._names.most_common())}\n"
        )
        return self._differing


def octets_of(pin: dict[str, str], mirrors: Path | None) -> bytes:
    """The file; raises :class:`OSError` where it cannot be had, and :class:`ValueError` if it is another one."""
    if mirrors is None:
        url = f"https://raw.githubusercontent.com/{pin['repository']}/{pin['commit']}/{quote(pin['path'])}"
        with urllib.request.urlopen(url, timeout=30) as answer:
            data = answer.read()
    else:
        folder = mirrors / pin["repository"].replace("/", "+") / "repo"
        asked = ("git", "-C", str(folder), "show", f"{pin['commit']}:{pin['path']}")
        done = subprocess.run(asked, capture_output=True, check=False)
        if done.returncode:
            raise OSError(done.stderr.decode(errors="replace").strip())
        data = done.stdout
    if pin["member"]:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            data = archive.read(pin["member"])
    if hashlib.sha256(data).hexdigest() != pin["sha256"]:
        raise ValueError("it has another SHA-256 than the list")
    return data


def fetch(pins: Path, out: Path, mirrors: Path | None) -> int:
    """How many of the listed files could not be had."""
    out.mkdir(parents=True, exist_ok=True)
    missing = 0
    with pins.open(encoding="utf-8", newline="") as listed:
        for pin in csv.DictReader(listed):
            path = out / f"{pin['sha256'][:8]}-{Path(pin['member'] or pin['path']).name}"
            if path.exists():
                continue
            try:
                path.write_bytes(octets_of(pin, mirrors))
            except (OSError, ValueError) as error:
                missing += 1
                sys.stderr.write(f"{pin['repository']}, {pin['path']}: {error}\n")
    return missing


def run(program: str, doc: str, pins: Path, report: Callable[[Path], int]) -> int:
    """Fetch the files and report on them; 1 where one is missing, or ``report`` counts any that is wrong."""
    parser = argparse.ArgumentParser(prog=f"python -m tests.{program}", description=doc.partition("\n")[0])
    parser.add_argument("--out", type=Path, required=True, help="folder for the files")
    parser.add_argument("--mirrors", type=Path, help="folder of git repositories, OWNER+NAME/repo")
    options = parser.parse_args()
    sys.path.insert(0, str(TESTS / "support"))
    missing = fetch(pins, options.out, options.mirrors)
    return 1 if missing + report(options.out) else 0
