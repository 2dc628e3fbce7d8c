"""What a report says of program and machine: versions, a digest of the package's files, processor, kernel."""

from __future__ import annotations

import hashlib
import importlib.metadata
import os
import platform
import shutil
import subprocess
from pathlib import Path

import pnfarm
from pnfarm.cli.verify.report import Host, Package, Versions
from pnfarm.version import __version__

__all__ = ["host", "package", "versions"]


def versions() -> Versions:
    installed = {name: importlib.metadata.version(name) for name in ("numba", "numpy")}
    return Versions(pnfarm=__version__, python=platform.python_version(), **installed)


def package(folder: Path | None = None) -> Package:
    """Digest of the files in ``folder``, by default this package's.

    As coreutils make it: ``find . -type f -not -path '*/__pycache__/*' -not -path './machine_code/*'
    | LC_ALL=C sort | xargs sha256sum | sha256sum``.
    """
    folder = folder or Path(pnfarm.__file__).parent
    # what is made of the other files
    made = {folder / "machine_code", *folder.rglob("__pycache__")}
    files = [path for path in folder.rglob("*") if path.is_file() and made.isdisjoint(path.parents)]
    found = sorted((f"./{path.relative_to(folder).as_posix()}", path) for path in files)
    lines = (f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {name}\n" for name, path in found)
    return Package(sha256=hashlib.sha256("".join(lines).encode()).hexdigest(), files=len(found))


def host() -> Host:
    return Host(
        processor=_cpuinfo("model name") or platform.processor() or platform.machine(),
        cores=os.cpu_count() or 1,
        usable_cores=len(os.sched_getaffinity(0)),
        architecture=platform.machine(),
        kernel=f"{platform.system()} {platform.release()}",
        virtualisation=_virtualisation(),
    )


def _cpuinfo(key: str) -> str:
    """The value of the first line with a key in ``/proc/cpuinfo``; empty without one."""
    try:
        text = Path("/proc/cpuinfo").read_text("utf-8", "replace")
    except OSError:
        return ""
    lines = (line.partition(":") for line in text.splitlines())
    return next((value.strip() for name, _, value in lines if name.strip() == key), "")


def _virtualisation() -> str:
    if shutil.which("systemd-detect-virt"):
        # `none` comes with exit code 1
        said = subprocess.run(["systemd-detect-virt"], capture_output=True, text=True, check=False).stdout.strip()
        if said:
            return said
    if "hypervisor" in _cpuinfo("flags").split():
        return "a hypervisor, of unknown kind"
    return "unknown"
