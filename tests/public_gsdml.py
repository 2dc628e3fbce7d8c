"""``python -m tests.public_gsdml --out FOLDER``: makers' GSDML files from public repositories, and a sweep over them.

They are others' and stay out of this repository: ``protocols/profinet/gsdml_public.csv`` has repository, commit, path
(and the member of an archive) and SHA-256 of each.  ``--mirrors`` takes them from git repositories on this machine,
``OWNER+NAME/repo``, instead of from GitHub.  Then each file is plugged with every access point, module and submodule
and compared with another reader; a table says how many there were, what differed, and how long a file took to read.
The exit code is 1 where something differed or a file could not be had.
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

from tests.public_files import TESTS, run


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


if __name__ == "__main__":
    sys.exit(run("public_gsdml", __doc__ or "", TESTS / "protocols" / "profinet" / "gsdml_public.csv", report))
