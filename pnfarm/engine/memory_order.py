"""Order of memory accesses between the engine and others: the kernel, which shares its rings, and the event loop.

On x86 a fence of these kinds is no instruction: it only keeps the compiler from moving accesses across it.  Interpreted
code needs none.
"""

from __future__ import annotations

from typing import Any

from pnfarm.table.compiling.compiled import IS_COMPILED

__all__ = ["acquire", "release"]

if IS_COMPILED:
    from numba import types
    from numba.extending import intrinsic

    def _fence(kind: str) -> Any:
        def typed(_context: Any) -> Any:
            def generate(context: Any, builder: Any, _signature: Any, _arguments: Any) -> Any:
                builder.fence(kind)
                return context.get_dummy_value()

            return types.none(), generate

        return intrinsic(typed)

    acquire = _fence("acquire")
    release = _fence("release")
else:

    def acquire() -> None:
        """What is read after this was not read before it."""

    def release() -> None:
        """What is written before this is not written after it."""
