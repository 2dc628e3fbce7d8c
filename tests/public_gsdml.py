"""``python -m tests.public_gsdml --out FOLDER``: makers' GSDML files from public repositories, and a sweep over them.

They are others' and stay out of this repository: ``protocols/profinet/gsdml_public.csv`` has repository, commit, path
(and the member of an archive) and SHA-256 of each.  ``--mirrors`` takes them from git repositories on this machine,
``OWNER+NAME/repo``, instead of from GitHub.  Then each file is plugged with every access point, module and submodule
and compared with another reader, and each such device connects to the built-in controller in memory, as does a profile
drive under each file with PROFIdrive, by each of its telegrams; a table says how many there were, what differed, and
how long a file took to read.
The exit code is 1 where something differed or a file could not be had.
"""

from __future__ import annotations

import sys
from pathlib import Path

from tests.public_files import TESTS, Tally, run


def report(out: Path) -> int:
    """How many files differ from what the other reader finds."""
    from drive_gsdml_sweep import DriveSweep
    from gsdml_sweep import Sweep

    tally = Tally()
    for path in sorted(out.rglob("*.xml")):
        found = Sweep(path)
        found.connect()
        drives = DriveSweep(path, found.gsdml)
        found.findings += drives.findings
        tally.add(found.gsdml.vendor_id, found.gsdml.vendor_name, found.counts + drives.counts, found.findings)
        what = f"{found.counts['access points']} access points, {found.counts['modules']} modules"
        lines = [f"{path.name}: {found.gsdml.schema_version or 'no version'}, {what}, read in {found.seconds:.2f} s"]
        lines += [f"    {finding}" for finding in found.findings]
        sys.stdout.write("\n".join((*lines, "")))
    return tally.end()


if __name__ == "__main__":
    sys.exit(run("public_gsdml", __doc__ or "", TESTS / "protocols" / "profinet" / "gsdml_public.csv", report))
