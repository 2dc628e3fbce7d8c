"""A compiled function with its own machine code, which its compiled callers call by address.

Numba includes a compiled function, with all that it calls, in the machine code of each of its direct and indirect
callers.  This makes small functions fast.  For one that calls two hundred others it only costs compile time and room
in the cache, once for each function above it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import llvmlite.binding
import numba
from numba import types

from pnfarm.table.compiling.compiled import IS_COMPILED
from pnfarm.table.layout import Layout

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["by_address", "link", "promise"]


class _Link(NamedTuple):
    symbol: str
    function: Any
    signature: Any


_open: list[_Link] = []


def by_address(function: Any, *rows: Layout) -> Any:
    """What compiled code calls instead of ``function``, whose arguments are a row of each of ``rows`` and a time, ns.

    :func:`link` has to run before the first of its callers.  With bounds checking it is ``function`` itself, because an
    exception would not pass the call.
    """
    if not IS_COMPILED or numba.config.BOUNDSCHECK:
        return function
    signature = types.void(*(numba.from_dtype(row.dtype) for row in rows), types.int64)
    link = _Link(f"pnfarm_{function.__name__}", function, signature)
    _open.append(link)
    return types.ExternalFunction(link.symbol, signature)


def promise() -> Callable[[], None]:
    """Let the callers be compiled without what they call, which the function that is returned compiles.

    For two processes that share the work: the callers' machine code names what they call, and cannot run in this one.
    """
    waiting, nowhere = [*_open], llvmlite.binding.address_of_symbol("abort")
    for promised in waiting:
        llvmlite.binding.add_symbol(promised.symbol, nowhere)
    _open.clear()

    def keep() -> None:
        for promised in waiting:
            promised.function.compile(promised.signature.args)

    return keep


def link() -> None:
    """Compile or load the functions that are called by address, and set their addresses."""
    while _open:
        symbol, function, signature = _open[-1]
        function.compile(signature.args)
        made = function.overloads[signature.args]
        address = made.library.get_pointer_to_function(made.fndesc.llvm_cfunc_wrapper_name)
        llvmlite.binding.add_symbol(symbol, address)
        _open.pop()
