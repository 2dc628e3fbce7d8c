"""Looks for known vulnerabilities of what is locked: ``python release/audit.py [LOCK ...] [--offline FOLDER]``.

Every version in the files of ``locks/`` that are named (``runtime.txt``: the image) is looked up, for every Python:
by pip-audit at PyPI, or OSV (``--service osv``); without a network, in a folder of advisories
(:mod:`advisories`).  A source that does not know a vulnerability that everybody knows (:data:`KNOWN`) has no data, and
what it does not report says nothing.

| exit code | |
|---|---|
| 0 | every package was looked up, none has a known vulnerability |
| 1 | at least one has |
| 2 | the command is wrong |
| 3 | not looked up, or not all: the source was out of reach, has no data, old data, or does not know a package |
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from datetime import UTC, date, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import yaml
from advisories import Advisories, Finding
from locked import ROOT, pinned

if TYPE_CHECKING:
    from collections.abc import Iterable

FOUND, NOT_LOOKED_UP = 1, 3
#: A version with vulnerabilities that every source has had for years.
KNOWN = ("jinja2", "2.10")
#: A folder whose newest advisory is older does not know today's vulnerabilities.
DAYS = 30
#: pip-audit takes one version of a package at a time, and locks have some packages in two.
_LINE = "{}=={}\n"


class NoAnswerError(Exception):
    """The source gave no answer, or one that says nothing; the message says which."""


def rounds(versions: Iterable[tuple[str, str]]) -> list[list[tuple[str, str]]]:
    """Lists with each package once, so that every version is in one of them."""
    made: list[list[tuple[str, str]]] = []
    for name, version in versions:
        for taken in made:
            if name not in {other for other, _ in taken}:
                taken.append((name, version))
                break
        else:
            made.append([(name, version)])
    return made


def ask(versions: list[tuple[str, str]], command: list[str]) -> tuple[list[Finding], list[str]]:
    """pip-audit's findings, and a sentence for each package that the source does not know."""
    found, unknown = [], []
    for taken in rounds(versions):
        with tempfile.TemporaryDirectory(prefix="pnfarm-audit-") as folder:
            wanted = Path(folder, "wanted.txt")
            wanted.write_text("".join(_LINE.format(*one) for one in taken), "utf-8")
            out = Path(folder, "found.json")
            done = subprocess.run(
                [*command, "--requirement", str(wanted), "--output", str(out)],
                capture_output=True, text=True, check=False,
            )  # fmt: skip
            # 0 and 1 both come with a report; a traceback has 1 and none
            if not out.exists() or not (text := out.read_text("utf-8").strip()):
                raise NoAnswerError((done.stderr.strip().splitlines() or ["pip-audit wrote nothing"])[-1])
        told = {one["name"]: one for one in json.loads(text)["dependencies"]}
        for name, version in taken:
            if "vulns" not in told.get(name, {}):
                unknown.append(f"{name} {version}: {told.get(name, {}).get('skip_reason', 'not in the answer')}")
                continue
            for one in told[name]["vulns"]:
                ids = (one["id"], *sorted(one["aliases"]))
                found.append(Finding(name, version, ids, tuple(one["fix_versions"])))
    return found, unknown


def look(versions: list[tuple[str, str]], source: str, offline: Path | None) -> tuple[list[Finding], list[str], str]:
    """Findings, what the source does not know, and the source's name; raises NoAnswerError."""
    if offline is not None:
        try:
            read = Advisories(offline)
            found = [finding for one in [KNOWN, *versions] for finding in read.of(*one)]
            age = (datetime.now(UTC).date() - date.fromisoformat(read.newest[:10])).days
        except (OSError, ValueError, yaml.YAMLError) as error:
            raise NoAnswerError(str(error)) from error
        name = f"{read.count} advisories in {offline}, the newest of {read.newest[:10]}"
        unknown = [f"what became known in the last {age} days: get newer advisories"] if age > DAYS else []
    else:
        name = f"pip-audit, {source}"
        command = [
            sys.executable, "-m", "pip_audit", "--no-deps", "--disable-pip", "--progress-spinner", "off",
            "--vulnerability-service", source, "--format", "json", "--aliases", "on", "--desc", "off",
        ]  # fmt: skip
        found, unknown = ask([KNOWN, *versions], command)
    if not any((finding.package, finding.version) == KNOWN for finding in found):
        raise NoAnswerError(f"{name} does not know that {' '.join(KNOWN)} is vulnerable, so it has no data")
    wanted = set(versions)
    return [finding for finding in found if (finding.package, finding.version) in wanted], unknown, name


def main(arguments: list[str] | None = None) -> int:
    """Print a line for each vulnerability, or that there is none, or why nobody looked."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    names = sorted(path.name for path in (ROOT / "locks").glob("*.txt"))
    parser.add_argument("lock", nargs="*", metavar="LOCK", help=f"of {', '.join(names)} (runtime.txt)")
    parser.add_argument("--offline", type=Path, metavar="FOLDER", help="advisories on this machine, instead of asking")
    parser.add_argument("--service", choices=("pypi", "osv"), default="pypi", help="whom pip-audit asks (pypi)")
    options = parser.parse_args(arguments)
    if unknown_names := sorted(set(options.lock) - set(names)):
        parser.error(f"locks/ has no {', '.join(unknown_names)}")
    locks = options.lock or ["runtime.txt"]
    versions = sorted({(name, version) for lock in locks for name, of in pinned(lock).items() for version in of})
    try:
        found, unknown, source = look(versions, options.service, options.offline)
    except NoAnswerError as error:
        sys.stderr.write(f"not looked up: {error}\n")
        return NOT_LOOKED_UP
    for finding in found:
        fixed = f", fixed in {', '.join(finding.fixed)}" if finding.fixed else ""
        sys.stdout.write(f"{finding.package} {finding.version}: {', '.join(finding.ids)}{fixed}\n")
    for sentence in unknown:
        sys.stderr.write(f"not looked up: {sentence}\n")
    vulnerable = len({(finding.package, finding.version) for finding in found})
    if unknown:
        source = f"not looked up completely, {source}"
    said = f"{vulnerable or 'none'} with a known vulnerability"
    sys.stdout.write(f"of {len(versions)} versions of {', '.join(locks)} {said} ({source})\n")
    if found:
        return FOUND
    return NOT_LOOKED_UP if unknown else 0


if __name__ == "__main__":
    sys.exit(main())
