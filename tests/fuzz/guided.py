"""Fuzzing guided by coverage: inputs that reach new code are kept, and changed further (atheris, libFuzzer).

One process imports the code that reads octets, instrumented, and makes the inputs of the other fuzzing.  Each turn of a
target is a fork of it, which begins with those inputs and with what was found before.  A target is a parser, or a
protocol machine that is fed a sequence of messages.  What a parser's inputs reach beyond the ones that it began with is
kept, a line of hexadecimal digits for each, in ``tests/fuzz/kept/TARGET.txt``; the suite feeds it to the parsers again.
"""

# ruff: noqa: T201 - what it prints is its answer

from __future__ import annotations

import argparse
import ctypes
import gc
import importlib.util
import io
import json
import os
import re
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Iterable, Mapping
from contextlib import redirect_stderr
from fnmatch import fnmatchcase
from hashlib import sha1
from pathlib import Path
from random import Random
from typing import TYPE_CHECKING

from tests.fuzz import campaign

if TYPE_CHECKING:
    from tests.fuzz.sequences import Target

__all__ = ["KEPT", "kept_inputs", "main"]

ROOT = Path(__file__).resolve().parents[2]
KEPT = Path(__file__).resolve().parent / "kept"
#: Packages whose branches guide.  Compiled code is in none of them.
INSTRUMENTED = (
    "pnfarm.wire",
    "pnfarm.protocols",
    "pnfarm.drives.profiles",
    "pnfarm.buses.profinet",
    "pnfarm.plant.fmi",
    "pnfarm.captures",
    "pnfarm.farm.state",
    "pnfarm.buses.projects",
    "pnfarm.buses.ethernetip.decode",
)
#: Kept of a parser: inputs, the longest one, and all of them together, octets.
MOST_KEPT, LONGEST, ALL_KEPT = 40, 2048, 2500
#: The longest input to begin with and to try, octets, unless all that there are to begin with are longer.
LONGEST_TRIED = 16384
#: Seconds of one input on a machine that may be busy, megabytes of a process.
INPUT_SECONDS, MEGABYTES = 25, 2048
_FOUND = re.compile(r"cov: (\d+) ft: (\d+)")
_DONE = re.compile(r"^Done (\d+) runs in (\d+) second", re.MULTILINE)
_UNITS = re.compile(r"number_of_executed_units: (\d+)")
_FEATURES = re.compile(r"^FT (\d+)((?: \d+)*)$", re.MULTILINE)


def _file(target: str) -> Path:
    return KEPT / f"{target}.txt"


def kept_inputs(target: str) -> list[bytes]:
    """What was kept of a target."""
    file = _file(target)
    return [bytes.fromhex(line) for line in file.read_text("ascii").split()] if file.exists() else []


def _smallest(features: Mapping[bytes, frozenset[int]], known: Iterable[int]) -> list[bytes]:
    """Few and short inputs that reach what they all reach beyond ``known``, the most telling ones first."""
    reached = set(known)
    chosen: list[bytes] = []
    room = ALL_KEPT
    left = {octets: found - reached for octets, found in features.items()}
    while len(chosen) < MOST_KEPT:
        left = {
            octets: found - reached
            for octets, found in left.items()
            if len(octets) <= min(LONGEST, room) and found - reached
        }
        if not left:
            break
        best = min(left, key=lambda one: (-len(left[one]) / (len(one) + 1), one))
        reached |= left[best]
        room -= len(best)
        chosen.append(best)
    return chosen


def _keep(target: str, inputs: list[bytes]) -> None:
    if inputs:
        KEPT.mkdir(exist_ok=True)
        text = "".join(f"{octets.hex()}\n" for octets in sorted(inputs, key=lambda one: (len(one), one)))
        _file(target).write_text(text, "ascii")
    else:
        _file(target).unlink(missing_ok=True)


def _forked(target: Target, arguments: list[str], told: Path) -> int:
    """libFuzzer with these arguments in a process of its own, which writes to ``told``; its exit code."""
    child = os.fork()
    if child:
        try:
            return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        except KeyboardInterrupt:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            raise
    try:
        os.nice(5)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        with told.open("wb") as file:
            os.dup2(file.fileno(), 1)
            os.dup2(file.fileno(), 2)
        import atheris

        def mutate(data: bytes, size: int, seed: int) -> bytes:
            """Half of the time in the target's own way, else in libFuzzer's."""
            rng = Random(seed)
            return (target.vary(rng, [data]) if rng.random() < 0.5 else bytes(atheris.Mutate(data, len(data))))[:size]

        feed = target.starter()
        if target.pool:
            feed(target.pool[0])  # what is imported with the first input is not that input's time
        # what the target raises is the finding
        atheris.Setup(["fuzz", *arguments], feed, **({} if target.vary is None else {"custom_mutator": mutate}))
        atheris.Fuzz()
    except BaseException:  # noqa: BLE001 - what Python would do next is not the fork's business
        traceback.print_exc()
    finally:
        # not os._exit: at the end of a process libFuzzer writes the input that ended it
        ctypes.CDLL(None).exit(70)


def _named(folder: Path, inputs: Iterable[bytes]) -> list[Path]:
    """Each input a file of this folder, named by its digest as libFuzzer names them."""
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for octets in inputs:
        files.append(folder / sha1(octets, usedforsecurity=False).hexdigest())
        files[-1].write_bytes(octets)
    return files


def _begin_with(target: Target) -> list[bytes]:
    short = [octets for octets in target.pool if len(octets) <= LONGEST_TRIED]
    return list({*(short or [min(target.pool, key=len)]), *kept_inputs(target.name)}) if target.pool else []


def _turn(target: Target, seconds: float, found: Path, folder: Path) -> campaign.Turn:
    """One turn in an empty ``folder``; what reaches more is added to ``found``."""
    seeds = _named(folder / "seeds", _begin_with(target))
    found.mkdir(parents=True, exist_ok=True)
    findings, told = folder / "findings", folder / "told"
    findings.mkdir()
    longest = max([LONGEST, *(file.stat().st_size * 5 // 4 for file in seeds)])
    limits = [f"-max_len={longest}", f"-timeout={INPUT_SECONDS}", f"-rss_limit_mb={MEGABYTES}"]
    began = time.monotonic()
    code = _forked(
        target,
        [
            str(found), str(folder / "seeds"), f"-max_total_time={max(1, round(seconds))}", "-print_final_stats=1",
            f"-artifact_prefix={findings}/", *limits,
        ],
        told,
    )  # fmt: skip
    took = time.monotonic() - began
    text = told.read_text(errors="replace")
    units, states, done = _UNITS.findall(text), _FOUND.findall(text), _DONE.findall(text)
    broken = [artifact.read_bytes().hex() for artifact in sorted(findings.iterdir())]
    if code != 0:
        print(f"{target.name}: exit code {code}", *broken, text[-6000:], sep="\n", file=sys.stderr)
    if target.kept:
        _minimise(target, seeds, found, folder)
    edges, features = map(int, states[-1]) if states else (0, 0)
    return campaign.Turn(
        int(units[-1]) if units else 0,
        float(done[-1][1]) if done else took,
        edges,
        features,
        len(kept_inputs(target.name)),
        code,
        broken,
    )


def _minimise(target: Target, seeds: list[Path], found: Path, folder: Path) -> None:
    """Keep the fewest of ``found`` that reach what ``seeds`` do not.  libFuzzer's inner step of a merge measures."""
    pool = set(target.pool)
    files = [*seeds, *sorted(found.iterdir())]
    inputs = [file.read_bytes() for file in files]
    control = folder / "control"
    control.write_text(f"{len(files)}\n0\n" + "".join(f"{file}\n" for file in files))
    arguments = ["-merge_inner=1", f"-merge_control_file={control}", f"-max_len={1 << 20}", f"-timeout={INPUT_SECONDS}"]
    _forked(target, arguments, folder / "merge")
    features = {
        inputs[int(number)]: frozenset(map(int, numbers.split()))
        for number, numbers in _FEATURES.findall(control.read_text())
    }
    known = {feature for octets, reached in features.items() if octets in pool for feature in reached}
    _keep(target.name, _smallest({octets: r for octets, r in features.items() if octets not in pool}, known))


def _instrumented(wanted: str) -> list[Target]:
    """The targets, in code that tells what it reaches."""
    import atheris

    names = [
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
        for path in ROOT.glob("pnfarm/**/*.py")
    ]
    # atheris takes the first part of a name alone; what is compiled must stay out
    others = [name for name in names if not any(f"{name}.".startswith(f"{part}.") for part in INSTRUMENTED)]
    # it says a line for each module
    with redirect_stderr(io.StringIO()), atheris.instrument_imports(include=["pnfarm"], exclude=others):
        from tests.fuzz.sequences import targets
    return [target for target in targets() if fnmatchcase(target.name, wanted)]


def _run(options: argparse.Namespace) -> int:
    """In the instrumented process; 1 if a target failed."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    chosen = {target.name: target for target in _instrumented(options.target)}
    gc.collect()
    gc.freeze()
    state = campaign.State.read(Path(options.state)) if options.state else campaign.State(None)
    folder = Path(tempfile.mkdtemp(prefix="pnfarm-fuzz-"))
    found = Path(f"{options.state}.inputs") if options.state else folder / "found"
    end = time.monotonic() + options.seconds if options.seconds else float("inf")
    print(campaign.HEADER)
    worst = 0
    try:
        for name in state.order(chosen, endless=bool(options.state)):
            turn = _turn(chosen[name], options.minutes * 60, found / name, folder / "turn")
            shutil.rmtree(folder / "turn")
            state.add(name, turn)
            print(state.row(name), flush=True)
            worst = max(worst, turn.code != 0)
            if time.monotonic() > end:
                break
    except KeyboardInterrupt:
        print("stopped; the same command goes on", file=sys.stderr)
    finally:
        shutil.rmtree(folder)
    return int(worst)


def main(options: argparse.Namespace) -> int:  # noqa: RET503 - the last statement does not return
    """Each chosen target in turn for ``options.minutes``; 1 if one fails, 4 without atheris."""
    if importlib.util.find_spec("atheris") is None:
        print("tests.fuzz: --guided needs atheris: pip install atheris", file=sys.stderr)
        return 4
    wanted = {name: getattr(options, name) for name in ("target", "minutes", "seconds", "state")}
    # a new process: in this one the code is there already, and tells nothing
    os.execv(sys.executable, [sys.executable, "-m", "tests.fuzz.guided", json.dumps(wanted)])


if __name__ == "__main__":
    sys.path[:0] = [str(ROOT / "tests" / name) for name in ("support", "faults", "protocols/enip")]
    sys.exit(_run(argparse.Namespace(**json.loads(sys.argv[1]))))
