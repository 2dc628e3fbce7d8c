"""``python -m tests.public_gsd --out FOLDER``: makers' GSD files from public repositories, and a sweep over them.

They are others' and stay out of this repository: ``protocols/profibus/gsd_public.csv`` has repository, commit, path and
SHA-256 of each.  ``--mirrors`` takes them from git repositories on this machine, ``OWNER+NAME/repo``, instead of from
GitHub.  Then each module of each file is plugged, and compared with what a few patterns find in the text.  The exit
code is 1 where something differed or a file could not be had.
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

from tests.public_files import TESTS, run


def report(out: Path) -> int:
    """How many files differ from what the patterns find."""
    from gsd_sweep import Sweep, gsd_files

    counts: Counter[str] = Counter()
    differing = 0
    for path in gsd_files(out):
        found = Sweep(path)
        counts += found.counts
        differing += bool(found.findings)
        what = f"{found.counts['modules']} modules, {found.counts['warnings']} warnings, read in {found.seconds:.2f} s"
        sys.stdout.write("\n".join((f"{path.name}: {what}", *(f"    {one}" for one in found.findings), "")))
    sys.stdout.write(
        f"\n{differing} differ; {', '.join(f'{number} {name}' for name, number in sorted(counts.items()))}\n"
    )
    return differing


if __name__ == "__main__":
    sys.exit(run("public_gsd", __doc__ or "", TESTS / "protocols" / "profibus" / "gsd_public.csv", report))
