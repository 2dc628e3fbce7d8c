"""The capabilities that this process has, those that a link needs, and how a user other than root gets them."""

from __future__ import annotations

import sys
from pathlib import Path

from pnfarm.errors import EnvironmentError_

__all__ = ["NET_ADMIN", "NET_RAW", "SYS_ADMIN", "effective", "has", "remedy", "require_for_link"]

NET_ADMIN, NET_RAW, SYS_ADMIN = 12, 13, 21
_NAMES = {NET_ADMIN: "CAP_NET_ADMIN", NET_RAW: "CAP_NET_RAW"}
_REASONS = {NET_ADMIN: "it makes network interfaces", NET_RAW: "it sends raw Ethernet frames"}
#: Kind of link -> what it needs.  Kinds that are not named need no capability.
_NEEDS = {
    "macvlan": (NET_ADMIN, NET_RAW),
    "veth": (NET_ADMIN, NET_RAW),
    "tap": (NET_ADMIN,),
    "interface": (NET_RAW,),
}
_SETPRIV = (
    "sudo setpriv --reuid=$(id -u) --regid=$(id -g) --init-groups --inh-caps=+net_admin,+net_raw "
    "--ambient-caps=+net_admin,+net_raw "
)


def effective() -> int:
    """The effective capabilities of this thread, as a mask; 0 where /proc does not report them."""
    try:
        text = Path("/proc/thread-self/status").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return 0
    lines = (line.split() for line in text.splitlines() if line.startswith("CapEff:"))
    return next((int(line[1], 16) for line in lines), 0)


def has(number: int) -> bool:
    """Whether a capability is effective."""
    return bool(effective() >> number & 1)


def remedy() -> str:
    """How to run with what is missing, without giving it to anything else.

    A file capability on an interpreter gives it to every script that runs with it, so it must not be used
    for one that several programs share; a copy in its own environment, which only its owner may run, is fine.
    """
    python = Path(sys.executable)
    own = f"{python.parent}/python3" if python.is_symlink() else str(python)
    copy = f"python3 -m venv --copies {python.parent.parent}, chmod 700 it, and "
    return (
        "run with sudo; or as yourself by `"
        f"{_SETPRIV}{python.parent / 'pnfarm'} up FILE`; or as a systemd service with "
        "AmbientCapabilities=CAP_NET_ADMIN CAP_NET_RAW (configs/systemd/pnfarm@.service); or in an environment with an "
        f"interpreter of its own: {copy if python.is_symlink() else ''}"
        f"`sudo setcap cap_net_admin,cap_net_raw+ep {own}`; never setcap on an interpreter that other programs share"
    )


def require_for_link(kind: str, owner: str) -> None:
    """Raises :class:`EnvironmentError_` where this process lacks what a link of this kind needs, in one sentence."""
    mask = effective()
    missing = [number for number in _NEEDS.get(kind, ()) if not mask >> number & 1]
    if missing:
        lacks = " and ".join(f"{_NAMES[number]} ({_REASONS[number]})" for number in missing)
        raise EnvironmentError_(
            f"{owner} lacks {lacks}: run it with sudo; `pnfarm doctor` shows other ways, `pnfarm demo` needs neither"
        )
