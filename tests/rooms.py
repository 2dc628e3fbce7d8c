"""What the tests of each room take on this machine: ``python -m tests.rooms [ROOM ...]``; a room is a folder of tests.

Each room runs as ``make test ARGS=tests/ROOM`` does.  A busy machine makes the first column longer; the second one
counts the work alone.
"""

from __future__ import annotations

import re
import resource
import subprocess
import sys
import time

from tests.conftest import TESTS


def _processor_seconds() -> float:
    """User and system time of all processes that this one waited for."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main(rooms: list[str]) -> int:
    """One line for each room; 1 if a test of one failed."""
    known = sorted({path.relative_to(TESTS).parts[0] for path in TESTS.glob("*/**/test_*.py")})
    if strange := [room for room in rooms if room not in known]:
        sys.stderr.write(f"no room of tests: {', '.join(strange)}; there are {', '.join(known)}\n")
        return 2
    failed = False
    sys.stdout.write(f"{'room':<12} {'seconds':>8} {'CPU s':>8} {'tests':>6}\n")
    for room in rooms or known:
        begun, used = time.monotonic(), _processor_seconds()
        done = subprocess.run(
            [sys.executable, "-m", "tests", "-q", str(TESTS / room)], capture_output=True, text=True, check=False
        )
        tests = sum(int(count) for count in re.findall(r"(\d+) passed", done.stdout))
        said = "" if done.returncode == 0 else "  failed"
        sys.stdout.write(
            f"{room:<12} {time.monotonic() - begun:>8.0f} {_processor_seconds() - used:>8.0f} {tests:>6}{said}\n"
        )
        sys.stdout.flush()
        if done.returncode != 0:
            failed = True
            sys.stderr.write(done.stdout[-3000:])
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
