"""``python -m tests.public_fmus --out FOLDER``: the Reference FMUs of the Modelica Association, FMI 2.0 and 3.0.

Their sources are others' and stay out of this repository: ``plant/fmus_public.csv`` has repository, commit, path and
SHA-256 of each.  Each FMU is built by ``cc``, runs as a model of a plant in virtual time, and is compared with the
outputs that come with its sources; where it can save its state, it is put back once.  The exit code is 1 where a file
could not be had, or an output differs.
"""

from __future__ import annotations

import csv
import platform
import subprocess
import sys
import zipfile
from math import isclose
from pathlib import Path

from tests.public_files import TESTS, run

PINS = TESTS / "plant" / "fmus_public.csv"
MODELS = ("BouncingBall", "Dahlquist", "Feedthrough", "Resource", "Stair", "VanDerPol")
STEP = 0.01
#: How much an output may differ: the reference steps with other lengths.
CLOSE = 1e-9


def report(out: Path) -> int:
    """How many of the FMUs give other outputs than those of their sources."""
    tree = out / "sources"
    with PINS.open(encoding="utf-8", newline="") as listed:
        for pin in csv.DictReader(listed):
            place = tree / pin["path"]
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_bytes((out / f"{pin['sha256'][:8]}-{place.name}").read_bytes())
    wrong = 0
    for name in MODELS:
        for version in (2, 3):
            rows, values, worst, steps = _compared(_built(tree, name, version, out), tree / name)
            bad = worst > CLOSE
            wrong += bad
            how = "differs" if bad else "equal"
            sys.stdout.write(f"| {name} | {version}.0 | {steps} | {rows} | {values} | {worst:.1g} | {how} |\n")
    return wrong


def _built(tree: Path, name: str, version: int, out: Path) -> Path:
    sources = [tree / name / "model.c", tree / "src" / f"fmi{version}Functions.c", tree / "src" / "cosimulation.c"]
    library = out / f"{name}.so"
    options = ("-shared", "-fPIC", "-O1", "-DDISABLE_PREFIX", f"-DFMI_VERSION={version}")
    includes = (f"-I{tree / 'include'}", f"-I{tree / name}")
    subprocess.run(["cc", *options, *includes, "-o", library, *sources, "-lm"], check=True)
    machine = platform.machine()
    folder = "linux64" if version == 2 and machine == "x86_64" else f"{machine}-linux"
    path = out / f"{name}-{version}.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.write(tree / name / f"FMI{version}.xml", "modelDescription.xml")
        archive.write(library, f"binaries/{folder}/{name}.so")
        if (tree / name / "y.txt").exists():
            archive.write(tree / name / "y.txt", "resources/y.txt")
    return path


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def _number(text: str) -> float:
    return float({"true": "1", "false": "0"}.get(text, text))


def _compared(path: Path, sources: Path) -> tuple[int, int, float, int]:
    """Rows and values that were compared, the largest difference, and the FMU's steps."""
    from plant_bench import PlantBench

    model = {"name": "fmu", "fmu": str(path), "step": "10ms"}
    bench = PlantBench(model, step="10ms")
    assert not bench.issues, bench.issues
    given = sources / f"{sources.name}_in.csv"
    inputs = _rows(given) if given.exists() else []
    known = set(bench.ports("fmu"))
    rows = _rows(sources / f"{sources.name}_out.csv")
    worst, values, steps = 0.0, 0, 0
    for number, row in enumerate(rows):
        count = round(float(row["time"]) / STEP)
        bench.step(count + 1 - steps)
        steps = count + 1
        if number == len(rows) // 2:
            bench.fmus.put_states(bench.fmus.states(bench.now)[0], bench.now)
        for name, text in row.items():
            if name not in known:
                continue
            found, expected = float(bench[f"fmu.{name}"]), _number(text)
            values += 1
            if not isclose(found, expected, rel_tol=CLOSE, abs_tol=CLOSE):
                worst = max(worst, abs(found - expected))
    # what flows in, whatever its type, flows out again
    for row in inputs:
        for name, text in row.items():
            if name in known:
                bench[f"fmu.{name}"] = _number(text)
        bench.step(2)
        for name, text in row.items():
            if name in known:
                values += 1
                worst = max(worst, abs(float(bench[f"fmu.{name.replace('input', 'output')}"]) - _number(text)))
    bench.fmus.close()
    return len(rows), values, worst, steps


if __name__ == "__main__":
    sys.exit(run("public_fmus", __doc__ or "", PINS, report))
