"""The engine's loops call a drive's step by its address."""

import llvmlite.binding
import numba

from pnfarm.engine import tick
from pnfarm.engine.columns import allocate
from pnfarm.firmware.step import step
from pnfarm.table.compiling.compiled import IS_COMPILED


def test_the_loops_share_one_machine_code_of_a_drives_step():
    allocate(images=1)
    if not IS_COMPILED or numba.config.BOUNDSCHECK:
        assert tick._step is step
        return
    assert llvmlite.binding.address_of_symbol("pnfarm_step")
    columns = allocate(images=1, axes=1, channels=1)
    columns.axis[0].front = columns.axis[0].powered = 1
    tick.tick(columns, 0, 5_000_000)
    assert columns.axis[0].last_ns == 5_000_000


if IS_COMPILED and not numba.config.BOUNDSCHECK:

    def test_a_step_is_linked_once():
        allocate(images=1)
        first = llvmlite.binding.address_of_symbol("pnfarm_step")
        allocate(images=2)
        assert llvmlite.binding.address_of_symbol("pnfarm_step") == first
