"""The whole suite on all cores: ``python -m tests [options of pytest]``.

First what lives in memory and virtual time, spread over the cores; then, one after the other on a quiet machine, what
uses real time or the kernel's network (the marker ``exclusive``).  Where machine code is missing, one process makes
it for all of them, and the tests that need none (the marker ``uncompiled``) run beside it.

Byte code is kept, whatever the environment says: else each of some hundred processes would compile the package anew.
Steps of the firmware are kept for the replay (:mod:`stepping`), which is among the exclusive ones.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from pnfarm.table.compiled import IS_COMPILED, is_cached
from tests.conftest import TESTS, UNCOMPILED

#: pytest's exit codes for all passed, and for nothing chosen.
PASSED, NOTHING = 0, 5


def _environment(steps: str) -> dict[str, str]:
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return {"PNFARM_STEPS": steps, **kept}


def _needs_code(options: list[str]) -> bool:
    """Whether machine code is missing that what is chosen may call."""
    places = [Path(option.partition("::")[0]).resolve() for option in options]
    chosen = [place for place in places if place.is_relative_to(TESTS) and place.exists()]
    plain = [TESTS / folder for folder in UNCOMPILED]
    none_calls = bool(chosen) and all(any(place.is_relative_to(folder) for folder in plain) for place in chosen)
    return IS_COMPILED and not none_calls and not is_cached()


def _parts(cores: int, *, warming: bool) -> list[tuple[str, ...]]:
    spread = ("-n", str(cores), "--dist", "worksteal")
    if not warming:
        return [(*spread, "-m", "not exclusive"), ("-m", "exclusive")]
    beside = ("-n", str(cores - 1), "--dist", "worksteal") if cores > 2 else ()
    return [
        (*beside, "-m", "uncompiled and not exclusive"),
        (*spread, "-m", "not uncompiled and not exclusive"),
        ("-m", "exclusive"),
    ]


def main(options: list[str]) -> int:
    """All parts, whatever becomes of the first; 0 when all that was chosen passed."""
    codes = []
    with tempfile.TemporaryDirectory(prefix="pnfarm-steps-") as steps:
        environment = _environment(steps)
        warming = None
        if _needs_code(options):
            warming = subprocess.Popen([sys.executable, "-m", "pnfarm.engine.warm"], env=environment)
        for part in _parts(os.cpu_count() or 1, warming=warming is not None):
            run = subprocess.run([sys.executable, "-m", "pytest", *part, *options], check=False, env=environment)
            codes.append(run.returncode)
            if warming is not None and warming.wait() != 0:
                return warming.returncode
    if all(code == NOTHING for code in codes):
        return NOTHING
    return next((code for code in codes if code not in {PASSED, NOTHING}), PASSED)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
