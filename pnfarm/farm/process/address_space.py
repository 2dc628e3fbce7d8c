"""Check of the address space limit (``ulimit -v``) before the libraries run into it.

With too little they end the process (OpenBLAS), fail in the middle of an import, or never return (LLVM).
"""

from __future__ import annotations

import errno
import os
import resource

from pnfarm.errors import EnvironmentError_

__all__ = ["COMMAND", "ENGINE", "few_threads", "is_exhausted", "require_address_space"]

#: Octets that a command needs to read a farm file; measured: 150 MB on 2 processors.
COMMAND = 256 << 20
#: Octets that the engine needs; measured: 940 MB while it is compiled, 400 MB afterwards with a drive.
ENGINE = 1536 << 20
_ERRNOS = (errno.ENOMEM, errno.EAGAIN)
_WORDS = ("can't start new thread", "failed to map segment", "cannot allocate memory", "cannot apply additional memory")


def few_threads() -> None:
    """Keep NumPy's OpenBLAS from starting threads, each with its own memory, for algebra that is not used here."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def _limit() -> int | None:
    soft, _ = resource.getrlimit(resource.RLIMIT_AS)
    return None if soft == resource.RLIM_INFINITY else soft


def require_address_space(octets: int) -> None:
    """Raises :class:`EnvironmentError_` where the limit is below ``octets``."""
    limit = _limit()
    if limit is not None and limit < octets:
        raise EnvironmentError_(
            f"the address space is limited to {limit >> 20} MB (ulimit -v {limit >> 10}), and {octets >> 20} MB are "
            "needed: `ulimit -v unlimited`, or LimitAS=infinity in a systemd unit"
        )


def is_exhausted(error: BaseException) -> str | None:
    """The message for an error that reports memory exhaustion; None for any other."""
    text = str(error).lower()
    ran_out = (
        isinstance(error, MemoryError)
        or (isinstance(error, OSError) and error.errno in _ERRNOS)
        or (isinstance(error, (ImportError, OSError, RuntimeError)) and any(word in text for word in _WORDS))
    )
    if not ran_out:
        return None
    limit = _limit()
    if limit is None:
        return "this machine has no memory left for it: use fewer drives, or a machine with more"
    return f"the limit of {limit >> 20} MB of address space (ulimit -v {limit >> 10}) is too low for it: raise it"
