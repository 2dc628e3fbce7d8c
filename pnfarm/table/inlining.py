"""Functions that are only ever a part of their callers get no machine code of their own.

Numba optimises each function by itself, makes its machine code, and then does both again in each of its callers, which
include it.  For a function that LLVM always includes (``alwaysinline``), and that Python cannot call, all of it but the
last time is for nothing: half of the time that the engine's compilation took.  Here such a function keeps its LLVM code
only, for its callers.
"""

from __future__ import annotations

from typing import Any

import llvmlite.binding
from numba.core import codegen
from numba.core.registry import cpu_target

__all__ = ["keep_parts_as_they_are"]


def _is_part(module: Any) -> bool:
    """Whether all functions that a module of LLVM itself defines are always included in their callers."""
    own = [
        function
        for function in module.functions
        if not function.is_declaration and function.linkage == llvmlite.binding.Linkage.external
    ]
    return bool(own) and all(any(b"alwaysinline" in group for group in function.attributes) for function in own)


class _Library(codegen.JITCodeLibrary):  # type: ignore[misc]  # numba has no types
    """A function with all that it calls; a part is neither optimised nor made into machine code."""

    _part = False

    def finalize(self) -> None:
        # before the functions that this one calls are linked in
        self._part = _is_part(self._final_module)
        super().finalize()

    def _optimize_final_module(self) -> None:
        if not self._part:
            super()._optimize_final_module()

    def _finalize_final_module(self) -> None:
        if self._part:
            self._finalize_dynamic_globals()
            self._finalized = True
        else:
            super()._finalize_final_module()


class _Codegen(codegen.JITCPUCodegen):  # type: ignore[misc]  # numba has no types
    _library_class = _Library

    def set_env(self, env_name: str, env: Any) -> None:
        """Store the address of a function's environment; a part has none, as its name is not in the machine code."""
        if self._engine.get_global_value_address(env_name):
            super().set_env(env_name, env)


def keep_parts_as_they_are() -> None:
    """From now on, for all that this process compiles."""
    cpu_target.target_context.codegen().__class__ = _Codegen
