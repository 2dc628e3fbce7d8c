"""FMUs for tests: one in C, built by this machine's compiler, and others written in Python by pythonfmu3."""

from __future__ import annotations

import io
import platform
import shutil
import subprocess
import zipfile
from importlib.util import find_spec
from pathlib import Path

import pytest

__all__ = ["DESCRIPTION", "TROUBLE", "bench_fmu", "needs_fmpy", "python_fmu", "zipped"]

SOURCES = Path(__file__).parents[1] / "plant" / "fmu_sources"
DESCRIPTION = (SOURCES / "bench.xml").read_text("utf-8")
LIBRARY = (
    "binaries/linux64/bench.so" if platform.machine() == "x86_64" else f"binaries/{platform.machine()}-linux/bench.so"
)
#: What `trouble` of the FMU in C means.
TROUBLE = ("none", "crash", "hang", "gated", "refuse", "not a number", "exit", "last")
needs_fmpy = pytest.mark.skipif(find_spec("fmpy") is None, reason="needs the package fmpy")


def zipped(members: dict[str, str | bytes]) -> bytes:
    """A zip file with these."""
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return whole.getvalue()


def bench_fmu(folder: Path, description: str = DESCRIPTION) -> Path:
    """The FMU in C, in a folder; without a compiler the test is skipped."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("needs a C compiler (apt-get install gcc)")
    library = folder / "bench.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-O1", "-o", library, SOURCES / "bench.c", "-lm"], check=True)
    path = folder / "bench.fmu"
    path.write_bytes(zipped({"modelDescription.xml": description, LIBRARY: library.read_bytes()}))
    return path


def python_fmu(script: str, folder: Path) -> Path:
    """An FMU of `fmu_sources/SCRIPT`, FMI 3.0."""
    builder = pytest.importorskip("pythonfmu3.builder", reason="needs the package pythonfmu3")
    return builder.FmuBuilder.build_FMU(SOURCES / script, dest=folder)
