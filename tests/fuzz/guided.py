"""Fuzzing guided by coverage: inputs that reach new code are kept, and changed further (atheris, libFuzzer).

Each parser has a process of its own, in which the code that reads octets is instrumented.  It begins with the inputs of
the other fuzzing and with what was kept before; what reaches more is added to ``tests/fuzz/kept/TARGET.txt``, a line of
hexadecimal digits for each input, which the suite feeds to the parsers again.
"""

# ruff: noqa: T201 - what it prints is its answer

from __future__ import annotations

import argparse
import importlib.util
import os
import re
import subprocess
import sys
import tempfile
from fnmatch import fnmatchcase
from hashlib import sha1
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tests.fuzz.targets import Parser

__all__ = ["KEPT", "kept_inputs", "main"]

ROOT = Path(__file__).resolve().parents[2]
KEPT = Path(__file__).resolve().parent / "kept"
#: Packages whose branches guide.
INSTRUMENTED = [
    "pnfarm.wire",
    "pnfarm.protocols",
    "pnfarm.drives.profiles",
    "pnfarm.buses.profinet",
    "pnfarm.plant.fmi",
]
#: Inputs that are kept of a target, and their longest, octets.
MOST_KEPT, LONGEST = 40, 2048
#: Seconds of one input, megabytes of a process.
INPUT_SECONDS, MEGABYTES = 5, 2048
_FOUND = re.compile(r"cov: (\d+) ft: (\d+)")
_UNITS = re.compile(r"number_of_executed_units: (\d+)")


def _file(target: str) -> Path:
    return KEPT / f"{target}.txt"


def kept_inputs(target: str) -> list[bytes]:
    """What was kept of a target."""
    file = _file(target)
    return [bytes.fromhex(line) for line in file.read_text("ascii").split()] if file.exists() else []


def _keep(target: str, found: list[bytes]) -> int:
    """Add inputs, the shortest first; how many there are then."""
    kept = kept_inputs(target)
    for octets in sorted({one for one in found if len(one) <= LONGEST} - set(kept), key=lambda one: (len(one), one)):
        if len(kept) < MOST_KEPT:
            kept.append(octets)
    if kept:
        KEPT.mkdir(exist_ok=True)
        _file(target).write_text("".join(f"{octets.hex()}\n" for octets in kept), "ascii")
    return len(kept)


def _fuzz_here(target: str, arguments: list[str]) -> None:
    """Fuzz one target in this process, which libFuzzer ends."""
    import atheris

    with atheris.instrument_imports(include=INSTRUMENTED):
        from tests.fuzz.targets import parsers

    (parser,) = [one for one in parsers({"block": []}) if one.name == target]
    # what the parser raises but DecodeError is the finding
    atheris.Setup([sys.argv[0], *arguments], parser.feed)
    atheris.Fuzz()


def _fuzzed(parser: Parser, seconds: float) -> tuple[int, str]:
    """Exit code and report of one target's process; keeps what it found."""
    target = parser.name
    with tempfile.TemporaryDirectory(prefix="pnfarm-fuzz-") as folder:
        places = [Path(folder) / name for name in ("found", "seeds", "findings")]
        for place in places:
            place.mkdir()
        for octets in {*parser.pool, *kept_inputs(target)}:
            (places[1] / sha1(octets, usedforsecurity=False).hexdigest()).write_bytes(octets)
        command = [
            sys.executable, "-m", "tests.fuzz.guided", target, *map(str, places[:2]),
            f"-max_total_time={max(1, round(seconds))}", f"-max_len={LONGEST}", f"-timeout={INPUT_SECONDS}",
            f"-rss_limit_mb={MEGABYTES}", "-print_final_stats=1", f"-artifact_prefix={places[2]}/",
        ]  # fmt: skip
        # the instrumented engine cannot be compiled
        plain = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
        done = subprocess.run(
            command, cwd=ROOT, env=plain, capture_output=True, text=True, errors="replace", check=False
        )
        for artifact in places[2].iterdir():
            print(f"{target}: {artifact.name}: {artifact.read_bytes().hex()}", file=sys.stderr)
        if done.returncode != 0:
            print(done.stdout[-3000:], done.stderr[-6000:], sep="\n", file=sys.stderr)
        count = _keep(target, [one.read_bytes() for one in places[0].iterdir()])
        units, states = _UNITS.findall(done.stderr), _FOUND.findall(done.stderr)
    branches = states[-1][0] if states else "?"
    return done.returncode, f"{int(units[-1]) if units else 0:>10} {branches:>9} {count:>6}"


def _chosen(wanted: str) -> list[Parser]:
    from tests.fuzz.corpus import gather
    from tests.fuzz.machines_enip import enip_layers
    from tests.fuzz.targets import parsers

    return [one for one in parsers({**gather().layers, **enip_layers()}) if fnmatchcase(one.name, wanted)]


def main(options: argparse.Namespace) -> int:
    """All chosen parsers in turn, each for ``options.minutes``; 1 if one fails, 4 without atheris."""
    if importlib.util.find_spec("atheris") is None:
        print("tests.fuzz: --guided needs atheris: pip install atheris", file=sys.stderr)
        return 4
    worst = 0
    print(f"{'target':48} {'inputs':>10} {'branches':>9} {'kept':>6}")
    for parser in _chosen(options.target):
        code, report = _fuzzed(parser, options.minutes * 60)
        print(f"{parser.name:48} {report}{'' if code == 0 else '  failed: see above'}", flush=True)
        worst = max(worst, min(code, 1))
    return worst


if __name__ == "__main__":
    sys.path[:0] = [str(ROOT / "tests" / name) for name in ("support", "faults", "protocols/enip")]
    _fuzz_here(sys.argv[1], sys.argv[2:])
