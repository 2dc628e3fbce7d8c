"""Functions that are a part of their callers, and what the compiler is spared."""

import subprocess
import sys

import numpy as np
from from_python import called

from pnfarm.engine import warm
from pnfarm.table.compiling.compiled import IS_COMPILED, compiled, inlined


@inlined
def half(value):
    """Half of it."""
    return value * 0.5


@inlined
def quarter(values, place):
    """A quarter of one value; it calls another part."""
    return half(half(values[place]))


@compiled
def quarters(values):
    """A quarter of each."""
    total = 0.0
    for place in range(len(values)):
        total += quarter(values, place)
    return total


def test_a_compiled_function_has_the_parts_that_it_calls_in_its_machine_code():
    assert quarters(np.array([4.0, 8.0, 12.0])) == 6.0


def test_a_test_can_call_a_part_by_itself():
    assert called(quarter)(np.array([1.0, 2.0]), 1) == 0.5


#: Compares the fast paths with Numba's own, in a process of its own: they stay for good.
SPARED = """
from numba.core import targetconfig
from numba.core.compiler import Flags
from pnfarm.engine import warm

def some():
    plain, given, other, away = Flags(), Flags(), Flags(), Flags()
    given.nrt = Flags().nrt
    other.forceinline = True
    away.forceinline = True
    away.no_cfunc_wrapper = True
    return plain, given, other, other.copy(), away

def seen():
    flags = some()
    return [(a == b, a != b, hash(a) == hash(b)) for a in flags for b in (*flags, None)], [hash(f) for f in flags]

before = seen()
warm._spare_the_compiler()
assert seen() == before, (seen(), before)
assert len({equal for equal, *_ in before[0]}) == 2
with warm.event.install_timer("numba:llvm_lock", print):
    pass
print("the same")
"""


if IS_COMPILED:

    def test_a_part_has_no_machine_code_of_its_own_and_its_callers_have_it_once():
        quarters(np.zeros(1))
        (made,) = quarters.overloads.values()
        (part,) = quarter.overloads.values()
        assert made.library.get_pointer_to_function(made.fndesc.llvm_func_name)
        assert not part.library.get_pointer_to_function(part.fndesc.llvm_func_name)

    def test_the_fast_paths_of_the_compiler_come_to_the_same_results():
        done = subprocess.run([sys.executable, "-c", SPARED], capture_output=True, text=True, check=False, timeout=120)
        assert done.stdout == "the same\n", done.stderr


def test_the_compiler_is_spared_in_processes_that_do_nothing_else():
    from numba.core import targetconfig

    assert warm.HALVES
    assert targetconfig.TargetConfig.__hash__.__module__.startswith("numba")
