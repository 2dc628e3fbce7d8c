"""Can this machine run a farm?  Checks, tries, and names the remedy for what is missing.

What can only be known by trying (real-time scheduling, each kind of interface) is tried by a separate process
in a temporary namespace (:mod:`pnfarm.links.kernel.probe`).  The machine is not changed.
"""

from __future__ import annotations

import ctypes
import importlib.metadata
import json
import os
import platform
import resource
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from pnfarm.farm.process.address_space import ENGINE
from pnfarm.links.kernel import namespace_settings
from pnfarm.links.kernel.capabilities import NET_ADMIN, NET_RAW, effective
from pnfarm.links.kernel.capabilities import remedy as rights_remedy
from pnfarm.links.kernel.packet import RECEIVE_BUFFER
from pnfarm.links.kernel.probe import TRIALS
from pnfarm.table.compiling.compiled import IS_COMPILED, cache_directory, is_cached

__all__ = ["Finding", "examine"]

_PR_GET_TIMERSLACK = 30
_OLDEST_KERNEL = (4, 20)  # PACKET_IGNORE_OUTGOING
_PROBE_SECONDS = 30.0

_PYTHON = (3, 11)
_PYTHON_TOO_NEW = (3, 14)


@dataclass(frozen=True, slots=True)
class Finding:
    """The result of one check.

    ``ok`` True: as it should be; False: a farm (or a kind of link) does not work; None: works, but not at its best, or
    could not be determined.  ``remedy`` is the command or the change that fixes it, empty when nothing is wrong.
    ``line``: of the farm file, 0 for none; ``keeps_red``: the farm runs, but its PLC does not get green.
    """

    name: str
    ok: bool | None
    detail: str
    remedy: str = ""
    line: int = 0
    keeps_red: bool = False


def examine() -> list[Finding]:
    """Every finding, most basic first.  Takes about a second; never raises for what the machine lacks."""
    mask = effective()
    trials = _try()
    return [
        _python(),
        _package("numba"),
        _package("numpy"),
        _compiler_cache(),
        _kernel(),
        _capability("CAP_NET_ADMIN", NET_ADMIN, mask, "macvlan, veth and tap links"),
        _capability("CAP_NET_RAW", NET_RAW, mask, "raw Ethernet sockets"),
        *_links(trials),
        _real_time(trials),
        _memory_lock(trials),
        _timer_slack(),
        _processors(),
        _receive_buffer(),
        _optional_memory(),
        _open_files(),
        _address_space(),
        _tshark(),
    ]


# -- the program


def _python() -> Finding:
    version = platform.python_version()
    if _PYTHON <= sys.version_info[:2] < _PYTHON_TOO_NEW:
        return Finding("python", True, version)
    return Finding(
        "python", False, f"{version}: 3.11 to 3.13 are supported", "install Python 3.13 and run `make install`"
    )


def _package(name: str) -> Finding:
    try:
        version = importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return Finding(name, False, "not installed", "make install")
    return Finding(name, True, version)


def _compiler_cache() -> Finding:
    if not IS_COMPILED:
        return Finding(
            "compiled engine", None, "NUMBA_DISABLE_JIT is set: the engine runs interpreted", "unset NUMBA_DISABLE_JIT"
        )
    directory = cache_directory()
    if is_cached():
        return Finding("compiled engine", True, f"machine code is ready in {directory}")
    return Finding(
        "compiled engine",
        None,
        f"not compiled yet: the first start does it, in half a minute or longer ({directory})",
        f"{sys.executable} -m pnfarm.engine.warm",
    )


# -- the kernel


def _kernel() -> Finding:
    release = platform.release()
    numbers = tuple(int(part) for part in release.split("-")[0].split(".")[:2] if part.isdecimal())
    if platform.system() != "Linux":
        return Finding("kernel", False, f"{platform.system()}: a farm needs Linux", "run pnfarm on Linux")
    if numbers >= _OLDEST_KERNEL:
        return Finding("kernel", True, release)
    return Finding("kernel", None, f"{release}: made for 4.20 and later", "upgrade the kernel")


def _capability(name: str, number: int, mask: int, needed_for: str) -> Finding:
    if mask >> number & 1:
        return Finding(name, True, "effective")
    return Finding(name, False, f"missing: needed for {needed_for}; `pnfarm demo` works without", rights_remedy())


def _try() -> dict[str, str | None]:
    """Trial -> None when it worked, else why not."""
    try:
        run = subprocess.run(
            [sys.executable, "-m", "pnfarm.links.kernel.probe"],
            capture_output=True,
            check=True,
            timeout=_PROBE_SECONDS,
            cwd=Path(__file__).resolve().parents[3],
        )
        results = json.loads(run.stdout)
    except subprocess.TimeoutExpired:
        return dict.fromkeys(TRIALS, f"unknown: the trial did not end within {_PROBE_SECONDS:.0f} s")
    except (OSError, subprocess.CalledProcessError, ValueError) as exc:
        return dict.fromkeys(TRIALS, f"unknown: the trial failed ({exc})")
    return {name: results.get(name, "unknown") for name in TRIALS}


_UNKNOWN = ("unknown", "not tried")


def _trial(name: str, refusal: str | None, fine: str, remedy: str, *, needed: bool = True) -> Finding:
    if refusal is None:
        return Finding(name, True, fine)
    if refusal.startswith(_UNKNOWN) or not needed:
        return Finding(name, None, refusal, remedy)
    return Finding(name, False, refusal, remedy)


def _links(trials: dict[str, str | None]) -> list[Finding]:
    worked = "made and removed in a private namespace"
    return [
        _trial(
            "private namespace",
            trials["namespace"],
            "allowed, so `pnfarm demo` runs here",
            namespace_settings.remedy(),
        ),
        _trial("macvlan", trials["macvlan"], worked, "sudo modprobe macvlan"),
        _trial("veth", trials["veth"], worked, "sudo modprobe veth bridge"),
        _trial(
            "tap",
            trials["tap"],
            worked,
            "sudo modprobe tun && sudo chmod 666 /dev/net/tun (container: --device /dev/net/tun)",
            needed=False,
        ),
        _trial(
            "packet socket",
            trials["packet-socket"],
            "opened in a private namespace",
            "run as root (container: --cap-add NET_RAW)",
        ),
    ]


# -- time


def _real_time(trials: dict[str, str | None]) -> Finding:
    return _trial(
        "real-time scheduling",
        trials["scheduler"],
        "SCHED_FIFO is permitted",
        "run as root, or put `@group - rtprio 99` into /etc/security/limits.conf (container: --cap-add SYS_NICE)",
        needed=False,
    )


def _memory_lock(trials: dict[str, str | None]) -> Finding:
    return _trial(
        "memory lock",
        trials["mlock"],
        "mlockall is permitted",
        "run as root, or `@group - memlock unlimited` in /etc/security/limits.conf (container: --cap-add IPC_LOCK)",
        needed=False,
    )


def _timer_slack() -> Finding:
    slack = ctypes.CDLL(None, use_errno=True).prctl(_PR_GET_TIMERSLACK, 0, 0, 0, 0)
    if slack < 0:
        return Finding("timer slack", None, "unknown")
    return Finding("timer slack", True, f"{slack} ns by default; the engine's thread may set its own")


def _processors() -> Finding:
    usable = len(os.sched_getaffinity(0))
    isolated = _read("/sys/devices/system/cpu/isolated")
    detail = f"{usable} usable, isolated: {isolated or 'none'}"
    if usable < 2:
        return Finding(
            "processors",
            None,
            f"{detail}; the engine should have one to itself",
            "give the machine or container a second processor",
        )
    return Finding("processors", True, detail)


# -- limits


def _read(path: str) -> str:
    try:
        return Path(path).read_text(encoding="utf-8").strip()
    except OSError:
        return ""


def _receive_buffer() -> Finding:
    text = _read("/proc/sys/net/core/rmem_max")
    if not text.isdecimal():
        # inside a network namespace the kernel has no such file; CAP_NET_ADMIN lifts the limit
        return Finding("net.core.rmem_max", None, "cannot be read here")
    if int(text) >= RECEIVE_BUFFER:
        return Finding("net.core.rmem_max", True, f"{text} octets")
    if os.geteuid() == 0:
        return Finding("net.core.rmem_max", True, f"{text} octets, and root is not bound by it")
    return Finding(
        "net.core.rmem_max",
        None,
        f"{text} octets: a burst to many drives may overflow the receive queue",
        f"sudo sysctl -w net.core.rmem_max={RECEIVE_BUFFER}",
    )


def _optional_memory() -> Finding:
    text = _read("/proc/sys/net/core/optmem_max")
    if not text.isdecimal():
        return Finding("net.core.optmem_max", None, "cannot be read here")
    if int(text) >= 4096:
        return Finding("net.core.optmem_max", True, f"{text} octets")
    return Finding(
        "net.core.optmem_max",
        False,
        f"{text} octets: too few for a socket filter",
        "sudo sysctl -w net.core.optmem_max=20480",
    )


def _open_files() -> Finding:
    soft, _hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft == resource.RLIM_INFINITY or soft >= 1024:
        return Finding("open files", True, f"{soft} allowed; a tap link takes one per drive")
    return Finding("open files", None, f"{soft} allowed: a tap link takes one per drive", "ulimit -n 4096")


def _address_space() -> Finding:
    soft, _hard = resource.getrlimit(resource.RLIMIT_AS)
    if soft == resource.RLIM_INFINITY:
        return Finding("address space", True, "unlimited")
    detail = f"limited to {soft >> 20} MB"
    if soft >= ENGINE:
        return Finding("address space", True, detail)
    return Finding("address space", False, f"{detail}: the engine takes {ENGINE >> 20} MB", "ulimit -v unlimited")


def _tshark() -> Finding:
    path = shutil.which("tshark")
    if path:
        return Finding("tshark", True, path)
    return Finding(
        "tshark", None, "not installed; only some tests and captures by hand need it", "sudo apt-get install tshark"
    )
