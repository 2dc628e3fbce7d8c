"""The part of a fault's target that is the machine around the drive: limit switches, inputs, enable, supply, load.

None of it changes with the drive's control supply.
"""

from __future__ import annotations

import math
from collections import Counter
from typing import TYPE_CHECKING

from pnfarm.table.axis_codes import LACKS_ENABLE, LACKS_SUPPLY

if TYPE_CHECKING:
    from pnfarm.drives.axis_handle import AxisHandle

__all__ = ["MachineTarget"]

#: Bits of the axis's ``fault_limits`` and ``hindrances``.
_LIMIT_BITS = {"negative": 0x1, "positive": 0x2}
_LACKS = {"enable": LACKS_ENABLE, "supply": LACKS_SUPPLY}


class MachineTarget:
    """See :class:`~pnfarm.faults.target.FaultTarget`; every call counts, so that two faults may ask for the same."""

    def __init__(self, handle: AxisHandle) -> None:
        self._handle = handle
        self._limits: Counter[str] = Counter()
        self._lacks: Counter[str] = Counter()
        self._inputs: Counter[int] = Counter()
        #: Torque, inertia and friction of each load that faults put on the shaft.
        self._loads: list[tuple[float, float, float]] = []

    def reach_limit(self, side: str) -> None:
        self._limits[side] += 1
        self._put_limits()

    def leave_limit(self, side: str) -> None:
        self._limits[side] -= 1
        self._put_limits()

    def _put_limits(self) -> None:
        """The switches belong to the machine: the drive's supply changes nothing of them."""
        reached = sum(bit for side, bit in _LIMIT_BITS.items() if self._limits[side])
        self._handle.axis.fault_limits = reached

    def lack(self, what: str) -> None:
        self._lacks[what] += 1
        self._put_hindrances()

    def regain(self, what: str) -> None:
        self._lacks[what] -= 1
        self._put_hindrances()

    def _put_hindrances(self) -> None:
        missing = sum(bit for what, bit in _LACKS.items() if self._lacks[what])
        self._handle.axis.hindrances = missing

    def switch_input(self, number: int) -> None:
        self._inputs[number] += 1
        self._put_inputs()

    def release_input(self, number: int) -> None:
        self._inputs[number] -= 1
        self._put_inputs()

    def _put_inputs(self) -> None:
        self._handle.axis.fault_inputs = sum(1 << number for number, count in self._inputs.items() if count)

    def put_load(self, torque: float, inertia: float, friction: float) -> None:
        self._loads.append((torque, inertia, friction))
        self._put_loads()

    def take_load(self, torque: float, inertia: float, friction: float) -> None:
        self._loads.remove((torque, inertia, friction))
        self._put_loads()

    def _put_loads(self) -> None:
        """Summed anew each time: a running sum of floats would keep a remainder of what is gone."""
        axis = self._handle.axis
        axis.added_torque = math.fsum(torque for torque, _, _ in self._loads)
        axis.added_inertia = math.fsum(inertia for _, inertia, _ in self._loads)
        axis.added_friction = math.fsum(friction for _, _, friction in self._loads)
