"""The few calls into the C library that the engine makes, usable compiled and interpreted.

Compiled code resolves ``numba.types.ExternalFunction`` symbols itself and keeps its cache; interpreted
code takes the same names from ctypes.  Addresses are plain integers (``array.ctypes.data``).
"""

from __future__ import annotations

import ctypes
from typing import Any

from pnfarm.table.compiling.compiled import IS_COMPILED, inlined

__all__ = [
    "CLOCK_BOOTTIME",
    "CLOCK_MONOTONIC",
    "CLOCK_REALTIME",
    "MSG_DONTWAIT",
    "clock_nanosleep",
    "recv",
    "recvmmsg",
    "sendmmsg",
    "sendto",
    "time_ns",
    "write",
]

CLOCK_REALTIME = 0
CLOCK_MONOTONIC = 1
CLOCK_BOOTTIME = 7
TIMER_ABSTIME = 1
MSG_DONTWAIT = 0x40

if IS_COMPILED:
    from numba import types

    _int = types.int32
    _word = types.intp
    recv: Any = types.ExternalFunction("recv", _word(_int, _word, _word, _int))
    recvmmsg: Any = types.ExternalFunction("recvmmsg", _int(_int, _word, types.uint32, _int, _word))
    sendmmsg: Any = types.ExternalFunction("sendmmsg", _int(_int, _word, types.uint32, _int))
    sendto: Any = types.ExternalFunction("sendto", _word(_int, _word, _word, _int, _word, types.uint32))
    clock_gettime: Any = types.ExternalFunction("clock_gettime", _int(_int, _word))
    clock_nanosleep: Any = types.ExternalFunction("clock_nanosleep", _int(_int, _int, _word, _word))
    write: Any = types.ExternalFunction("write", _word(_int, _word, _word))
else:
    _libc = ctypes.CDLL(None, use_errno=True)
    _int = ctypes.c_int
    _word = ctypes.c_ssize_t

    def _function(name: str, result: Any, *arguments: Any) -> Any:
        function = getattr(_libc, name)
        function.restype = result
        function.argtypes = arguments
        return function

    recv = _function("recv", _word, _int, _word, _word, _int)
    recvmmsg = _function("recvmmsg", _int, _int, _word, ctypes.c_uint, _int, _word)
    sendmmsg = _function("sendmmsg", _int, _int, _word, ctypes.c_uint, _int)
    sendto = _function("sendto", _word, _int, _word, _word, _int, _word, ctypes.c_uint)
    clock_gettime = _function("clock_gettime", _int, _int, _word)
    clock_nanosleep = _function("clock_nanosleep", _int, _int, _int, _word, _word)
    write = _function("write", _word, _int, _word, _word)


@inlined
def time_ns(clock: int, timespec: Any) -> int:
    """``clock`` in nanoseconds; ``timespec`` is an int64[2] to work in."""
    clock_gettime(clock, timespec.ctypes.data)
    return int(timespec[0]) * 1_000_000_000 + int(timespec[1])
