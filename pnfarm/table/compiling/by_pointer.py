"""Compiled code that the engine calls by an address in a row, and arrays that it finds the same way.

What few farms have costs the others no compile time: it is compiled when its address is asked for, and no machine code
of the loops names it.
"""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from numba.np import arrayobj

from pnfarm.table.compiling.compiled import IS_COMPILED

if TYPE_CHECKING:
    from pnfarm.table.layout import Layout

__all__ = ["address_of", "array_at", "call_at"]

#: Interpreted, an address is a place in this list, counted from 1.
_functions: list[Any] = []


def address_of(function: Any, row: Layout) -> int:
    """What :func:`call_at` calls ``function`` by, whose arguments are a row and a time, ns; compiles it."""
    if not IS_COMPILED:
        if function not in _functions:
            _functions.append(function)
        return _functions.index(function) + 1
    signature = types.void(numba.from_dtype(row.dtype), types.int64)
    function.compile(signature.args)
    made = function.overloads[signature.args]
    return int(made.library.get_pointer_to_function(made.fndesc.llvm_cfunc_wrapper_name))


if IS_COMPILED:

    @intrinsic  # type: ignore[untyped-decorator]  # numba has no types
    def call_at(_context: Any, _address: Any, row: Any, _now: Any) -> Any:
        """Call the function at an address with a row and a time."""

        def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
            address, place, now = arguments
            kind = ir.FunctionType(ir.VoidType(), [place.type, now.type])
            builder.call(builder.inttoptr(address, kind.as_pointer()), [place, now])
            return context.get_dummy_value()

        return types.void(types.int64, row, types.int64), generate

    @intrinsic  # type: ignore[untyped-decorator]  # numba has no types
    def array_at(_context: Any, _address: Any, _count: Any, kind: Any) -> Any:
        """The array of ``count`` elements at an address; ``kind``: their type, a constant."""
        array = types.Array(kind.dtype, 1, "C")

        def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
            address, count, _ = arguments
            made = context.make_array(array)(context, builder)
            octets = context.get_constant(types.intp, context.get_abi_sizeof(context.get_data_type(array.dtype)))
            arrayobj.populate_array(
                made,
                data=builder.inttoptr(address, made.data.type),
                shape=[count],
                strides=[octets],
                itemsize=octets,
                meminfo=None,
            )
            return made._getvalue()  # noqa: SLF001 - Numba's own way to a made value

        return array(types.int64, types.int64, kind), generate

else:

    def call_at(address: int, row: Any, now: int) -> None:
        """Call the function at an address with a row and a time."""
        _functions[int(address) - 1](row, now)

    def array_at(address: int, count: int, kind: Any) -> Any:
        """The array of ``count`` elements at an address; ``kind``: their type."""
        octets = (ctypes.c_uint8 * (int(count) * np.dtype(kind).itemsize)).from_address(int(address))
        found = np.frombuffer(octets, kind)
        return found if found.dtype.names is None else found.view(np.dtype((np.record, found.dtype)), np.recarray)
