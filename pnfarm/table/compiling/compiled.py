"""The decorators of all functions that run each tick.

``@compiled`` is ``numba.njit(nogil=True, cache=True)`` with this package's own cache
(:mod:`pnfarm.table.compiling.code_cache`).  ``NUMBA_DISABLE_JIT=1`` leaves the plain functions in place, for a debugger
and for coverage.

``@inlined`` is for what is small or has one caller, and is called by compiled code only.  So is a ``@compiled``
function whose name begins with an underscore: no wrapper for calls from Python is made, and such a call would crash.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
from numba import types
from numba.cpython import slicing

from pnfarm.table.compiling.code_cache import (
    REAL_TIME,
    FunctionCache,
    cache_directory,
    copy_code,
    is_cached,
    is_usable,
    kept_functions,
    mark_cached,
    take_packaged,
)
from pnfarm.table.compiling.inlining import skip_code_of_inlined
from pnfarm.table.compiling.processor import choose_processor

_F = TypeVar("_F", bound=Callable[..., Any])

__all__ = [
    "IS_COMPILED", "REAL_TIME", "cache_directory", "compiled", "compiled_apart", "copy_code", "direct",
    "function_count", "inlined", "is_cached", "kept_functions", "mark_cached",
]  # fmt: skip


def _prepare() -> bool:
    if numba.config.DISABLE_JIT:
        return False
    # Numba formats the types of the arguments in each of its passes and look-ups, even if no event listener is
    # registered.  A nested record builds that text each time, a tenth of all compile time; its name does as well.
    types.Record.__repr__ = types.Type.__repr__
    # before anything makes Numba's code generator, which asks for the processor then and never again
    choose_processor()
    skip_code_of_inlined()
    # no index here is below 0, and Numba compares each with 0: the boundary checks of the tests refuse such a one
    slicing.fix_index = lambda _builder, index, _size: index
    if not is_usable():
        # no writable home (a container's arbitrary user): this run compiles again, correctly
        os.environ["NUMBA_CACHE_DIR"] = tempfile.mkdtemp(prefix="pnfarm-cache-")
    take_packaged()
    return True


#: False under ``NUMBA_DISABLE_JIT=1``.
IS_COMPILED: bool = _prepare()
_LOCATOR = "pnfarm.table.compiling.code_cache.DigestLocator"
_functions = 0


def function_count() -> int:
    """Number of compiled functions in the modules imported so far."""
    return _functions


def compiled(function: _F) -> _F:
    """Compile on first call, without the interpreter's lock, and keep the machine code."""
    # no pointer to one is taken: without its C wrapper a function compiles faster
    return _compiled(function, no_cfunc_wrapper=True)


def inlined(function: _F) -> _F:
    """As :func:`compiled`, for a function that is small or has one caller: it becomes part of compiled callers.

    LLVM alone leaves many of these apart: each call saves registers, and returns a status that its caller looks at.
    It has no machine code of its own (:mod:`pnfarm.table.compiling.inlining`), and a call from Python would crash.
    """
    return _compiled(function, no_cfunc_wrapper=True, inline=True)


def direct(function: _F) -> _F:
    """``function``, a compiled one, for a caller in Python whose arguments have the same types in each call.

    From the second call on Numba does not look these types up: for the tables of a farm that takes 10 to 20 us, longer
    than many a call.  Types that change are not noticed: only for functions of tables whose types are this package's.
    """
    if not IS_COMPILED:
        return function
    dispatcher = cast("Any", function)
    entry: Any = None

    def call(*args: Any) -> Any:
        nonlocal entry
        if entry is not None:
            return entry(*args)
        result = function(*args)
        if len(dispatcher.overloads) == 1:
            entry = next(iter(dispatcher.overloads.values())).entry_point
        return result

    return cast("_F", call)


def compiled_apart(function: _F) -> _F:
    """As :func:`compiled`, for a function that :func:`pnfarm.table.compiling.by_address.by_address` gives to its
    callers."""
    return _compiled(function, no_cfunc_wrapper=False)


def _ignore_literals(dispatcher: Any) -> None:
    """Have one specialisation for all constants of a type.

    Numba compiles a function again for each constant with which a compiled caller calls it.  LLVM includes the function
    in its caller, and sees the constant there anyway.
    """
    template = getattr(dispatcher, "get_call_template", None)
    if template is not None:
        dispatcher.get_call_template = lambda args, kws: template(
            [types.unliteral(arg) for arg in args], {name: types.unliteral(arg) for name, arg in kws.items()}
        )


def _keep_where_possible(dispatcher: Any) -> None:
    """Have a function that was compiled run also where its machine code cannot be written: it is not kept then."""
    cache = getattr(dispatcher, "_cache", None)
    if cache is None:
        return
    save = cache.save_overload

    def save_overload(signature: Any, result: Any) -> None:
        with contextlib.suppress(OSError):
            save(signature, result)

    cache.save_overload = save_overload


def _compiled(function: _F, *, no_cfunc_wrapper: bool, inline: bool = False) -> _F:
    global _functions  # noqa: PLW0603 - a count of what this decorator was given
    _functions += 1
    others = numba.config.CACHE_LOCATOR_CLASSES
    numba.config.CACHE_LOCATOR_CLASSES = _LOCATOR
    try:
        dispatcher = numba.njit(
            function,
            nogil=True,
            error_model="numpy",
            no_cfunc_wrapper=no_cfunc_wrapper,
            forceinline=inline,
            no_cpython_wrapper=inline or function.__name__.startswith("_"),
            # compiled functions allocate nothing and keep nothing: an array is its caller's.  Counting references to
            # it was a tenth of the time of a frame.
            _nrt=False,
        )
        if IS_COMPILED and not inline:
            # as `cache=True` does, with a cache that loads faster
            dispatcher._cache = FunctionCache(function)  # noqa: SLF001 - Numba has no other way to choose it
        _ignore_literals(dispatcher)
        _keep_where_possible(dispatcher)
        return cast("_F", dispatcher)
    finally:
        numba.config.CACHE_LOCATOR_CLASSES = others
