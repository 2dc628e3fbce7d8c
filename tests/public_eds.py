"""``python -m tests.public_eds --out FOLDER``: makers' EDS files from public repositories, and a sweep over them.

They are others' and stay out of this repository: ``buses/ethernetip/eds_public.csv`` has repository, commit, path and
SHA-256 of each.  ``--mirrors`` takes them from git repositories on this machine, ``OWNER+NAME/repo``, instead of from
GitHub.  Then the built-in scanner opens each connection of each file in memory, and identity, sizes and paths are
compared with what a few patterns find in the text.  The exit code is 1 where something differed or a file could not be
had.
"""

from __future__ import annotations

import sys
from pathlib import Path

from tests.public_files import TESTS, Tally, run


def report(out: Path) -> int:
    """How many files differ from what the patterns find, or have a connection that nobody could open."""
    from eds_sweep import Sweep, eds_files

    tally = Tally()
    for path in eds_files(out):
        found = Sweep(path)
        tally.add(found.vendor_id, found.vendor, found.counts, found.findings)
        what = f"{found.counts['connections']} connections, read in {found.seconds:.2f} s"
        lines = [f"{path.name}: {what}", *(f"    {one}" for one in (*found.sentences, *found.findings))]
        sys.stdout.write("\n".join((*lines, "")))
    return tally.end()


if __name__ == "__main__":
    sys.exit(run("public_eds", __doc__ or "", TESTS / "buses" / "ethernetip" / "eds_public.csv", report))
