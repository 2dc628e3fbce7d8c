"""The whole suite on all cores: ``python -m tests [options of pytest]``.

Two runs of pytest at once:

- what lives in memory and virtual time, spread over the cores, with the scheduler's idle policy: it takes what the
  other leaves;
- what uses real time or the kernel's network (the marker ``exclusive``): mostly waiting, one file at a time, because
  what two of them do at once is late on two cores; behind it, with ``PNFARM_DOCKER=1`` or ``PNFARM_REQUIRE_ALL=1``, a
  swarm and the rig under Docker engines, whose images are built meanwhile, with the idle policy as well.

A test of real time that failed runs once more when nothing runs beside it: only then does its failure say more than
that the machine was busy.  More than :data:`MOST_AGAIN` of them are no accident.  Both runs are printed.

The replay comes last, because it takes what all others kept (:mod:`stepping`).  Where machine code is missing, one
process makes it first, and the tests that need none (the marker ``uncompiled``) run beside it.

Byte code is kept, whatever the environment says: else each of some hundred processes would compile the package anew.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from pnfarm.table.compiling.compiled import IS_COMPILED, is_cached
from tests.conftest import EXCLUSIVE, MIXED, REQUIRE_ALL, TESTS, UNCOMPILED

#: pytest's exit codes for all passed, and for nothing chosen.
PASSED, FAILED, NOTHING = 0, 1, 5
#: So many failed tests of real time, at most, run again on the quiet machine.
MOST_AGAIN = 5
CORES = os.cpu_count() or 1
REPLAY = TESTS / "engine" / "test_engine_replay.py"
#: The tests under Docker engines, in this order, as the last one removes the images; and what builds these.
RIGS = tuple(
    TESTS / "interop" / name for name in ("test_swarm_docker.py", "test_swarm_lost_docker.py", "test_rig_docker.py")
)
BUILD = TESTS / "interop" / "rig_engine.py"


def _environment(steps: str) -> dict[str, str]:
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    if kept.get(REQUIRE_ALL, "") not in {"", "0"}:
        kept["PNFARM_DOCKER"] = "1"
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


def _make_idle(process: int) -> None:
    """What it starts is idle, too."""
    os.sched_setscheduler(process, os.SCHED_IDLE, os.sched_param(0))


class Run:
    """One run of pytest; ``quiet``: what it prints is held back until it ended."""

    def __init__(
        self, arguments: list[str], environment: dict[str, str], *, quiet: bool = False, idle: bool = False
    ) -> None:
        self._output = tempfile.TemporaryFile() if quiet else None  # noqa: SIM115 - closed at the end
        command = [sys.executable, "-m", "pytest", *arguments]
        self._process = subprocess.Popen(
            command, env=environment, stdout=self._output, stderr=subprocess.STDOUT if quiet else None
        )
        if idle:
            _make_idle(self._process.pid)

    def end(self) -> int:
        """Wait for the end, and print what was held back; pytest's exit code."""
        code = self._process.wait()
        if self._output is not None:
            self._output.seek(0)
            shutil.copyfileobj(self._output, sys.stdout.buffer)
            sys.stdout.flush()
            self._output.close()
        return code


def _places(options: list[str]) -> list[str]:
    """Files and folders of real time; none where the options name some: collecting what is deselected takes long."""
    return [] if _chosen(options) else [str(path) for name in (*EXCLUSIVE, *MIXED) if (path := TESTS / name) != REPLAY]


def _only(paths: list[Path], options: list[str]) -> list[str]:
    """The options for the tests of these files alone, in their order."""
    chosen = _chosen(options)
    return [*(option for option in options if not (chosen and _chosen([option]))), *map(str, paths)]


def _wanted(path: Path, options: list[str]) -> bool:
    """Whether the options name this file, or nothing."""
    chosen = _chosen(options)
    return not chosen or any(path.is_relative_to(place) for place in chosen)


def _again(code: int, kept: Path, environment: dict[str, str]) -> int:
    """The exit code of a run that kept its failures in ``kept``; the few that failed run again, with nothing beside."""
    names = kept / "v" / "cache" / "lastfailed"
    failed = list(json.loads(names.read_text())) if code == FAILED and names.exists() else []
    if not 0 < len(failed) <= MOST_AGAIN:
        return code
    sys.stdout.write(f"these tests of real time failed while others ran, and run again alone: {', '.join(failed)}\n")
    sys.stdout.flush()
    return Run(["-o", f"cache_dir={kept}", *failed], environment).end()


@contextlib.contextmanager
def _images(environment: dict[str, str]) -> Iterator[subprocess.Popen[bytes]]:
    """Builds the images of the rig in a folder that ``environment`` names from then on."""
    # paths of unix sockets are short: not under pytest's own folder
    folder = tempfile.mkdtemp(prefix="pnfarm-rig-")
    environment["PNFARM_RIG"] = folder
    building = subprocess.Popen([sys.executable, str(BUILD), "build", folder])
    _make_idle(building.pid)
    try:
        yield building
    finally:
        building.terminate()
        building.wait()
        subprocess.run([sys.executable, str(BUILD), "remove", folder], check=True)


def _warmed(options: list[str], environment: dict[str, str]) -> Iterator[int]:
    """Makes the machine code that is missing, beside tests that need none; exit codes."""
    warming = subprocess.Popen([sys.executable, "-m", "pnfarm.engine.warm"], env=environment)
    beside = ["-n", str(CORES - 1), "--dist", "worksteal"] if CORES > 2 else []
    yield Run([*beside, "-m", "uncompiled and not exclusive", *options], environment).end()
    yield warming.wait()


def main(options: list[str]) -> int:
    """All runs, whatever becomes of one; 0 when all that was chosen passed."""
    codes: list[int] = []
    with contextlib.ExitStack() as stack:
        environment = _environment(stack.enter_context(tempfile.TemporaryDirectory(prefix="pnfarm-steps-")))
        kept = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="pnfarm-failed-")))
        rigs = [path for path in RIGS if environment.get("PNFARM_DOCKER") == "1" and _wanted(path, options)]
        images = stack.enter_context(_images(environment)) if rigs else None
        in_memory = "not exclusive"
        if _needs_code(options):
            codes += _warmed(options, environment)
            if codes[-1] != 0:
                return codes[-1]
            in_memory = "not uncompiled and not exclusive"
        spread = ["-n", str(CORES), "--dist", "worksteal"]
        apart = [f"--ignore={path}" for path in (REPLAY, *rigs)]
        beside = Run([*spread, "-m", in_memory, *options], environment, idle=True)
        alone = ["-m", "exclusive", "-o", f"cache_dir={kept}", *apart, *options, *_places(options)]
        # printed at once, in the midst of the other run's dots: where both take too long, it is known what failed
        in_real_time = Run(alone, environment, quiet=True).end()
        running = [beside]
        if images is not None:
            # what went wrong is told by the tests that need the images
            images.wait()
            running.append(Run(_only(rigs, options), environment, quiet=True))
        codes += [run.end() for run in running]
        codes.append(_again(in_real_time, kept, environment))
        if _wanted(REPLAY, options):
            codes.append(Run(_only([REPLAY], options), environment).end())
    if all(code == NOTHING for code in codes):
        return NOTHING
    return next((code for code in codes if code not in {PASSED, NOTHING}), PASSED)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
