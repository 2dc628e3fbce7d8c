"""Writing files so that a reader at the same time, or after a failure, finds the old one or the new one."""

from __future__ import annotations

import contextlib
import os
import stat
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

__all__ = ["write_whole"]


def write_whole(files: Mapping[Path, bytes], mode: int | None = None) -> None:
    """Write all files beside their places, to the disk, before the first takes its place; a link is not followed.

    ``mode``: their permissions; left out, those of the files that they replace, and their owners.  Raises
    :class:`OSError` with the path of ``files`` whose file could not be written.
    """
    fresh = {path: path.with_name(f".{path.name}.{os.getpid()}") for path in files}
    path = None
    try:
        for path, octets in files.items():
            old = path.lstat() if os.path.lexists(path) else None
            wanted = mode if mode is not None or old is None else stat.S_IMODE(old.st_mode)
            flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW | os.O_CLOEXEC
            fd = os.open(fresh[path], flags, 0o666 if wanted is None else wanted & 0o600)
            with os.fdopen(fd, "wb") as out:
                if mode is None and old is not None:
                    # who is not root owns what it writes
                    with contextlib.suppress(PermissionError):
                        os.fchown(fd, old.st_uid, old.st_gid)
                if wanted is not None:
                    os.fchmod(fd, wanted)
                out.write(octets)
                out.flush()
                os.fsync(fd)
        for path, own in fresh.items():
            own.replace(path)
    except OSError as exc:
        raise OSError(exc.errno, exc.strerror, str(path)) from exc
    finally:
        for own in fresh.values():
            own.unlink(missing_ok=True)
