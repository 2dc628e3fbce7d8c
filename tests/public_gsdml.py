"""``python -m tests.public_gsdml --out FOLDER``: makers' GSDML files from public repositories, and a sweep over them.

They are others' and stay out of this repository: ``protocols/profinet/gsdml_public.csv`` has repository, commit, path
(and the member of an archive) and SHA-256 of each.  ``--mirrors`` takes them from git repositories on this machine,
``OWNER+NAME/repo``, instead of from GitHub.  Then each file is plugged with every access point, module and submodule
and compared with another reader; a table says how many there were, what differed, and how long a file took to read.
The exit code is 1 where something differed or a file could not be had.
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
from urllib.parse import quote

TESTS = Path(__file__).resolve().parent
PINS = TESTS / "protocols" / "profinet" / "gsdml_public.csv"


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


def fetch(out: Path, mirrors: Path | None) -> int:
    """How many of the listed files could not be had."""
    out.mkdir(parents=True, exist_ok=True)
    missing = 0
    with PINS.open(encoding="utf-8", newline="") as listed:
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


def report(out: Path) -> int:
    """How many files differ from what the other reader finds."""
    from gsdml_sweep import Sweep

    counts: Counter[str] = Counter()
    makers: Counter[str] = Counter()
    differing = 0
    for path in sorted(out.rglob("*.xml")):
        found = Sweep(path)
        counts += found.counts
        makers[found.gsdml.vendor_name] += 1
        differing += bool(found.findings)
        what = f"{found.counts['access points']} access points, {found.counts['modules']} modules"
        lines = [f"{path.name}: {found.gsdml.schema_version or 'no version'}, {what}, read in {found.seconds:.2f} s"]
        lines += [f"    {finding}" for finding in found.findings]
        sys.stdout.write("\n".join((*lines, "")))
    sys.stdout.write(
        f"\n{sum(makers.values())} files of {len(makers)} makers; {differing} differ\n"
        f"{', '.join(f'{number} {name}' for name, number in sorted(counts.items()))}\n"
        f"{', '.join(f'{name} {number}' for name, number in makers.most_common())}\n"
    )
    return differing


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m tests.public_gsdml", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("--out", type=Path, required=True, help="folder for the files")
    parser.add_argument("--mirrors", type=Path, help="folder of git repositories, OWNER+NAME/repo")
    options = parser.parse_args()
    sys.path.insert(0, str(TESTS / "support"))
    missing = fetch(options.out, options.mirrors)
    return 1 if missing + report(options.out) else 0


if __name__ == "__main__":
    sys.exit(main())
