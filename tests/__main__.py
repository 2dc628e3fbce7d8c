"""The whole suite on all cores: ``python -m tests [options of pytest]``.

First what lives in memory and virtual time, spread over the cores; then, one after the other on a quiet machine, what
uses real time or the kernel's network (the marker ``exclusive``).  Where machine code is missing, one process makes
it for all of them, and the tests that need none (the marker ``uncompiled``) run beside it.  With ``PNFARM_DOCKER=1``
the images of the rig are built beside the first part: that is mostly waiting for packages.

Byte code is kept, whatever the environment says: else each of some hundred processes would compile the package anew.
Steps of the firmware are kept for the replay (:mod:`stepping`), which is among the exclusive ones.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from pnfarm.table.compiled import IS_COMPILED, is_cached
from tests.conftest import EXCLUSIVE, MIXED, TESTS, UNCOMPILED

#: pytest's exit codes for all passed, and for nothing chosen.
PASSED, NOTHING = 0, 5
#: The tests of the rig under a Docker engine, and what builds its images.
RIG, BUILD = TESTS / "interop" / "test_rig_docker.py", TESTS / "interop" / "rig_engine.py"


def _environment(steps: str) -> dict[str, str]:
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return {"PNFARM_STEPS": steps, **kept}


def _chosen(options: list[str]) -> list[Path]:
    """The folders and files that the options name."""
    places = [Path(option.partition("::")[0]).resolve() for option in options]
    return [place for place in places if place.is_relative_to(TESTS) and place.exists()]


def _needs_code(options: list[str]) -> bool:
    """Whether machine code is missing that what is chosen may call."""
    chosen = _chosen(options)
    plain = [TESTS / folder for folder in UNCOMPILED]
    none_calls = bool(chosen) and all(any(place.is_relative_to(folder) for folder in plain) for place in chosen)
    return IS_COMPILED and not none_calls and not is_cached()


def _parts(cores: int, options: list[str], *, warming: bool) -> list[list[str]]:
    """The arguments of each run of pytest."""
    spread = ["-n", str(cores), "--dist", "worksteal"]
    # collecting what is deselected anyhow takes longer than many a test
    places = [] if _chosen(options) else [str(TESTS / name) for name in (*EXCLUSIVE, *MIXED)]
    exclusive = ["-m", "exclusive", *options, *places]
    if not warming:
        return [[*spread, "-m", "not exclusive", *options], exclusive]
    beside = ["-n", str(cores - 1), "--dist", "worksteal"] if cores > 2 else []
    return [
        [*beside, "-m", "uncompiled and not exclusive", *options],
        [*spread, "-m", "not uncompiled and not exclusive", *options],
        exclusive,
    ]


@contextlib.contextmanager
def _images(options: list[str], environment: dict[str, str]) -> Iterator[subprocess.Popen[bytes] | None]:
    """Builds the images of the rig, where its tests are chosen, in a folder that ``environment`` names from then on."""
    chosen = _chosen(options)
    if environment.get("PNFARM_DOCKER") != "1" or (chosen and not any(RIG.is_relative_to(place) for place in chosen)):
        yield None
        return
    # paths of unix sockets are short: not under pytest's own folder
    folder = tempfile.mkdtemp(prefix="pnfarm-rig-")
    environment["PNFARM_RIG"] = folder
    building = subprocess.Popen([sys.executable, str(BUILD), "build", folder])
    try:
        yield building
    finally:
        building.terminate()
        building.wait()
        subprocess.run([sys.executable, str(BUILD), "remove", folder], check=True)


def main(options: list[str]) -> int:
    """All parts, whatever becomes of the first; 0 when all that was chosen passed."""
    codes = []
    with contextlib.ExitStack() as stack:
        environment = _environment(stack.enter_context(tempfile.TemporaryDirectory(prefix="pnfarm-steps-")))
        building = stack.enter_context(_images(options, environment))
        warming = None
        if _needs_code(options):
            warming = subprocess.Popen([sys.executable, "-m", "pnfarm.engine.warm"], env=environment)
        *spread, exclusive = _parts(os.cpu_count() or 1, options, warming=warming is not None)
        for part in spread:
            codes.append(_pytest(part, environment))
            if warming is not None and warming.wait() != 0:
                return warming.returncode
        if building is not None:
            # the machine is to be quiet; what went wrong is told by the tests that need the images
            building.wait()
        codes.append(_pytest(exclusive, environment))
    if all(code == NOTHING for code in codes):
        return NOTHING
    return next((code for code in codes if code not in {PASSED, NOTHING}), PASSED)


def _pytest(arguments: list[str], environment: dict[str, str]) -> int:
    return subprocess.run([sys.executable, "-m", "pytest", *arguments], check=False, env=environment).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
