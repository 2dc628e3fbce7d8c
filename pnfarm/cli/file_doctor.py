"""Can this machine run this farm file?  Interface, address, folder, and the processor time of its drives."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from pnfarm.cli.farm_file import counted
from pnfarm.config.database import redacted
from pnfarm.config.device import DeviceConfig
from pnfarm.config.links import MacvlanLink, MemoryLink, SerialLink, TapLink, VethLink
from pnfarm.errors import EnvironmentError_
from pnfarm.farm.doctor.machine import Finding
from pnfarm.farm.file.reading import expand_all
from pnfarm.farm.load import Load, load_of
from pnfarm.farm.memory.postgres import answer_seconds
from pnfarm.farm.shard import part_of
from pnfarm.terminal.working import working
from pnfarm.vocabulary.endpoints import host_port

if TYPE_CHECKING:
    from pnfarm.farm.file.reading import FarmConfig
    from pnfarm.farm.shard import Shard

__all__ = ["ROOMY", "examine_file", "judge", "judge_cycles", "measured_costs"]

#: Share of one processor up to which the engine keeps its time with room for storms, and at which there is none left.
ROOMY, FULL = 0.6, 0.9
_MEASURE_SECONDS = 180.0
_INTERFACES = Path("/sys/class/net")


def examine_file(config: FarmConfig, shard: Shard | None = None) -> list[Finding]:
    """A finding for each thing that the file, or a shard of it, needs of this machine.  Measures for some seconds."""
    found = _link(config)
    found += _api(config)
    found += _state(config)
    drives = expand_all(config)
    load = load_of(config, drives if shard is None else part_of(config, drives, shard))
    if load.frames and isinstance(config.link, MacvlanLink | VethLink):
        measured = measured_costs()
        found.append(judge(load, *measured))
        found += judge_cycles(config, load, measured[0])
    return found


# -- what it needs


def _interface(name: str, what: str, *, parent: bool) -> Finding:
    place = _INTERFACES / name
    if not place.is_dir():
        others = sorted(one.name for one in _INTERFACES.iterdir() if one.name != "lo") if _INTERFACES.is_dir() else []
        listed = f"; there are {', '.join(others)}" if others else ""
        return Finding(what, False, f"{name} does not exist{listed}", "ip -br link; then name one of them in the file")
    if not int(_read(place / "flags") or "0x1", 16) & 0x1:
        return Finding(what, False, f"{name} is down", f"sudo ip link set {name} up")
    if parent and ((place / "wireless").is_dir() or (place / "phy80211").exists()):
        why = f"{name} is a WLAN: an access point takes frames of one MAC address for each client"
        return Finding(what, False, why, "a wired network card")
    if _read(place / "carrier") != "1":
        return Finding(what, None, f"{name} is up and has no carrier", "plug the cable, or switch the other end on")
    return Finding(what, True, f"{name} is up")


def _link(config: FarmConfig) -> list[Finding]:
    match config.link:
        case MacvlanLink(parent=parent):
            return [_interface(parent, "parent interface", parent=True)]
        case VethLink(bridge=str() as bridge) | TapLink(bridge=str() as bridge):
            return [_interface(bridge, "bridge", parent=False)]
        case MemoryLink():
            return [Finding("link", True, "in memory: no interface, no rights")]
        case SerialLink():
            return [Finding("link", True, "a serial line: no interface, no rights for one")]
        case _:
            return []


def _api(config: FarmConfig) -> list[Finding]:
    if config.api is None:
        return []
    host, port = config.api.listen
    shown = host_port(host, port)
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind, protocol) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
    except OSError as exc:
        why = f"{shown}: {(exc.strerror or str(exc)).lower()}"
        return [Finding("API", False, why, "another port (`api: 127.0.0.1:8703`), or stop the farm that has this one")]
    return [Finding("API", True, f"{shown} is free")]


def _state(config: FarmConfig) -> list[Finding]:
    if config.state is None:
        return []
    if (url := config.state_database) is not None:
        return [_database(url, config)]
    folder = config.beside(config.state)
    # the farm makes what is missing of it
    existing = next((one for one in (folder, *folder.absolute().parents) if one.exists()), Path("/"))
    if existing.is_dir() and os.access(existing, os.W_OK | os.X_OK):
        return [Finding("state", True, f"{folder} can be written")]
    return [Finding("state", False, f"{folder} cannot be written", f"sudo chown $USER {existing}")]


def _database(url: str, config: FarmConfig) -> Finding:
    """Whether the database of ``state`` answers; nothing is made in it."""
    where = redacted(url)
    try:
        seconds = answer_seconds(url, config.farm or "farm")
    except EnvironmentError_ as exc:
        return Finding("state", False, str(exc), f"psql '{where}'")
    return Finding("state", True, f"{where} answers within {seconds * 1e3:.1f} ms")


# -- processor time


def measured_costs() -> tuple[float | None, float | None, str]:
    """ns of a frame and of a step on this machine, and why there is none."""
    program = [sys.executable, "-m", "pnfarm.bench.budget"]
    try:
        with working("measuring what a frame and a step cost here"):
            run = subprocess.run(program, capture_output=True, timeout=_MEASURE_SECONDS, check=True)
        answer = json.loads(run.stdout)
    except subprocess.TimeoutExpired:
        return None, None, f"the measurement did not end within {_MEASURE_SECONDS:.0f} s"
    except (OSError, subprocess.CalledProcessError, ValueError) as exc:
        return None, None, f"the measurement failed ({exc})"
    return answer["frame_ns"], answer["step_ns"], answer["why"]


def judge(load: Load, frame_ns: float | None, step_ns: float | None, why: str) -> Finding:
    """Whether one processor is enough for the engine, by what a frame and a step cost on it."""
    what = f"{counted(load.drives, 'drive')}, {load.frames:,.0f} frames a second"
    if frame_ns is None or step_ns is None:
        return Finding("processor time", None, f"{what}: not measured ({why})", "pnfarm bench")
    share = (load.frames * frame_ns + load.steps * step_ns) / 1e9
    detail = (
        f"{what}: about {max(share, 0.01):.2f} of the one processor that the engine has "
        f"({frame_ns / 1e3:.2f} us a frame on a veth, {step_ns / 1e3:.2f} us a step, measured)"
    )
    remedy = "fewer drives, longer cycles, or shards of the farm on several machines (`pnfarm up FILE --shard I/N`)"
    if share <= ROOMY:
        return Finding("processor time", True, detail)
    if share <= FULL:
        return Finding("processor time", None, f"{detail}: little room for storms", remedy)
    return Finding("processor time", False, f"{detail}: too much", remedy)


def judge_cycles(config: FarmConfig, load: Load, frame_ns: float | None) -> list[Finding]:
    """Whether all stations' frames fit into the shortest cycle, an estimate: a controller may have all due at once."""
    one = load.shortest
    if frame_ns is None or one is None:
        return []
    burst = 2 * load.drives * frame_ns
    detail = (
        f"estimated: at worst, frames of all {load.drives} stations are due at once, which takes {burst / 1e6:.3g} ms; "
        f"the shortest cycle is {load.shortest_ns / 1e6:g} ms, of {one.name}"
    )
    line = config.place(("devices" if isinstance(one, DeviceConfig) else "drives", one.group))[1]
    if burst <= load.shortest_ns * ROOMY:
        return [Finding("cycles", True, detail, line=line)]
    remedy = "a longer cycle, more cycles without data until the PLC gives up (watchdog), or several shards"
    return [Finding("cycles", None, f"{detail}: its frames may be late", remedy, line)]


def _read(path: Path) -> str:
    try:
        return path.read_text("ascii").strip()
    except OSError:
        # the carrier of an interface that is down cannot be read
        return ""
