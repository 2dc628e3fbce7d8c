"""A compiled function with machine code of its own, which its compiled callers call by its address.

Numba makes a compiled function anew, whole and with all that it calls, inside the machine code of each of its callers
and of theirs.  That is what lets small functions run fast.  For one that calls two hundred others it only takes time to
compile and room in the cache, once for each function above it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import llvmlite.binding
import numba
from numba import types

from pnfarm.table.compiled import IS_COMPILED
from pnfarm.table.layout import Layout

__all__ = ["by_address", "link"]


class _Link(NamedTuple):
    symbol: str
    function: Any
    signature: Any


_open: list[_Link] = []


def by_address(function: Any, *rows: Layout) -> Any:
    """What compiled code calls in place of ``function``, which takes a row of each of ``rows`` and a time, ns.

    :func:`link` has to run before the first of its callers.  With bounds checked it is ``function`` itself, because an
    exception would end at the call.
    """
    if not IS_COMPILED or numba.config.BOUNDSCHECK:
        return function
    signature = types.void(*(numba.from_dtype(row.dtype) for row in rows), types.int64)
    link = _Link(f"pnfarm_{function.__name__}", function, signature)
    _open.append(link)
    return types.ExternalFunction(link.symbol, signature)


def link() -> None:
    """Compile the functions that are called by their address, or load them, and say where they are."""
    while _open:
        symbol, function, signature = _open[-1]
        function.compile(signature.args)
        made = function.overloads[signature.args]
        address = made.library.get_pointer_to_function(made.fndesc.llvm_cfunc_wrapper_name)
        llvmlite.binding.add_symbol(symbol, address)
        _open.pop()
