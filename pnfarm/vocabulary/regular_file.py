"""Files that a user names: where they are, and reading them whole, bounded, without blocking."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

__all__ = ["beside", "read_regular"]

_KINDS = {
    stat.S_IFDIR: "it is a folder",
    stat.S_IFIFO: "it is a pipe",
    stat.S_IFCHR: "it is a device",
    stat.S_IFBLK: "it is a device",
    stat.S_IFSOCK: "it is a socket",
}


def beside(folder: Path, name: str) -> Path:
    """Where a name in a file of this folder points; ``~`` is the user's home, as in a shell."""
    path = Path(name)
    try:
        return folder / path.expanduser()
    except RuntimeError:
        # `~somebody` who is not known is a name like any other, in a shell, too
        return folder / path


def read_regular(path: Path, most: int) -> bytes:
    """The first ``most`` octets of a regular file.

    Anything else (opening a pipe without a writer would block for ever) is an :class:`OSError` whose
    ``strerror`` says what it is.
    """
    # without O_NONBLOCK the opening of a pipe waits for a writer
    fd = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        mode = os.fstat(fd).st_mode
        if not stat.S_ISREG(mode):
            what = _KINDS.get(stat.S_IFMT(mode), "it is not a file")
            raise OSError(errno.EINVAL, f"{what}, not a regular file", str(path))
        with os.fdopen(fd, "rb", closefd=False) as file:
            return file.read(most)
    finally:
        os.close(fd)
