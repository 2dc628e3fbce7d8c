"""Inlined functions get no machine code of their own.

Numba optimises each function by itself, makes its machine code, and then does both again in each of its callers, which
include it.  For a function that LLVM always inlines (``alwaysinline``), and that Python cannot call, the first time is
for nothing: it was a quarter of the engine's compilation.  Here such a function keeps its LLVM code only, for them.
"""

from __future__ import annotations

from typing import Any

import llvmlite.binding
from numba.core import codegen
from numba.core.registry import cpu_target

__all__ = ["skip_code_of_inlined"]


def _is_inlined(module: Any) -> bool:
    """Whether all functions that a module of LLVM itself defines are always inlined."""
    own = [
        function
        for function in module.functions
        if not function.is_declaration and function.linkage == llvmlite.binding.Linkage.external
    ]
    return bool(own) and all(any(b"alwaysinline" in group for group in function.attributes) for function in own)


class _Library(codegen.JITCodeLibrary):  # type: ignore[misc]  # numba has no types
    """A function with all that it calls; an inlined one is neither optimised nor made into machine code."""

    _inlined = False

    def finalize(self) -> None:
        # before the functions that this one calls are linked in
        self._inlined = _is_inlined(self._final_module)
        super().finalize()

    def _optimize_final_module(self) -> None:
        if not self._inlined:
            super()._optimize_final_module()

    def _finalize_final_module(self) -> None:
        if self._inlined:
            self._finalize_dynamic_globals()
            self._finalized = True
        else:
            super()._finalize_final_module()


class _Codegen(codegen.JITCPUCodegen):  # type: ignore[misc]  # numba has no types
    _library_class = _Library

    def set_env(self, env_name: str, env: Any) -> None:
        """Store the address of a function's environment; an inlined one has none: no machine code names it."""
        if self._engine.get_global_value_address(env_name):
            super().set_env(env_name, env)


def skip_code_of_inlined() -> None:
    """From now on, for all that this process compiles."""
    cpu_target.target_context.codegen().__class__ = _Codegen
