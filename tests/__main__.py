"""The whole suite on all cores: ``python -m tests [options of pytest]``.

First what lives in memory and virtual time, spread over the cores; then, one after the other on a quiet machine, what
uses real time, processes of its own or the kernel's network (the marker ``exclusive``).
"""

from __future__ import annotations

import subprocess
import sys

PARTS = (
    ("-n", "logical", "--dist", "worksteal", "-m", "not exclusive"),
    ("-m", "exclusive"),
)
#: pytest's exit codes for all passed, and for nothing chosen.
PASSED, NOTHING = 0, 5


def main(options: list[str]) -> int:
    """Both parts, whatever becomes of the first; 0 when all that was chosen passed."""
    codes = [
        subprocess.run([sys.executable, "-m", "pytest", *part, *options], check=False).returncode for part in PARTS
    ]
    if all(code == NOTHING for code in codes):
        return NOTHING
    return next((code for code in codes if code not in {PASSED, NOTHING}), PASSED)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
