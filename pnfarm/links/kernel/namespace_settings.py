"""Settings of this machine that forbid a process its own namespace, and the command that changes them.

Sources: namespaces(7), user_namespaces(7) for the limits under /proc/sys/user; the settings of Debian's and Ubuntu's
kernels besides.
"""

from __future__ import annotations

import errno
from pathlib import Path

__all__ = ["remedy", "why"]

_SYS = Path("/proc/sys")
#: What distributions set these to, where they permit namespaces at all.
_USUAL = 15000
_LIMITS = ("user.max_user_namespaces", "user.max_net_namespaces", "user.max_mnt_namespaces")
#: Settings that forbid it to ordinary users -> the value that does.
_FORBIDDING = {"kernel.unprivileged_userns_clone": 0, "kernel.apparmor_restrict_unprivileged_userns": 1}


def _value(setting: str) -> int | None:
    try:
        text = (_SYS / setting.replace(".", "/")).read_text(encoding="ascii").strip()
    except (OSError, UnicodeError):
        return None
    return int(text) if text.lstrip("-").isdecimal() else None


def remedy() -> str:
    """The command that allows a private namespace here: by the settings that forbid one, else what may be at fault."""
    commands = [f"sudo sysctl -w {setting}={_USUAL}" for setting in _LIMITS if _value(setting) == 0]
    commands += [
        f"sudo sysctl -w {setting}={1 - value}" for setting, value in _FORBIDDING.items() if _value(setting) == value
    ]
    if commands:
        return " && ".join(commands)
    return "run as root; in a container: a seccomp profile that lets `unshare` pass"


def why(code: int) -> str:
    """Why ``unshare`` failed with this error number, and what to do."""
    none = [f"{setting} = 0" for setting in _LIMITS if _value(setting) == 0]
    if code in {errno.ENOSPC, errno.EUSERS}:
        if none:
            return f"this machine allows none ({', '.join(none)}): `{remedy()}`"
        return f"too many exist already: raise {', '.join(_LIMITS[:2])} (`sysctl -w`)"
    if code == errno.EPERM:
        return f"this machine forbids ordinary users one of their own: run as root, or allow it: {remedy()}"
    if code == errno.EINVAL:
        return "this kernel was built without user or network namespaces (CONFIG_USER_NS, CONFIG_NET_NS)"
    return errno.errorcode.get(code, str(code))
